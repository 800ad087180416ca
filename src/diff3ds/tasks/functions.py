"""A phrase, a picture, posed pictures or a mesh to a sketch, as functions: what the commands do, without progress."""

import logging
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diff3ds._settings import option_hints
from diff3ds.tasks.typed_options import filled

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import Tensor

    from diff3ds.recognition.recognise import Recognition
    from diff3ds.sketch import Sketch

_LOG = logging.getLogger("diff3ds")


def text_to_sketch(phrase: str, out: str | PathLike[str] | None = None, **options: Any) -> "Sketch":
    """Makes a sketch of a phrase, as `diff3ds text` does.

    What the command says, such as which prior it takes, goes to the logger diff3ds.

    Args:
        phrase: such as "a chair".
        out: folder for the files that the command writes; without one nothing is kept.
        options: those of the command by their names, such as `strokes=56`, `seed=1`, `prior="exemplar"`.

    Raises:
        TypeError: an option that the command does not have, or a value of another kind.
        ValueError, OSError, ImportError: as the command, whose message it is.
    """
    from diff3ds.tasks.text_image.run_spec import RunSpec
    from diff3ds.tasks.text_image.subject import Phrase
    from diff3ds.tasks.text_image.text import run_text

    spec = filled("text_to_sketch", RunSpec(Phrase(phrase)), _hints(RunSpec[Phrase]), options)
    with _folder(out, options) as folder:
        return run_text(spec, folder, say=_say)


def image_to_sketch(picture: str | PathLike[str], out: str | PathLike[str] | None = None, **options: Any) -> "Sketch":
    """Makes a sketch of the object in a picture, as `diff3ds image` does.

    What the command says, such as what it recognises, goes to the logger diff3ds.

    Args:
        picture: file of a photograph or drawing of one object.
        out: folder for the files that the command writes; without one nothing is kept.
        options: those of the command by their names, such as `shows="a mug"`, `mask="mask.png"`, `seed=1`.

    Raises:
        TypeError: an option that the command does not have, or a value of another kind.
        ValueError, OSError, ImportError: as the command, whose message it is.
    """
    from diff3ds.tasks.text_image.image import run_image
    from diff3ds.tasks.text_image.run_spec import RunSpec
    from diff3ds.tasks.text_image.subject import Picture

    spec = filled("image_to_sketch", RunSpec(Picture(Path(picture))), _hints(RunSpec[Picture]), options)
    with _folder(out, options) as folder:
        return run_image(spec, folder, say=_say)


def recognise(
    picture: "str | PathLike[str] | Tensor | NDArray[Any]",
    *,
    mask: str | PathLike[str] | None = None,
    background: str | None = None,
) -> "Recognition":
    """Says what a picture may show, and from where it is seen, as `diff3ds image --guess` does.

    Args:
        picture: file of a photograph or drawing of one object; or its pixels, (H, W) or (H, W, C), gray, RGB or
            straight RGBA: uint8, or floats from 0 to 1.
        mask: file of a picture of the same size, white where the object is.
        background: colour of a plain background: white, black or R,G,B, each from 0 to 1. By default the one along the
            borders.

    Returns:
        The three best guesses, each with `kind`, `confidence`, `azimuth` and `elevation`, and whether the first is sure
        enough to be drawn, `taken`.

    Raises:
        TypeError: the picture is neither a path nor an array.
        ValueError, OSError: as `diff3ds image`, whose message it is; an array that is no picture.
    """
    from diff3ds.pictures.picture_options import PictureOptions
    from diff3ds.pictures.reading.array import picture_of_array
    from diff3ds.pictures.reference_picture import read_reference
    from diff3ds.recognition.picture_lines import lines_of
    from diff3ds.recognition.recognise import recognise as recognise_lines

    cut = PictureOptions(None if mask is None else Path(mask), background)
    read = Path(picture) if isinstance(picture, str | PathLike) else picture_of_array(picture)
    return recognise_lines(lines_of(read_reference(read, options=cut)))


