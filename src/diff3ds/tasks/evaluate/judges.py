"""The networks that score sketches of phrases and of pictures, each with its column of the table."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.detectors.hed import load_hed
from diff3ds.metrics.blip import BlipScore
from diff3ds.metrics.clip import ClipScore
from diff3ds.metrics.feature_stacks import Backbone
from diff3ds.metrics.hed_distance import HedDistance
from diff3ds.metrics.imagenet import ImageNetRank
from diff3ds.metrics.lpips import Lpips
from diff3ds.pictures.reading.resample import area_means
from diff3ds.tasks.evaluate.evaluate_options import JudgeOptions
from diff3ds.weights.judge_files import find_file, find_folder, read_network

# LPIPS compares pictures of this height and width, each pixel the mean over what it covers, as Magic123 does.
LPIPS_SIZE = 224

NOTHING_GIVEN = """no metric can be computed without weights; give one of
  --clip openai/clip-vit-base-patch16 openai/clip-vit-base-patch32   CLIP-Score of phrases and pictures
  --blip Salesforce/blip-itm-large-coco                              BLIP-Score of phrases
  --alexnet FILE --lpips-alex FILE                                   LPIPS of pictures
  --vgg16 FILE --lpips-vgg FILE                                      the same with VGG16
  --imagenet                                                         an ImageNet classifier's rank (extra judges)
  --hed                                                              distance as HED sees pictures (extra hed)"""


@dataclass(frozen=True, eq=False)
class Judges:
    """Loaded networks by the name of their column.

    Attributes:
        phrases: score views by a phrase.
        pictures: score views by a picture.
        likeness: distances of two pictures.
        imagenet: ranks the kind of thing.
    """

    phrases: dict[str, ClipScore | BlipScore]
    pictures: dict[str, ClipScore]
    likeness: dict[str, Lpips | HedDistance]
    imagenet: ImageNetRank | None = None

    def of_kind(self, views: Float[Tensor, "V H W 3"], kind: str | None) -> dict[str, float]:
        """How the classifier ranks this kind of thing."""
        return self.imagenet.scores(views, kind) if self.imagenet else {}

    def of_phrase(self, views: Float[Tensor, "V H W 3"], phrase: str) -> dict[str, float]:
        """Means over the views."""
        return {name: float(judge.text(views, phrase).mean()) for name, judge in self.phrases.items()}

    def of_picture(
        self, views: Float[Tensor, "V H W 3"], same: Float[Tensor, "H W 3"], picture: Float[Tensor, "S S 3"]
    ) -> dict[str, float]:
        """Means over the views, and the distance of the view from where the picture was taken."""
        scores = {name: float(judge.image(views, picture).mean()) for name, judge in self.pictures.items()}
        size = (LPIPS_SIZE, LPIPS_SIZE)
        a, b = (_resized(image[None], size) for image in (same, picture))
        return scores | self.of_pairs([(a, b)])

    def of_pairs(self, pairs: Iterable[tuple[Float[Tensor, "1 H W 3"], Float[Tensor, "1 H W 3"]]]) -> dict[str, float]:
        """Mean distances of pictures, pair by pair; nothing where there are none."""
        found: dict[str, list[float]] = {name: [] for name in self.likeness}
        for a, b in pairs if self.likeness else ():
            for name, judge in self.likeness.items():
                found[name].append(float(judge(a, b)))
        return {name: sum(some) / len(some) for name, some in found.items() if some}


def require_networks(options: JudgeOptions) -> None:
    """Raises ValueError if none is given; it says what could be."""
    if not (options.of_phrases or options.of_pictures):
        raise ValueError(NOTHING_GIVEN)


def load_judges(options: JudgeOptions, device: torch.device) -> Judges:
    """All networks, with their weights.

    Raises:
        ImportError, FileNotFoundError, ValueError: as `find_folder`, `find_file`, `read_network`, and the networks.
    """
    clips = {_label(text): ClipScore(find_folder(text, "CLIP"), device=device) for text in options.clip}
    phrases: dict[str, ClipScore | BlipScore] = {f"CLIP-T {label}": clip for label, clip in clips.items()}
    if options.blip:
        phrases[f"BLIP-ITC {_label(options.blip)}"] = BlipScore(find_folder(options.blip, "BLIP"), device=device)
    likeness: dict[str, Lpips | HedDistance] = {}
    wanted: Sequence[tuple[Backbone, str | None, str | None]] = (
        ("alex", options.alexnet, options.lpips_alex),
        ("vgg", options.vgg16, options.lpips_vgg),
    )
    for backbone, features, heads in wanted:
        if features and heads:
            likeness[f"LPIPS-{backbone}"] = _lpips(backbone, features, heads, device, options.allow_pickle)
    if options.hed:
        likeness["VGG-HED"] = HedDistance(load_hed(), device)
    pictures = {f"CLIP-I {label}": clip for label, clip in clips.items()}
    return Judges(phrases, pictures, likeness, ImageNetRank(device) if options.imagenet else None)


def _lpips(backbone: Backbone, features: str, heads: str, device: torch.device, allowed: Collection[Path]) -> Lpips:
    files = (
        find_file(features, f"{backbone} for LPIPS", "model.safetensors"),
        find_file(heads, f"LPIPS for {backbone}", f"{backbone}.safetensors"),
    )
    tensors = [read_network(file, allowed) for file in files]
    return Lpips(backbone, tensors[0], tensors[1], (str(files[0]), str(files[1])), device)


def _label(text: str) -> str:
    """A repository as it is, a folder by its name alone."""
    return Path(text).resolve().name if Path(text).exists() else text


def _resized(images: Float[Tensor, "B H W 3"], size: tuple[int, int]) -> Float[Tensor, "B h w 3"]:
    if min(images.shape[1:3]) >= max(size):
        return area_means(images, size)
    enlarged = torch.nn.functional.interpolate(images.movedim(-1, 1), size, mode="bilinear")
    return enlarged.movedim(1, -1)
