"""The edits of a drawing in another program, back on the strokes that it shows."""

import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import torch

from diff3ds.formats import save
from diff3ds.sketch import Sketch
from diff3ds.surfaces.shape.load_surface import load_surface
from diff3ds.tasks.apply.edited_paths import EditedFile, EditedPath, read_edited
from diff3ds.tasks.results import SURFACE, check_output_folder, seen_around, turntable, write_pictures
from diff3ds.tasks.sketch_input import load_sketch

# Widths and opacities in files have so many digits: what differs by less is as it was. Shares.
SAME_WIDTH, SAME_OPACITY = 2e-3, 1e-5
# Half of the last digit of widths in files, and rounding.
ROUNDING = 6e-4
# So many are named of what is said.
NAMED = 8


def run_apply(
    edited: Path, source: Path, out: Path, overwrite: bool = False, say: Callable[[str], None] = lambda line: None
) -> Sketch:
    """Writes the sketch that an SVG file was drawn of with the file's colours, widths, opacities, names and deletions.

    All else stays as it is, to the last bit.

    Args:
        edited: the SVG file.
        source: the sketch, a file or the folder of a run.
        out: the new one: a folder if the source is one, else a file.
        overwrite: what is there may be lost.
        say: told what has changed, and what could not be matched.

    Raises:
        ValueError: a file that shows other strokes than the sketch has, or none of them; a sketch of which nothing
            would be left; as `load_sketch` and `read_drawing`; something is there already.
        OSError: as these.
    """
    _check_out(source, out, overwrite)
    sketch = load_sketch(source)
    file = read_edited(edited)
    beyond = sorted({n for path in file.paths for n in path.strokes if n >= len(sketch)})
    if beyond or not file.paths:
        fault = f"has stroke {beyond[0]}, and the sketch {len(sketch)} strokes" if beyond else "has no path of a stroke"
        raise ValueError(
            f"{edited} {fault}: give the SVG file that diff3ds render has drawn of {source}, whose paths kept their ids"
        )
    changed = _changed(sketch, file, say)
    there = {number for path in file.paths for number in path.strokes}
    gone = sorted((set(range(len(sketch))) if file.shown is None else file.shown) - there)
    if file.shown is None and gone:
        say("warning: the file does not say any more which strokes it showed: all that have no path are deleted")
    rows = [row for row in range(len(sketch)) if row not in set(gone)]
    if not rows:
        raise ValueError(f"{edited}: no stroke of the sketch would be left")
    if gone:
        say(f"deleted: {_listed(f'stroke {number}' for number in gone)}")
    if file.strangers:
        say(f"warning: of no stroke, and left out: {_listed(file.strangers)}")
    result = changed[rows] if gone else changed
    _write(source, out, result)
    return result


class _Edit(NamedTuple):
    """What a file has otherwise of a stroke, None where it is the same; `unclear`: it has several colours, or none."""

    color: tuple[int, int, int] | None
    opacity: float | None
    width: float | None
    name: str | None
    unclear: bool


def _changed(sketch: Sketch, file: EditedFile, say: Callable[[str], None]) -> Sketch:
    """The sketch with what the file has otherwise."""
    by_stroke: dict[int, list[EditedPath]] = {}
    for path in file.paths:
        for number in path.strokes:
            by_stroke.setdefault(number, []).append(path)
    unit = _unit(sketch, file)
    if unit is None and "width" in file.kept and any(path.width is not None for path in file.paths):
        say("warning: widths stay as they are: the file does not say how large the image is in it")
    edits = {number: _edit(sketch, number, paths, file, unit) for number, paths in by_stroke.items()}
    color, opacity, width = sketch.color.clone(), sketch.opacity.clone(), sketch.width.clone()
    names = list(sketch.names or ("",) * len(sketch))
    for number, edit in edits.items():
        if edit.color is not None:
            color[number] = torch.tensor(edit.color, dtype=torch.float64).to(color) / 255
        if edit.opacity is not None:
            opacity[number] = edit.opacity
        if edit.width is not None:
            width[number] = edit.width
        names[number] = edit.name or names[number]
    if unclear := [f"stroke {number}" for number, edit in edits.items() if edit.unclear]:
        say(f"warning: of several colours or of a gradient in the file: {_listed(unclear)}")
    fields = {"color": "colours", "opacity": "opacities", "width": "widths", "name": "names"}
    counts = {what: sum(getattr(e, f) is not None for e in edits.values()) for f, what in fields.items()}
    told = ", ".join(f"{count} {what}" for what, count in counts.items() if count)
    say(f"changed: {told or 'no colour, opacity, width or name'}")
    return sketch.replace(color=color, opacity=opacity, width=width, names=names)


