"""A picture to a 3D sketch: what `diff3ds image` does."""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import orbit
from diff3ds.formats import save_png
from diff3ds.guidance.networks.zero123 import ReferencePose
from diff3ds.library.faces import Faces
from diff3ds.library.phrase import Request, parse
from diff3ds.parallel.in_copies import in_copies
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.recognition.bend import Bend, bend_to
from diff3ds.recognition.picture_colors import PictureColors
from diff3ds.recognition.picture_lines import Lines, lines_of
from diff3ds.recognition.recognise import Guess, recognised, seen_as
from diff3ds.recognition.side_seen import PlacedLines, alike, gap, placed_over
from diff3ds.render.backends import torch_on_one_thread
from diff3ds.sketch import DEFAULT_WIDTH, Sketch
from diff3ds.tasks.exact_prior.exemplars import FITTING, SIZE, WIDTH, Color, Exemplars, exemplars_like
from diff3ds.tasks.exact_prior.folder_views import recognise_in
from diff3ds.tasks.exact_prior.left_out import drawn_strokes
from diff3ds.tasks.exact_prior.sketch_folder import SketchFolder, read_sketches
from diff3ds.tasks.progress import Report
from diff3ds.tasks.results import check_output_folder
from diff3ds.tasks.run_log import logged
from diff3ds.tasks.small_prior.small_prior import trained
from diff3ds.tasks.text_image.conditioned_prior import ConditionedPrior
from diff3ds.tasks.text_image.distillation import CHECKPOINT, distill
from diff3ds.tasks.text_image.prior_options import BUILT_IN, FOR_PICTURES
from diff3ds.tasks.text_image.priors import choose_prior, load_for_picture, loaded
from diff3ds.tasks.text_image.reference_view import Reference
from diff3ds.tasks.text_image.run_spec import CameraOptions, RunSpec
from diff3ds.tasks.text_image.subject import Picture
from diff3ds.weights.catalog import KNOWN

# With the built-in prior, whose loss is a sum over the pixels of four views. Empirical (benchmarks/recognise.py).
REFERENCE_LOSS = 3000.0
# The distance at which Stable-Zero123 has all its cameras; of the reference picture's camera.
DISTANCE = 2.0


