"""Finished runs below a folder: what they were made of, and what they are compared as."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from diff3ds._files import read_json
from diff3ds._shapes import Float, Tensor
from diff3ds.formats import load_image
from diff3ds.library.phrase import parse
from diff3ds.pictures.picture_options import PictureOptions
from diff3ds.pictures.reference_picture import read_reference
from diff3ds.tasks.text_image.text_scene import PLAN, THINGS

Kind = Literal["phrase", "picture", "scene"]
KINDS: tuple[Kind, ...] = get_args(Kind)
_SAID = {"phrase": "a phrase", "picture": "a picture", "scene": "posed pictures"}


@dataclass(frozen=True)
class Run:
    """A finished run.

    Attributes:
        folder: with sketch.json and run.json.
        kind: what it was made of: a phrase, a picture, or a scene of posed pictures.
        method: the folders between the evaluated folder and this one; the former's name where there are none.
        record: what run.json says.
    """

    folder: Path
    kind: Kind
    method: str
    record: dict[str, Any]

    @property
    def options(self) -> dict[str, Any]:
        """As they were given."""
        options: dict[str, Any] = self.record["options"]
        return options

    @property
    def phrase(self) -> str | None:
        """That it was made of, or None."""
        return self.options.get("phrase")

    @property
    def subject(self) -> str:
        """The phrase, or the name of the picture or of the scene's folder."""
        if self.kind == "scene":
            return self.scene.resolve().name
        return self.phrase or Path(str(self.options.get("picture") or self.folder)).stem

    @property
    def thing(self) -> str | None:
        """The kind of thing that it is of, by the library's names, where that is one and known."""
        if self.phrase:
            with suppress(ValueError):
                return parse(self.phrase).category
            return None
        return (self.options.get("recognised") or {}).get("kind")

    @property
    def scene(self) -> Path:
        """The folder with the posed pictures."""
        source = Path(self.options["source"])
        return source.parent if source.suffix or source.is_file() else source


def find_runs(folder: Path, kinds: tuple[Kind, ...] = KINDS) -> list[Run]:
    """All runs of these kinds below a folder, by their path; others are left out, and so are the things of a scene.

    Raises:
        FileNotFoundError: no such folder.
        ValueError: no runs in it; a run.json that is none.
    """
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder; one with finished runs is needed")
    runs = []
    for path in sorted(folder.rglob("run.json")):
        content = read_json(path)
        given = content.get("options") if isinstance(content, dict) else None
        if not isinstance(given, dict):
            raise ValueError(f"{path}: not the run.json of a run: it has no options")
        place = path.parent
        kind = _kind(place, content)
        if kind not in kinds or _is_a_thing(place):
            continue
        if not (place / "sketch.json").is_file():
            raise ValueError(f"{place}: has a run.json but no sketch.json: finish the run, or take it away")
        between = place.relative_to(folder).parent if place != folder else Path()
        method = folder.resolve().name if between == Path() else between.as_posix()
        runs.append(Run(place, kind, method, content))
    if not runs:
        wanted = " or ".join(_SAID[kind] for kind in kinds)
        raise ValueError(f"{folder}: no run of {wanted} (folders with sketch.json and run.json) in it")
    return runs


def reference_of(run: Run) -> Float[Tensor, "S S 3"] | None:
    """The picture of a run on white, as the run saw it; None for a phrase.

    Raises:
        ValueError, OSError: as `load_image` and `read_reference`.
    """
    if run.phrase:
        return None
    kept = run.folder / "reference.png"
    if kept.is_file():
        image = load_image(kept)
        return image[..., :3] * image[..., 3:] + 1 - image[..., 3:] if image.shape[2] == 4 else image
    mask = run.options.get("mask")
    cut = PictureOptions(Path(mask) if mask else None, run.options.get("background"))
    return read_reference(Path(run.options["picture"]), options=cut).image


def _kind(place: Path, record: dict[str, Any]) -> Kind | None:
    """What a run was made of; None of what is not compared, such as a mesh, or the scene that the package generates."""
    options = record["options"]
    if options.get("phrase"):
        return "phrase"
    if options.get("picture") or (place / "reference.png").is_file():
        return "picture"
    # A mesh has no target.
    return "scene" if options.get("source", "demo") != "demo" and "target" in record else None


def _is_a_thing(place: Path) -> bool:
    """Whether a run drew one thing of a phrase with several, which is a run itself."""
    return place.parent.name == THINGS and (place.parents[1] / PLAN).is_file()
