"""A picture to a 3D sketch: what `diff3ds image` does."""

import hashlib
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import orbit
from diff3ds.formats import save_png
from diff3ds.guidance.zero123 import ReferencePose
from diff3ds.library.phrase import Request, parse
from diff3ds.pictures.options import PictureOptions
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.sketch import DEFAULT_WIDTH, Sketch
from diff3ds.tasks.exact_prior.exemplars import FITTING, SIZE, WIDTH, Exemplars, exemplars_like
from diff3ds.tasks.exact_prior.folder_views import recognise_in
from diff3ds.tasks.exact_prior.sketch_folder import read_sketches
from diff3ds.tasks.progress import Report
from diff3ds.tasks.recognition.lines import Lines, lines_of
from diff3ds.tasks.recognition.recognise import Recognised, alike, drawn_over, recognise
from diff3ds.tasks.results import claim
from diff3ds.tasks.small_prior.small_prior import trained
from diff3ds.tasks.text_image import sharpen
from diff3ds.tasks.text_image.built_in import Chosen, Color, check, run, start_width
from diff3ds.tasks.text_image.distill_options import DistillOptions
from diff3ds.tasks.text_image.distillation import CHECKPOINT, Commission, distill
from diff3ds.tasks.text_image.options import BUILT_IN, FOR_PICTURES, ImageOptions, PriorOptions
from diff3ds.tasks.text_image.priors import best_for_pictures, load_for_picture, loaded, named_prior
from diff3ds.tasks.text_image.reference_view import Reference
from diff3ds.weights.catalog import KNOWN

# The paper's weight of guidance for pictures.
GUIDANCE = 7.5
# With the built-in prior, whose loss is a sum over the pixels of four views. Empirical (benchmarks/recognise.py).
REFERENCE_LOSS = 3000.0
# The distance at which Stable-Zero123 has all its cameras; of the reference picture's camera.
DISTANCE = 2.0


