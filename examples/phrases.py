"""Eight phrases and what the built-in prior makes of them, in one picture; some minutes.

python examples/phrases.py [OUTPUT_FOLDER]
"""

import sys
from pathlib import Path

import torch

import diff3ds as ds
from diff3ds.formats import save_png, tile_images

PHRASES = {
    "a chair with armrests": 35,
    "a bicycle": 60,
    "a sailing boat": 60,
    "a teapot": 20,
    "a lighthouse with light beams": 60,
    "two red wine glasses": 20,
    "a house with a chimney": 35,
    "a blue umbrella": 35,
}
SIZE = 240


def main(folder: Path) -> None:
    """Writes phrases.png."""
    images = []
    for phrase, azimuth in PHRASES.items():
        sketch = ds.text_to_sketch(phrase, prior="exemplar")
        images.append(ds.render(sketch, ds.orbit(azimuth, 18, 2.0, fov=56, size=SIZE)).color[0])
    save_png(folder / "phrases.png", tile_images(torch.stack(images), columns=4))


if __name__ == "__main__":
    main(Path(*sys.argv[1:2]))
