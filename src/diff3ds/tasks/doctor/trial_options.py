"""Options of `diff3ds doctor --try`. Needs no torch."""

from dataclasses import dataclass, fields
from typing import Annotated

from tyro.conf import arg

from diff3ds.guidance.recipe import Precision
from diff3ds.tasks.text_image.prior_options import FOR_PHRASES, FOR_PICTURES, PriorOptions, require_name

# The exact prior has no weights that could be wrong.
CAN_BE_TRIED = ("small", *FOR_PHRASES, *FOR_PICTURES)


@dataclass(frozen=True)
class TrialOptions:
    """A prior that is tried.

    Attributes:
        prior: a prior to try, in two minutes: small, mvdream, stable-diffusion, stable-diffusion-768, zero123 or
            stable-zero123. Its weights must be here.
        weights: others than those that are known: a folder, a file, or owner/name[@revision] once fetched.
        variant: as of "diff3ds text".
        allow_pickle: as of "diff3ds text".
        device: where it computes: auto (the first of cuda, mps, cpu), cpu, cuda, cuda:1, mps.
        precision: of the network: auto, float16, bfloat16, float32.
    """

    prior: Annotated[str | None, arg(name="try")] = None
    weights: str | None = None
    variant: str | None = None
    allow_pickle: bool = False
    device: str = "auto"
    precision: Precision = "auto"

    def __post_init__(self) -> None:
        if self.prior is not None:
            require_name(self.prior, CAN_BE_TRIED)
            self.of_prior()
        elif any(getattr(self, option.name) != option.default for option in fields(self)):
            raise ValueError("these options are of a prior that is tried: name it with --try")

    def of_prior(self) -> PriorOptions:
        """The same as the commands that draw take it.

        Raises:
            ValueError: as `PriorOptions`.
        """
        given = {"weights": self.weights, "variant": self.variant, "allow_pickle": self.allow_pickle}
        return PriorOptions(prior=self.prior, device=self.device, precision=self.precision, **given)  # type: ignore[arg-type]