@torch_on_one_thread()
def run_image(
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
        options: of this command; by default those of its class, as the next three.
        cut: where the object is, and how it is framed.
        prior: which prior, and its weights.
        settings: of the distillation.
        report: called after every step.
        say: told which prior is taken and why, what a user should know of it, and what is recognised.

    Raises:
        ValueError, OSError: as `read_reference`, `claim`, the prior's loader or `recognise`, and `distill`.
    """
    options, cut = options or ImageOptions(), cut or PictureOptions()
    prior, settings = prior or PriorOptions(), settings or DistillOptions()
    if prior.prior is None:
        name, reason = best_for_pictures(prior.device)
        say(f"prior: {reason}")
    else:
        name = named_prior(prior, (*FOR_PICTURES, *BUILT_IN))
    if name in BUILT_IN:
        return _built_in(picture, out, options, cut, prior, name, settings, report, say)
    if options.shows:
        raise ValueError("--shows is for the built-in prior: networks see what is there")
    settings = _at_its_distance(settings) if name == "stable-zero123" else settings
    reference = read_reference(picture, options=cut)
    claim(out, out / CHECKPOINT, settings.resume, settings.overwrite)
    if KNOWN[name].warning:
        say(KNOWN[name].warning)
    low, high = settings.elevation
    if not low <= options.view_elevation <= high:
        say(
            f"warning: no camera comes by the picture's own view: --view-elevation {options.view_elevation:g} lies "
            f"outside --elevation {low:g} {high:g}; widen the latter"
        )
    pose = ReferencePose(options.view_elevation, distance=DISTANCE)
    denoiser = load_for_picture(name, reference.image, pose, prior, settings.work())
    if not settings.resume:
        save_png(out / "reference.png", reference.image)
    known = Reference(
        reference.image,
        orbit(pose.azimuth, pose.elevation, pose.distance, fov=settings.fov, size=reference.image.shape[0]),
        options.reference_loss or 0.0,
    )
    about, network = {**_subject(picture, cut, options, known), "prior": name}, loaded(name, prior, denoiser.unet)
    wanted = Commission(about, GUIDANCE, reference=known if known.weight else None, network=network)
    return distill(denoiser, settings, out, wanted, report)


def _built_in(
    picture: Path,
    out: Path,
    options: ImageOptions,
    cut: PictureOptions,
    prior: PriorOptions,
    name: str,
    settings: DistillOptions,
    report: Report,
    say: Callable[[str], None],
) -> Sketch:
    """What the picture shows is recognised, its lines are the reference; the prior is members like it, or a network."""
    check(settings)
    reference = read_reference(picture, options=cut)
    lines = lines_of(reference)
    folder = None if prior.library is None else read_sketches(prior.library, prior.up)
    if folder is None:
        found, exemplars = _looked_up(lines, options.shows, settings.seed)
    else:
        for warning in folder.warnings:
            say(warning)
        say(f"library: {folder}")
        found, exemplars = recognise_in(folder, lines, options.shows)
    claim(out, out / CHECKPOINT, settings.resume, settings.overwrite)
    say(f"{'taken for' if options.shows else 'recognised'}: {found}")
    like = exemplars.members[0]
    weight = options.reference_loss

    def seen(size: int, width: float, color: Color | None = None) -> Reference:
        resized = found.camera.resize(size)
        drawn = inked(drawn_over(lines, like, resized, width), color)
        return Reference(drawn, resized, REFERENCE_LOSS if weight is None else weight)

    if name == "small":
        small = trained(prior)
        view = seen(small.network.shape.size, WIDTH)
        denoiser = small.asked(Request(found.category, found.attributes), view.picture[None], view.cameras)
        chosen = Chosen.of_network(denoiser, small.about, exemplars.color)
    else:
        chosen = Chosen.of_members(exemplars, folder, settings)
    known = seen(settings.size or SIZE, start_width(settings), chosen.start)
    if not settings.resume:
        save_png(out / "reference.png", reference.image)
        save_png(out / "lines.png", seen(len(reference.image), DEFAULT_WIDTH).picture)
    about = {**_subject(picture, cut, options, known), "prior": name, "recognised": found.as_json()}
    both = (known, seen(sharpen.SIZE, sharpen.WIDTH, chosen.start)) if known.weight else ()
    return run(chosen, about, GUIDANCE, settings, out, report, *both)


def inked(picture: Float[Tensor, "H W 3"], color: Color | None) -> Float[Tensor, "H W 3"]:
    """A black drawing on white, in this colour: the strokes that are compared with it have it."""
    return picture if color is None else 1 - (1 - picture) * (1 - picture.new_tensor(color))


def _looked_up(lines: Lines, shows: str | None, seed: int) -> tuple[Recognised, Exemplars]:
    """What lines show, of the built-in library, and members like them."""
    asked = _asked(shows)
    found = recognise(lines) if asked is None else recognise(lines, asked.category, asked.attributes)
    color = asked.color if asked else None
    return found, exemplars_like(alike(lines, found, FITTING), found.category, seed, color)


def _asked(shows: str | None) -> Request | None:
    if shows is None:
        return None
    request = parse(shows)
    if request.count != 1:
        raise ValueError(f"{shows!r}: the built-in prior looks for one thing in a picture")
    if request.stretch != (1.0, 1.0, 1.0):
        raise ValueError(f"{shows!r}: proportions are the picture's own: leave words such as tall out")
    if request.ignored:
        raise ValueError(f"{shows!r}: the size is the picture's own: leave words such as big out")
    return request


def _subject(picture: Path, cut: PictureOptions, options: ImageOptions, known: Reference) -> dict[str, object]:
    """What run.json says of the picture."""
    cutting = {key: str(value) if isinstance(value, Path) else value for key, value in asdict(cut).items()}
    digest = hashlib.sha256(picture.read_bytes()).hexdigest()
    return {
        "picture": str(picture),
        "picture_sha256": digest,
        **cutting,
        **asdict(options),
        "reference_loss": known.weight,
    }


def _at_its_distance(settings: DistillOptions) -> DistillOptions:
    """The cameras of Stable-Zero123, which knows one distance only."""
    if settings.distance not in (DistillOptions().distance, (DISTANCE, DISTANCE)):
        raise ValueError(f"stable-zero123 sees from {DISTANCE} only: leave --distance out, got {settings.distance}")
    return replace(settings, distance=(DISTANCE, DISTANCE))
