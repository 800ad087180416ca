"""BLIP-Score (Li et al. 2022): cosines of views with a phrase in the space of BLIP's image-text contrast (ITC)."""

from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.metrics.preprocess import CLIP_MEAN, CLIP_STD, normalized, square
from diff3ds.weights.pretrained import load_pretrained, token_ids

# BLIP was trained with phrases of so many tokens at most.
MOST = 35


class BlipScore:
    """One BLIP model for retrieval, as Salesforce/blip-itm-large-coco.

    Its value is the cosine (ITC), not the probability of a match (ITM). Values of different checkpoints are not
    comparable: the one that most publications report, model_large.pth at 224 pixels, is none of the hub's.

    Args:
        folder: the model as on the hub (see `load_pretrained`).
        label: of the model in tables; default the folder's name.

    Raises:
        ImportError, FileNotFoundError, ValueError: as `load_pretrained`.
    """

    def __init__(self, folder: Path, label: str | None = None, device: torch.device | str = "cpu") -> None:
        self.label = folder.name if label is None else label
        self.model: Any
        self.model, self.tokenizer = load_pretrained(folder, "blip", "BlipForImageTextRetrieval", device)
        self.size: int = self.model.config.vision_config.image_size

    def text(self, views: Float[Tensor, "V H W 3"], phrase: str) -> Float[Tensor, " V"]:
        """Cosines of views in [0, 1] with a phrase, with gradients to the views.

        Raises:
            ValueError: an empty phrase; images of a wrong shape.
        """
        pixels = normalized(square(views, self.size), CLIP_MEAN, CLIP_STD).to(self.model.device, self.model.dtype)
        tokens = token_ids(self.tokenizer, phrase, MOST, self.model.device)
        cosines: Tensor = self.model(pixel_values=pixels, use_itm_head=False, **tokens).itm_score
        return cosines[:, 0]
