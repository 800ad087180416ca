"""Draws hatched things: docs/pictures/hatching.webp.

A teapot, a cow where the data for development are, a flange, and the scene of a phrase, in a row each: lines, dots,
lines in ink and in pencil, and what a pen plotter draws.
"""

import argparse
import os
import tempfile
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from smooth_picture import turned

import diff3ds as ds
from diff3ds import styles
from diff3ds.curves.shapes.smooth_joints import sketch_of
from diff3ds.formats import save_svg
from diff3ds.formats.framing import framed
from diff3ds.formats.png import as_pillow
from diff3ds.library import member
from diff3ds.library.layout import arranged_solids
from diff3ds.library.scene import parse_scene
from diff3ds.page.drawn_paths import ink_boxes
from diff3ds.page.sheet.page_layout import filled
from diff3ds.page.sheet.page_setup import PageSetup
from diff3ds.surfaces.draw import visible_lines
from diff3ds.surfaces.lines.feature_curves import feature_curves

SIZE, PIXELS_WIDE, SPACING, PEN_MM = 320, 1.6, 4.0, 0.25
PHRASE = "a lamp on a table beside a chair"
# The page of what a plotter draws: as many millimetres as make a pixel the 96th of an inch.
PAGE = PageSetup(SIZE * 25.4 / 96, SIZE * 25.4 / 96, 0, "none")


def things() -> list[tuple[ds.Sketch, ds.TriangleMesh]]:
    """Sketches with their surfaces."""
    generator = torch.Generator().manual_seed(0)
    pot = member("teapot", generator)
    found = [(pot.sketch, welded(pot.faces))]
    spot = Path(os.environ.get("DIFF3DS_DATA", "../shared/data")) / "meshes" / "spot.obj"
    if spot.is_file():
        found.append(drawn_edges(ds.load_surface(spot, up="y", crease=180.0)))
    flange = [(0.3, 0), (1, 0), (1, 0.2), (0.55, 0.2), (0.55, 1), (0.3, 1)]
    found.append(drawn_edges(turned(flange, 64, closed=True)))
    scene = parse_scene(PHRASE)
    members = [member(thing.request.category, generator) for thing in scene.things]
    sketch, faces = arranged_solids(scene, [one.sketch for one in members], [one.faces for one in members])
    return [*found, (sketch, welded(faces))]


def welded(faces: torch.Tensor) -> ds.TriangleMesh:
    """Triangles with vertices in common."""
    corners = faces.reshape(-1, 3).numpy()
    _, at, number = np.unique(corners.round(7), axis=0, return_index=True, return_inverse=True)
    number = number.reshape(-1, 3)
    whole = (number != np.roll(number, 1, 1)).all(1)
    return ds.TriangleMesh(corners[at], number[whole])


def drawn_edges(mesh: ds.TriangleMesh) -> tuple[ds.Sketch, ds.TriangleMesh]:
    """A mesh with its creases."""
    return sketch_of(feature_curves(mesh).curves, 0.01), ds.smooth_surface(mesh, 0.2 * mesh.size / SIZE)


def row(sketch: ds.Sketch, mesh: ds.TriangleMesh) -> list[Image.Image]:
    """A thing in all ways."""
    sketch = sketch.replace(width=PIXELS_WIDE / SIZE).to(torch.float64)
    corners = ds.Sketch(torch.from_numpy(mesh.vertices[:, None].repeat(2, 1)))
    camera = framed(ds.Sketch.concatenate([sketch, corners]), -50.0, 25.0, size=SIZE)
    rough = [lines.drawn("drop") for lines in visible_lines(sketch, camera, mesh)]
    camera, _ = filled(camera, "page", ink_boxes(rough))
    lines, dots = (
        visible_lines(sketch, camera, mesh, hatch=ds.Hatch(spacing=SPACING, stipple=stipple))[0].drawn("drop")
        for stipple in (False, True)
    )
    inked = [styles.styled_svg(lines, camera, style) for style in (styles.Ink(width=1.2), styles.PENCIL)]
    with tempfile.TemporaryDirectory() as folder:
        plot = Path(folder) / "plot.svg"
        save_svg(plot, lines, camera, centerline=True, page=PAGE, pen_mm=PEN_MM, background=(1.0, 1.0, 1.0))
        texts = [*inked, plot.read_text()]
    pictures = [ds.render(each, camera).color[0].float() for each in (lines, dots)]
    return [as_pillow(picture) for picture in (*pictures, *(styles.svg_pixels(text)[..., :3] for text in texts))]


def main() -> None:
    """Draws."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    rows = [row(*thing) for thing in things()]
    sheet = Image.new("RGB", (SIZE * len(rows[0]), SIZE * len(rows)), "white")
    for y, pictures in enumerate(rows):
        for x, picture in enumerate(pictures):
            sheet.paste(picture.convert("RGB"), (x * SIZE, y * SIZE))
    sheet.save(parser.parse_args().file, quality=80)


if __name__ == "__main__":
    main()
