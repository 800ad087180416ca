"""A run with a prior that is built in: what `diff3ds text` and `diff3ds image` share."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from diff3ds.guidance.denoiser import Denoiser
from diff3ds.sketch import Sketch
from diff3ds.tasks.exact_prior.exemplars import WIDTH, Exemplars, painted, thin_lines
from diff3ds.tasks.exact_prior.sketch_folder import SketchFolder, identity_of
from diff3ds.tasks.progress import Report
from diff3ds.tasks.text_image.distill_options import DistillOptions
from diff3ds.tasks.text_image.distillation import Commission, distill
from diff3ds.tasks.text_image.reference_view import Reference
from diff3ds.tasks.text_image.sharpen import Sharpening

Color = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Chosen:
    """A prior that is built in, conditioned.

    Attributes:
        denoiser: behind the protocol of all priors.
        identity: which library, for run.json; a resumed run must have the same.
        color: of the results, straight RGB; None is black.
        start: of the strokes at the start, which are what the prior was shown.
        members: that the sketch is sharpened by; none for a network, which has none.
        network: as `Commission.network`.
    """

    denoiser: Denoiser
    identity: Mapping[str, object]
    color: Color | None
    start: Color | None
    members: Sequence[Sketch]
    network: Mapping[str, object]

    @classmethod
    def of_members(cls, known: Exemplars, folder: SketchFolder | None, settings: DistillOptions) -> "Chosen":
        """The exact prior of a library."""
        return cls(known.prior(start_width(settings)), identity_of(folder), known.color, known.color, known.meant, {})

    @classmethod
    def of_network(cls, denoiser: Denoiser, about: Mapping[str, object], color: Color | None) -> "Chosen":
        """The small prior, which was shown black strokes."""
        return cls(denoiser, {}, color, None, (), about)


def start_width(settings: DistillOptions) -> float:
    """Of the strokes at the start, as a fraction of the image height."""
    return WIDTH if settings.width is None else settings.width


def check(settings: DistillOptions) -> None:
    """Raises ValueError for what the priors that are built in cannot do."""
    if settings.method == "vsd":
        raise ValueError("vsd trains a network of diffusers, and the built-in priors have none: leave --method out")


def run(
    chosen: Chosen,
    about: Mapping[str, object],
    guidance: float,
    settings: DistillOptions,
    out: Path,
    report: Report,
    reference: Reference | None = None,
    fine_reference: Reference | None = None,
) -> Sketch:
    """Distils, sharpens and tidies.

    Args:
        about: the subject, for run.json.
        guidance: as `Commission.guidance`.
        reference: the picture of `diff3ds image`, with strokes as wide as the prior's.
        fine_reference: the same picture, with strokes as wide as `sharpen`'s.
    """
    wanted = Commission(
        {**about, **chosen.identity},
        guidance,
        "swift",
        start_width(settings),
        chosen.start,
        finish=lambda sketch: thin_lines(painted(sketch, chosen.color), settings),
        reference=reference,
        sharpening=Sharpening(chosen.members, fine_reference) if chosen.members else None,
        network=chosen.network,
    )
    return distill(chosen.denoiser, settings, out, wanted, report)
