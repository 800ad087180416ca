"""A page of Blender's pictures of sketches of the gallery, as coloured tubes; needs Blender or bpy.

python benchmarks/blender_page.py docs/pictures/blender.webp
"""

import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import torch
from PIL import Image

import diff3ds as ds

GALLERY = Path(__file__).parents[1] / "docs/gallery"
# Straight RGB, and from where.
SHOWN = {
    "teapot": ((0.15, 0.35, 0.75), 40), "dragon": ((0.2, 0.55, 0.25), 60), "castle": ((0.55, 0.35, 0.2), 40),
    "sailing_boat": ((0.1, 0.45, 0.55), 60), "helicopter": ((0.8, 0.45, 0.1), 55), "elephant": ((0.4, 0.4, 0.48), 60),
    "crown": ((0.85, 0.62, 0.1), 40), "bicycle": ((0.75, 0.15, 0.2), 65),
}  # fmt: skip
# World units: members fill the unit ball. Pixels of a picture, columns.
WIDTH, SIZE, COLUMNS = 0.045, 360, 4


def main(file: Path) -> None:
    """Draws them."""
    page = Image.new("RGB", (COLUMNS * SIZE, -(-len(SHOWN) // COLUMNS) * SIZE))
    with tempfile.TemporaryDirectory() as folder:
        for i, (name, (color, azimuth)) in enumerate(SHOWN.items()):
            sketch = ds.load(GALLERY / f"{name}.json")
            thick = torch.full_like(sketch.opacity, WIDTH)
            tubes = replace(sketch, width=thick, width_space="world", color=torch.tensor(color).expand(len(sketch), 3))
            source, picture = Path(folder) / f"{name}.json", Path(folder) / f"{name}.png"
            ds.save(source, tubes)
            view = ["--size", str(SIZE), "--azimuth", str(azimuth), "--engine", "blender", "--quiet"]
            command = [sys.executable, "-m", "diff3ds.cli", "render", str(source), "-o", str(picture)]
            subprocess.run([*command, *view], check=True)
            with Image.open(picture) as drawn:
                page.paste(drawn.convert("RGB"), (i % COLUMNS * SIZE, i // COLUMNS * SIZE))
    page.save(file, quality=85)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
