"""A picture to a 3D sketch: what `diff3ds image` does."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from diff3ds.camera import orbit
from diff3ds.formats import save_png
from diff3ds.guidance.known import KNOWN
from diff3ds.guidance.zero123 import ReferencePose
from diff3ds.sketch import Sketch
from diff3ds.tasks.distill import CHECKPOINT, Reference, distill
from diff3ds.tasks.distill_options import DistillOptions
from diff3ds.tasks.picture import PictureOptions, read_reference
from diff3ds.tasks.priors import FOR_PICTURES, PriorOptions, load_for_picture, named_prior
from diff3ds.tasks.progress import Report
from diff3ds.tasks.results import claim

# The paper's weight of guidance for pictures.
GUIDANCE = 7.5
# The distance at which Stable-Zero123 has all its cameras; of the reference picture's camera.
DISTANCE = 2.0


@dataclass(frozen=True)
class ImageOptions:
    """Options of `diff3ds image` that `diff3ds text` lacks.

    Attributes:
        view_elevation: from how high the picture was taken, degrees; within the elevations of the cameras, so that
            they come by.
        reference_loss: weight of the difference between the sketch and the picture, seen from where it was taken,
            beside the prior's loss; the paper has none.
    """

    view_elevation: float = 0.0
    reference_loss: float = 0.0

    def __post_init__(self) -> None:
        if not self.reference_loss >= 0:
            raise ValueError(f"reference_loss must not be negative, got {self.reference_loss}")


def image_to_sketch(
    picture: Path,
    out: Path,
    options: ImageOptions | None = None,
    cut: PictureOptions | None = None,
    prior: PriorOptions | None = None,
    settings: DistillOptions | None = None,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> Sketch:
    """Makes a sketch of the object in a picture and writes the folder of the run, with the picture as it was taken.

    Args:
        picture: file: RGBA, or with a mask, or with a plain background.
        out: folder of the results and of the checkpoint.
        options, cut, prior, settings: defaults as in their classes.
        report: called after every step.
        say: told what a user should know of the prior.

    Raises:
        ValueError, OSError: as `read_reference`, `claim`, the prior's loader, and `distill`.
    """
    options, cut = options or ImageOptions(), cut or PictureOptions()
    prior, settings = prior or PriorOptions(), settings or DistillOptions()
    name = named_prior(prior, FOR_PICTURES) if prior.prior else FOR_PICTURES[0]
    settings = _at_its_distance(settings) if name == "stable-zero123" else settings
    reference = read_reference(picture, options=cut)
    claim(out, out / CHECKPOINT, settings.resume, settings.overwrite)
    if KNOWN[name].warning:
        say(KNOWN[name].warning)
    pose = ReferencePose(options.view_elevation, distance=DISTANCE)
    denoiser = load_for_picture(name, reference.image, pose, prior, settings.batch)
    save_png(out / "reference.png", reference.image)
    known = Reference(
        reference.image,
        orbit(pose.azimuth, pose.elevation, pose.distance, fov=settings.fov, size=reference.image.shape[0]),
        options.reference_loss,
    )
    cutting = {key: str(value) if isinstance(value, Path) else value for key, value in asdict(cut).items()}
    about = {"picture": str(picture), **cutting, **asdict(options), "prior": name, "weights": prior.weights}
    return distill(
        denoiser,
        settings,
        out,
        guidance=GUIDANCE,
        about=about,
        report=report,
        reference=known if options.reference_loss else None,
    )


def _at_its_distance(settings: DistillOptions) -> DistillOptions:
    """The cameras of Stable-Zero123, which knows one distance only."""
    if settings.distance not in (DistillOptions().distance, (DISTANCE, DISTANCE)):
        raise ValueError(f"stable-zero123 sees from {DISTANCE} only: leave --distance out, got {settings.distance}")
    return replace(settings, distance=(DISTANCE, DISTANCE))
