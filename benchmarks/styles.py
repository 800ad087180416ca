"""The page of styles: three sketches in every style, as one picture; and how long a hundred strokes take in each.

OMP_NUM_THREADS=1 python benchmarks/styles.py docs/pictures/styles.webp
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from PIL import Image, ImageDraw
from report import show

import diff3ds as ds
from diff3ds import styles
from diff3ds.formats.framing import framed
from diff3ds.formats.png import as_pillow
from diff3ds.library import member

LEAF = Path(__file__).parents[1] / "docs" / "pictures" / "leaf.svg"
BLACK = (0.09, 0.09, 0.1)
# Kinds of the built-in library, with the colours of the styles that have one.
SKETCHES = {"teapot": (0.12, 0.25, 0.5), "flower": (0.7, 0.16, 0.22), "umbrella": (0.05, 0.38, 0.33)}
STYLES: dict[str, tuple[styles.Style, bool]] = {
    "ink": (styles.Ink(), False),
    "pencil": (styles.PENCIL, False),
    "charcoal": (styles.CHARCOAL, False),
    "marker": (styles.Marker(), True),
    "nib": (styles.Nib(), True),
    "watercolour": (styles.Watercolour(), True),
    "technical": (styles.Technical(), False),
    "dashed": (styles.Dashed(), False),
    "stretched": (styles.stretched(LEAF), True),
    "scattered": (styles.scattered(LEAF), True),
}
CELL, LABEL, QUALITY = 300, 22, 88


def sheet() -> Image.Image:
    """Styles in two columns, each with the three sketches beside each other."""
    rows = (len(STYLES) + 1) // 2
    page = Image.new("RGB", (2 * len(SKETCHES) * CELL, rows * (CELL + LABEL)), "white")
    write = ImageDraw.Draw(page)
    for place, (name, (style, colored)) in enumerate(STYLES.items()):
        column, row = divmod(place, rows)
        left, top = column * len(SKETCHES) * CELL, row * (CELL + LABEL)
        write.text((left + 6, top + 5), name, fill=(60, 60, 60))
        for k, (kind, color) in enumerate(SKETCHES.items()):
            sketch = member(kind, torch.Generator().manual_seed(3)).sketch
            ink = torch.tensor(color if colored else BLACK).expand(len(sketch), 3)
            cameras = framed(sketch, 30, 18, size=CELL)
            text = styles.styled_svg(replace(sketch, color=ink), cameras, style, depth_cue=0.35, paper=True)
            page.paste(as_pillow(styles.svg_pixels(text)[..., :3]), (left + k * CELL, top + LABEL))
    return page


def figures() -> list[tuple[str, float, int, float]]:
    """For each style: processor seconds of 100 random strokes at 512 pixels, kB of the SVG, points a stroke."""
    sketch = ds.Sketch.random(100, generator=torch.Generator().manual_seed(0))
    cameras, found = framed(sketch, 30, 20, size=512), []
    for name, (style, _) in STYLES.items():
        times = []
        for _ in range(5):
            begun = time.process_time()
            text = styles.styled_svg(sketch, cameras, style)
            times.append(time.process_time() - begun)
        found.append((name, float(np.median(times)), len(text) // 1000, text.count(",") / len(sketch)))
    return found


def main() -> None:
    """Draws the page and shows the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("picture", type=Path)
    sheet().save(parser.parse_args().picture, quality=QUALITY)
    torch.set_num_threads(1)
    show("100 strokes", ("style", "processor s", "kB", "points a stroke"), figures())


if __name__ == "__main__":
    main()
