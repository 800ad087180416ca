"""Which prior looks at the sketch of `diff3ds text` or `diff3ds image`, and where it computes: options."""

from dataclasses import dataclass
from pathlib import Path

from diff3ds.guidance.recipe import Precision
from diff3ds.tasks.exact_prior.up_axis import Up
from diff3ds.weights.catalog import KNOWN
from diff3ds.weights.weight_options import Source

BUILT_IN = ("exemplar", "small")
FOR_PHRASES = ("mvdream", "stable-diffusion", "stable-diffusion-768")
FOR_PICTURES = ("zero123", "stable-zero123")


@dataclass(frozen=True)
class PriorOptions:
    """Which prior looks at the sketch, and where it computes.

    Attributes:
        prior: a name (see the command's help), or weights: a folder in the layout of diffusers, or a repository of the
            Hugging Face hub that was fetched, owner/name or owner/name@revision.
        library: a folder of sketches (sketch.json, STEP) or meshes for exemplar to know instead of the built-in
            library; files are named after what they are: chair_01.json, or chair/01.json.
        up: of a library's meshes, the axis that points up: z or y (as most of .obj from modelling programs). glTF
            defines it.
        weights: other weights for the prior of that name.
        variant: of the network's file of weights, such as fp16 or fp16_ema.
        allow_pickle: read the weights from this single file although it is a pickle. Pickles can run code of whoever
            made them; it is read in a mode that admits tensors only.
        device: auto (the first of cuda, mps, cpu), cpu, cuda, cuda:1, mps.
        precision: of the network: auto, float16, bfloat16, float32.
    """

    prior: str | None = None
    library: Path | None = None
    up: Up = "z"
    weights: str | None = None
    variant: str | None = None
    allow_pickle: bool = False
    device: str = "auto"
    precision: Precision = "auto"

    def __post_init__(self) -> None:
        if self.up != "z" and self.library is None:
            raise ValueError("--up is for the meshes of a library: name it with --library, or leave --up out")
        if self.library is not None and self.prior is None:
            object.__setattr__(self, "prior", "exemplar")
        if self.library is not None and self.prior != "exemplar":
            raise ValueError(f"a library is for the prior exemplar, and {self.prior} has none: leave one of them out")
        if self.weights and self.prior is None:
            raise ValueError(
                f"weights are of a prior: name it (--prior mvdream --weights {self.weights}), or --prior {self.weights}"
            )
        if self.weights and self.prior == "exemplar":
            raise ValueError("exemplar is built in and takes no weights: name another prior, or leave them out")
        if (self.variant or self.allow_pickle) and not (self.weights or is_place(self.prior or "")):
            raise ValueError("--variant and --allow-pickle are for weights that are named: add --weights")
        for name in ("variant", "allow_pickle", "precision"):
            if self.prior in BUILT_IN and getattr(self, name) != getattr(PriorOptions, name):
                option = name.replace("_", "-")
                raise ValueError(f"--{option} is for networks of diffusers, and {self.prior} is none: leave it out")

    def require(self, names: tuple[str, ...]) -> None:
        """Raises ValueError for a prior by a name that is none of `names`; what weights are, only they can say."""
        if self.prior is not None and not is_place(self.prior):
            require_name(self.prior, names)

    def source(self) -> Source | None:
        """The weights that are named, or None for those that are known."""
        place = self.weights or (self.prior if self.prior and is_place(self.prior) else None)
        return Source.parse(place, self.variant, self.allow_pickle) if place else None


def is_place(text: str) -> bool:
    """Whether it says where weights are. A name is a name, though the folder of an earlier run be called so."""
    return text not in ("", *KNOWN, *BUILT_IN) and ("/" in text or Path(text).exists())


def require_name(prior: str, names: tuple[str, ...]) -> None:
    """Raises ValueError for the name of a prior that is none of `names`."""
    if prior not in names:
        other = "this command needs" if prior in (*KNOWN, *BUILT_IN) else "prior must be"
        raise ValueError(
            f"{other} one of {', '.join(names)}, or a folder or fetched repository with weights of one; got {prior!r}"
        )
