"""OBJ files: strokes as polylines with the strokes' colours at their vertices; z up.

Lines (`l`) are what nearly every program that reads OBJ takes; the rational curves of the format (`curv`) hardly any
does, and tubes are what PLY and GLB files have.
"""

from pathlib import Path

from diff3ds._files import write_text
from diff3ds.formats.opening import check_sketch
from diff3ds.formats.scenes.polylines import polylines_of
from diff3ds.sketch import Sketch


def save_obj(path: str | Path, sketch: Sketch) -> None:
    """Writes an OBJ file, whole or not at all.

    Each stroke is an object called "stroke_0", "stroke_1" and so on, of one line that is off by 1e-4 of the sketch's
    radius at most. Not kept: widths and opacities.

    Raises:
        ValueError: no strokes, or values that have become invalid since the sketch was made.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_sketch(path, sketch, "an OBJ")
    lines, last = ["# strokes as lines, z up"], 0
    colors = sketch.color.detach().double().clamp(0, 1).tolist()
    for stroke, (line, color) in enumerate(zip(polylines_of(sketch), colors, strict=True)):
        look = " ".join(f"{channel:.6g}" for channel in color)
        lines.append(f"o stroke_{stroke}")
        lines += [f"v {x!r} {y!r} {z!r} {look}" for x, y, z in line.vertices.tolist()]
        numbers = [*range(last + 1, last + len(line.vertices) + 1), *([last + 1] if line.closed else [])]
        lines.append("l " + " ".join(map(str, numbers)))
        last += len(line.vertices)
    write_text(path, "\n".join(lines) + "\n")
