"""CLIP-Score (Radford et al. 2021; Hessel et al. 2021): cosines of views with a phrase, or with a picture."""

from functools import partial
from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.metrics.preprocess import CLIP_MEAN, CLIP_STD, normalized, square
from diff3ds.weights.clip_text import clip_tokens
from diff3ds.weights.pretrained import load_pretrained, token_ids

# What the text tower is given where only images matter.
ANY = "a"


class ClipScore:
    """One CLIP model, as ViT-B/16 (openai/clip-vit-base-patch16) or ViT-B/32.

    Scores are raw cosines in [-1, 1]: not times 100 or 2.5, and not clamped at 0, as some libraries have them.

    Args:
        folder: the model as on the hub (see `load_pretrained`).
        label: of the model in tables; default the folder's name.

    Raises:
        ImportError, FileNotFoundError, ValueError: as `load_pretrained`.
    """

    def __init__(self, folder: Path, label: str | None = None, device: torch.device | str = "cpu") -> None:
        self.label = folder.name if label is None else label
        self.model: Any
        self.model, self.tokenizer = load_pretrained(folder, "clip", "CLIPModel", device)
        self.size: int = self.model.config.vision_config.image_size
        self.most: int = self.model.config.text_config.max_position_embeddings

    def text(self, views: Float[Tensor, "V H W 3"], phrase: str) -> Float[Tensor, " V"]:
        """Cosines of views in [0, 1] with a phrase, with gradients to the views.

        Raises:
            ImportError: ftfy, which cleans phrases, is not installed.
            ValueError: an empty phrase; images of a wrong shape.
        """
        images, texts = self._embeddings(views, phrase)
        return images @ texts[0]

    def image(self, views: Float[Tensor, "V H W 3"], picture: Float[Tensor, "H1 W1 3"]) -> Float[Tensor, " V"]:
        """Cosines of views with a picture, all in [0, 1], with gradients to the views."""
        return self._embeddings(views, ANY)[0] @ self._embeddings(picture[None], ANY)[0][0]

    def _embeddings(self, views: Float[Tensor, "V H W 3"], phrase: str) -> tuple[Tensor, Tensor]:
        """Embeddings of length 1 of the views and the phrase.

        By the model's complete forward pass: what its get_image_features gives depends on the version of transformers.
        """
        pixels = normalized(square(views, self.size), CLIP_MEAN, CLIP_STD).to(self.model.device, self.model.dtype)
        tokens = token_ids(partial(clip_tokens, self.tokenizer), phrase, self.most, self.model.device)
        seen = self.model(pixel_values=pixels, **tokens)
        return seen.image_embeds, seen.text_embeds
