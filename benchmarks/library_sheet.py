"""Contact sheet of the library: every category, plain and with each attribute, captions underneath.

    python benchmarks/library_sheet.py sheet.png [--only chair,table] [--seeds 0,1,2] [--azimuth 35] [--cell 200]
        [--hidden]

One row a category and seed. Prints how many strokes the members have. Some ten seconds on one core.
"""

import argparse
from pathlib import Path

import torch
from PIL import Image, ImageDraw, ImageFont

from diff3ds import TriangleMesh, orbit, render
from diff3ds._files import replacing
from diff3ds.library import CATEGORIES, Member, member

# A ball of radius one at distance 3 is seen under 2 asin(1 / 3) = 38.9 degrees.
DISTANCE, FIELD, ELEVATION = 3.0, 40.0, 20.0
CAPTION = 34


def cell(drawn: Member, azimuth: float, side: int, hidden: bool) -> Image.Image:
    """One member in a three-quarter view, with its caption, or without what its faces hide."""
    cameras = orbit(azimuth, ELEVATION, DISTANCE, fov=FIELD, size=side)
    surface = TriangleMesh.of_triangles(drawn.faces) if hidden and len(drawn.faces) else None
    pixels = (render(drawn.sketch, cameras, surface=surface).color[0, ..., 0].clamp(0, 1) * 255).round().to(torch.uint8)
    picture = Image.new("L", (side, side + CAPTION), "white")
    picture.paste(Image.fromarray(pixels.numpy()))
    words = drawn.caption.replace(" with", "\nwith", 1) if len(drawn.caption) > side // 8 else drawn.caption
    pen = ImageDraw.Draw(picture)
    pen.multiline_text(
        (side / 2, side), words, fill="black", anchor="ma", align="center", font=ImageFont.load_default(12)
    )
    return picture


def sheet(rows: list[list[Image.Image]], columns: int) -> Image.Image:
    """Rows of cells under each other; as many rows side by side as `columns` allows."""
    width, height = rows[0][0].size
    lines: list[list[Image.Image]] = [[]]
    for row in rows:
        if len(lines[-1]) + len(row) > columns:
            lines.append([])
        lines[-1] += row
    picture = Image.new("L", (columns * width, len(lines) * height), "white")
    for i, line in enumerate(lines):
        for j, one in enumerate(line):
            picture.paste(one, (j * width, i * height))
    return picture


def main() -> None:
    """Draws all and writes the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", type=Path, help="PNG file to write")
    parser.add_argument("--only", default=",".join(CATEGORIES), help="categories, separated by commas")
    parser.add_argument("--seeds", default="0", help="separated by commas")
    parser.add_argument("--azimuth", type=float, default=35.0, help="degrees from the front")
    parser.add_argument("--cell", type=int, default=200, help="side of one picture in pixels")
    parser.add_argument("--columns", type=int, default=12, help="pictures in a row")
    parser.add_argument("--hidden", action="store_true", help="leave out what the faces of the things hide")
    chosen = parser.parse_args()
    rows = []
    for name in chosen.only.split(","):
        for seed in map(int, chosen.seeds.split(",")):
            sets = [(), *((a.name,) for a in CATEGORIES[name].attributes)]
            drawn = [member(name, torch.Generator().manual_seed(seed), attributes) for attributes in sets]
            rows.append([cell(one, chosen.azimuth, chosen.cell, chosen.hidden) for one in drawn])
            print(f"{name:16} seed {seed}  strokes", *(len(one.sketch) for one in drawn))
    with replacing(chosen.output) as file:
        sheet(rows, chosen.columns).save(file, format="PNG", optimize=True)


if __name__ == "__main__":
    main()