def views_to_sketch(
    source: str | PathLike[str] | None, out: str | PathLike[str] | None = None, **options: Any
) -> "Sketch":
    """Fits a sketch to posed pictures, as `diff3ds views` does.

    What the command says, such as which options change nothing, goes to the logger diff3ds.

    Args:
        source: a transforms.json or a folder with one; None is the scene of `diff3ds views --demo`.
        out: folder for the files that the command writes; without one nothing is kept.
        options: those of the command by their names, such as `target="color"`, `strokes=200`, `seed=1`.

    Returns:
        The sketch in the world of the cameras.

    Raises:
        TypeError: an option that the command does not have, or a value of another kind.
        ValueError, OSError, ImportError: as the command, whose message it is.
    """
    from diff3ds.tasks.views.run_views import run_views
    from diff3ds.tasks.views.views_options import ViewsOptions

    read = filled("views_to_sketch", ViewsOptions(), _hints(ViewsOptions), options)
    with _folder(out, options) as folder:
        return run_views(None if source is None else Path(source), folder, read, say=_say)


def mesh_to_sketch(source: str | PathLike[str], out: str | PathLike[str] | None = None, **options: Any) -> "Sketch":
    """Makes a sketch of a triangle mesh, as `diff3ds mesh` does: creases and borders, of smooth things outlines.

    What the command says goes to the logger diff3ds.

    Args:
        source: an OBJ, STL, PLY, OFF or glTF file, or solids in a STEP, IGES or BREP file.
        out: folder for the files that the command writes, drawings among them; without one nothing is kept.
        options: those of the command by their names, such as `up="y"`, `strokes=24`, `hidden="dashed"`.

    Returns:
        The sketch in the units of the file, of solids in millimetres, z up, float64; edges of solids by name.

    Raises:
        TypeError: an option that the command does not have, or a value of another kind.
        ValueError, OSError, ImportError: as the command, whose message it is.
    """
    from diff3ds.tasks.mesh.draw_mesh import run_mesh
    from diff3ds.tasks.mesh.mesh_options import MeshOptions

    read = filled("mesh_to_sketch", MeshOptions(), _hints(MeshOptions), options)
    with _folder(out, options) as folder:
        return run_mesh(Path(source), folder, read, say=_say)


def points_to_sketch(source: str | PathLike[str], out: str | PathLike[str] | None = None, **options: Any) -> "Sketch":
    """Makes a sketch of the edges in a cloud of points, as `diff3ds points` does.

    What the command says goes to the logger diff3ds.

    Args:
        source: a PLY, XYZ, NPY, PCD, LAS or LAZ file.
        out: folder for the files that the command writes; without one nothing is kept.
        options: those of the command by their names, such as `up="y"`, `seed=1`.

    Returns:
        The sketch in the units of the file, z up, float64.

    Raises:
        TypeError: an option that the command does not have, or a value of another kind.
        ValueError, OSError, ImportError: as the command, whose message it is.
    """
    from diff3ds.tasks.points.draw_points import run_points
    from diff3ds.tasks.points.points_options import PointsOptions

    read = filled("points_to_sketch", PointsOptions(), _hints(PointsOptions), options)
    with _folder(out, options) as folder:
        return run_points(Path(source), folder, read, say=_say)


def _hints(kind: Any) -> dict[str, Any]:
    """The type hints of all options of a command, but for what it draws."""
    return {name: hint for name, hint in option_hints(kind).items() if name not in ("phrase", "picture")}


@contextmanager
def _folder(out: str | PathLike[str] | None, options: Mapping[str, Any]) -> Iterator[Path]:
    """The folder of a run; without one, a new one that is gone at the end."""
    if out is not None:
        yield Path(out)
        return
    if needless := [name for name in ("resume", "overwrite") if options.get(name)]:
        raise ValueError(f"{needless[0]} is for the run in a folder: give out as well")
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder) / "run"


def _say(line: str) -> None:
    _LOG.log(logging.WARNING if line.startswith("warning: ") else logging.INFO, line.removeprefix("warning: "))