@torch_on_one_thread()
def run_image(
    spec: RunSpec[Picture],
    out: Path,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> Sketch:
    """Makes a sketch of the object in a picture and writes the folder of the run, with the picture as it was taken.

    Args:
        spec: the picture (RGBA, or with a mask, or with a plain background), and how its object is drawn.
        out: folder of the results and of the checkpoint.
        report: called after every step.
        say: told which prior is taken and why, what a user should know of it, and what is recognised.

    Raises:
        ValueError, OSError: as `read_reference`, `check_output_folder`, the prior's loader or `recognise`, and
            `distill`.
    """
    with logged(out, report, say) as (report, say):
        return _made(spec, out, report, say)


def _made(spec: RunSpec[Picture], out: Path, report: Report, say: Callable[[str], None]) -> Sketch:
    """Chooses the prior, shows it the picture, and draws."""
    name = choose_prior(spec.prior, FOR_PICTURES, say)
    if name in BUILT_IN:
        return distill(_built_in(name, spec, out, say), spec, out, report)
    if name == "stable-zero123":
        spec = replace(spec, cameras=_at_its_distance(spec.cameras))
    return distill(_network(name, spec, out, say), spec, out, report)


def _network(name: str, spec: RunSpec[Picture], out: Path, say: Callable[[str], None]) -> ConditionedPrior:
    """A network with weights, told the picture, which is written as it was taken."""
    subject, cameras = spec.subject, spec.cameras
    if subject.shows:
        raise ValueError("--shows is for the built-in prior: networks see what is there")
    picture = read_reference(subject.picture, options=subject.cut).image
    check_output_folder(out, out / CHECKPOINT, spec.output.resume, spec.output.overwrite)
    if KNOWN[name].warning:
        say(KNOWN[name].warning)
    low, high = cameras.elevation
    if not low <= subject.view_elevation <= high:
        say(
            f"warning: no camera comes by the picture's own view: --view-elevation {subject.view_elevation:g} lies "
            f"outside --elevation {low:g} {high:g}; widen the latter"
        )
    pose = ReferencePose(subject.view_elevation, distance=DISTANCE)
    denoiser = load_for_picture(name, picture, pose, spec.prior, spec.work())
    if not spec.output.resume:
        save_png(out / "reference.png", picture)
    camera = orbit(pose.azimuth, pose.elevation, pose.distance, fov=cameras.fov, size=picture.shape[0])
    weight = subject.reference_loss or 0.0
    reference = Reference(picture, camera, weight) if weight else None
    return ConditionedPrior(name, denoiser, _told(subject, weight), loaded(name, spec.prior, denoiser.unet), reference)


def _built_in(name: str, spec: RunSpec[Picture], out: Path, say: Callable[[str], None]) -> ConditionedPrior:
    """A prior that is built in: what the picture shows is recognised, its lines are the reference."""
    spec.check_built_in()
    subject = spec.subject
    check_output_folder(out, out / CHECKPOINT, spec.output.resume, spec.output.overwrite)
    picture = read_reference(subject.picture, options=subject.cut)
    lines = lines_of(picture)
    folder = None if spec.prior.library is None else read_sketches(spec.prior.library, spec.prior.up)
    found, alike = _recognised(lines, folder, spec, say)
    placed = placed_over(lines, alike.members[0], found.camera)
    exemplars = _bent(alike, placed)
    say(f"{'taken for' if subject.shows else 'recognised'}: {found}")
    weight = REFERENCE_LOSS if subject.reference_loss is None else subject.reference_loss

    def drawn(size: int, width: float, color: Color | None = None) -> Reference:
        """The lines of the picture in strokes of this width and colour."""
        return Reference(inked(placed.picture(size, width), color), found.camera.resize(size), weight)

    told = {**_told(subject, weight), "recognised": found.as_json()}
    size, width, color = spec.cameras.size or SIZE, spec.width(WIDTH), exemplars.color
    # A colour that was asked for, or those of the user's own sketches, come first.
    colors = PictureColors.of(placed) if color is None and folder is None else None
    if name == "small":
        small = trained(spec.prior.weights, spec.prior.device)
        view = drawn(small.network.shape.size, WIDTH)
        denoiser = small.asked(Request(found.kind, found.attributes), view.picture[None], view.cameras)
        prior = ConditionedPrior.of_small(small, denoiser, color, told, drawn(size, width) if weight else None, colors)
    else:
        reference = drawn(size, width, color) if weight else None
        prior = ConditionedPrior.of_exemplars(exemplars, folder, spec, told, reference, colors)
    if not spec.output.resume:
        save_png(out / "reference.png", picture.image)
        save_png(out / "lines.png", drawn(len(picture.image), DEFAULT_WIDTH).picture)
    return prior


def _recognised(
    lines: Lines, folder: SketchFolder | None, spec: RunSpec[Picture], say: Callable[[str], None]
) -> tuple[Guess, Exemplars]:
    """Recognises what lines show, and finds members like it, in the built-in library or in the user's own."""
    if folder is None:
        return _looked_up(lines, spec.subject.shows, spec.descent.seed)
    for warning in folder.warnings:
        say(warning)
    say(f"library: {folder}")
    return recognise_in(folder, lines, spec.subject.shows)


def _bent(exemplars: Exemplars, lines: PlacedLines) -> Exemplars:
    """What a picture shows, bent towards its lines, the nearest to them first, without details that it lacks."""
    meant = exemplars.meant
    bends = in_copies(lambda i: bend_to(meant[i], lines, exemplars.mirrored), len(meant), len(meant))
    members = [bend.sketch(member) for bend, member in zip(bends, meant, strict=True)]
    others = [m for m, fits in zip(exemplars.members, exemplars.fitting, strict=True) if not fits]
    order = sorted(range(len(members)), key=lambda i: gap(lines.lines, members[i], lines.camera))
    faces = [partial(_bent_faces, bends[i], exemplars.faces[i]) for i in order] if exemplars.faces else []
    for i, bent in enumerate(faces):
        stays = drawn_strokes(members[order[i]], exemplars.details[order[i]], bent(), lines)
        members[order[i]] = members[order[i]][stays.nonzero()[:, 0]]
    return replace(
        exemplars,
        members=(*(members[i] for i in order), *others),
        fitting=(True,) * len(members) + (False,) * len(others),
        faces=tuple(faces),
        details=(),
    )


def _bent_faces(bend: Bend, faces: Callable[[], Faces]) -> Faces:
    return bend.places(faces())


def inked(picture: Float[Tensor, "H W 3"], color: Color | None) -> Float[Tensor, "H W 3"]:
    """A black drawing on white, in this colour: the strokes that are compared with it have it."""
    return picture if color is None else 1 - (1 - picture) * (1 - picture.new_tensor(color))


def _looked_up(lines: Lines, shows: str | None, seed: int) -> tuple[Guess, Exemplars]:
    """Recognises what lines show, and finds members like it, in the built-in library."""
    asked = _asked(shows)
    found = recognised(lines) if asked is None else seen_as(lines, asked.category, asked.attributes)
    color = asked.color if asked else None
    return found, exemplars_like(
        alike(lines, found.kind, found.attributes, found.camera, FITTING), found.kind, seed, color
    )


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


def _told(subject: Picture, weight: float) -> dict[str, object]:
    """The entries of run.json about the picture beside its options."""
    return {
        "picture_sha256": hashlib.sha256(subject.picture.read_bytes()).hexdigest(),
        "reference_loss": weight,
    }


def _at_its_distance(cameras: CameraOptions) -> CameraOptions:
    """The cameras of Stable-Zero123, which knows one distance only."""
    if cameras.distance not in (CameraOptions().distance, (DISTANCE, DISTANCE)):
        raise ValueError(f"stable-zero123 sees from {DISTANCE} only: leave --distance out, got {cameras.distance}")
    return replace(cameras, distance=(DISTANCE, DISTANCE))