def _edit(sketch: Sketch, number: int, paths: Sequence[EditedPath], file: EditedFile, unit: float | None) -> _Edit:
    """What the paths of a stroke have otherwise than it has; of several new values the first."""
    was = tuple(round(min(max(value, 0.0), 1.0) * 255) for value in sketch.color[number].tolist())
    colors = [path.color for path in paths if path.color not in (None, was)] if "color" in file.kept else []
    own = float(sketch.opacity[number])
    opacities = [path.opacity for path in paths if abs(path.opacity - own) > SAME_OPACITY]
    widths = []
    if unit is not None:
        wide = float(sketch.width[number])
        found = [path.width / unit for path in paths if path.width is not None]
        widths = [value for value in found if abs(value - wide) > SAME_WIDTH * wide + ROUNDING / unit]
    old = sketch.names[number] if sketch.names else ""
    labels = [path.label for path in paths if path.label not in ("", old) and len(path.strokes) == 1]
    return _Edit(
        color=colors[0] if colors else None,
        opacity=opacities[0] if opacities and "opacity" in file.kept else None,
        width=widths[0] if widths else None,
        name=labels[0] if labels else None,
        unclear="color" in file.kept and (len(set(colors)) > 1 or any(path.color is None for path in paths)),
    )


def _unit(sketch: Sketch, file: EditedFile) -> float | None:
    """Units of the file of a unit of width: as it says, or as most of its paths have it; None where nobody knows."""
    if "width" not in file.kept or sketch.width_space != "image" or sketch.width.ndim == 2:
        return None
    if file.height is not None:
        return file.height
    ratios = sorted(
        p.width / float(sketch.width[p.strokes[0]])
        for p in file.paths
        if p.width is not None and float(sketch.width[p.strokes[0]]) > 0
    )
    if not ratios:
        return None
    middle = ratios[len(ratios) // 2]
    alike = sum(abs(ratio - middle) <= SAME_WIDTH * middle for ratio in ratios)
    return middle if 2 * alike > len(ratios) else None


def _listed(texts: Iterable[str]) -> str:
    some = list(texts)
    return ", ".join(some[:NAMED]) + (f" and {len(some) - NAMED} more" if len(some) > NAMED else "")


def _check_out(source: Path, out: Path, overwrite: bool) -> None:
    """Sees that the new sketch may be written.

    Raises:
        ValueError: it may not.
    """
    if source.is_dir():
        if out.is_file() or out.suffix:
            raise ValueError(f"{out}: {source} is the folder of a run: give a folder for the new one")
        check_output_folder(out, out / "sketch.json", False, overwrite)
    elif out.exists() and not overwrite:
        raise ValueError(f"{out} is there already: give another file (-o), or --overwrite")


def _write(source: Path, out: Path, sketch: Sketch) -> None:
    """The new sketch; of a run views of it, the surface and what it says of itself as well."""
    if not source.is_dir():
        save(out, sketch)
        return
    out.mkdir(parents=True, exist_ok=True)
    save(out / "sketch.json", sketch)
    save(out / "sketch.step", sketch)
    surface = load_surface(source / SURFACE) if (source / SURFACE).exists() else None
    around = turntable(sketch)
    write_pictures(out, sketch, around, seen_around(sketch, around, surface), surface)
    for name in (SURFACE, "run.json"):
        if (source / name).exists():
            shutil.copyfile(source / name, out / name)
