"""Icons of things and signs that are none of the library's kinds, as pictures of nothing that is known.

They are read from a folder of SVG files drawn in lines, such as icons/outline of Tabler Icons (MIT licence; `npm pack
@tabler/icons`). Those whose names have a word of `LIKE_KINDS` are left out.
"""

import io
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from diff3ds.library import CATEGORIES
from diff3ds.recognition.network import SIZE, THING

# Pixels of an icon when it is read; width of its lines of 24 units.
FINE, WIDTH = 160, "0.9"
# Besides the names of the kinds: what people might draw for one, or like one.
LIKE_KINDS = {
    "alarm", "ambulance", "archery", "armchair", "axe", "baguette", "balloon", "beach", "beer", "bike", "boat",
    "book", "bookmark", "bookmarks", "books", "building", "bulb", "calendar", "camper", "candle", "caravan", "castle",
    "christmas", "clock", "clouds", "coffee", "couch", "cup", "cut", "dart", "desk", "device", "disabled", "eyeglass",
    "firetruck", "fishing", "forklift", "friends", "gauge", "gavel", "glass", "glasses", "grave", "growth", "history",
    "home", "hourglass", "house", "key", "knife", "ladder", "lamp", "lamps", "lego", "library", "lock", "mailbox",
    "motorbike", "mug", "parking", "pick", "plane", "plant", "plants", "pot", "rack", "ripple", "rv", "sailboat",
    "scooter", "servicemark", "shelf", "ship", "speedboat", "stack", "steam", "stopwatch", "submarine", "sunglasses",
    "sword", "swords", "table", "tank", "tea", "temperature", "tent", "time", "tool", "tools", "tower", "tractor",
    "train", "tram", "tree", "trees", "truck", "umbrella", "van", "watch", "wheelchair", "wine", "zeppelin",
}  # fmt: skip


def read_icons(folder: Path, kinds: Sequence[str]) -> dict[str, list[np.ndarray]]:
    """Pictures (160, 160) of ink, uint8, in three parts: "train", "validation" and "test".

    Args:
        kinds: of the library that none of them shows, by its name.

    Raises:
        ValueError: there are none.
    """
    from resvg_py import svg_to_bytes

    words = {word for name in kinds for noun in (name, *CATEGORIES[name].synonyms) for word in noun.split()}
    icons = []
    for path in sorted(folder.glob("*.svg")):
        named = {*path.stem.split("-")}
        if named & (words | LIKE_KINDS) or "off" in named:
            continue
        text = path.read_text(encoding="utf-8").replace('stroke-width="2"', f'stroke-width="{WIDTH}"')
        image = Image.open(io.BytesIO(bytes(svg_to_bytes(svg_string=text, width=FINE, height=FINE))))
        icons.append(np.asarray(image.getchannel("A"), np.uint8))
    if not icons:
        raise ValueError(f"{folder} has no icons: give a folder of SVG files in lines")
    # Names are sorted: those beside each other have the same beginning, and are shared out.
    test, validation = icons[::8], icons[1::8]
    return {"test": test, "validation": validation, "train": [icon for i, icon in enumerate(icons) if i % 8 > 1]}


def icon_picture(icon: np.ndarray, chance: np.random.Generator) -> np.ndarray:
    """A picture (S, S) of ink in [0, 1] as the network sees it: turned, stretched and mirrored by chance."""
    a, (wide, high) = chance.normal(0, 0.13), np.exp(chance.normal(0, 0.2, 2))
    turn = np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])
    matrix = turn @ np.diag([wide * chance.choice([-1, 1]), high]) @ np.array([[1, chance.normal(0, 0.13)], [0, 1]])
    matrix = matrix * 1.5
    offset = FINE / 2 - matrix @ (FINE / 2, FINE / 2)
    image = Image.fromarray(icon)
    flat = (matrix[0, 0], matrix[0, 1], offset[0], matrix[1, 0], matrix[1, 1], offset[1])
    image = image.transform(image.size, Image.Transform.AFFINE, flat, Image.Resampling.BILINEAR)
    box = image.point(lambda value: 255 * (value > 60)).getbbox()
    if box is None:
        return np.zeros((SIZE, SIZE), np.float32)
    image = image.crop(box)
    scale = SIZE * THING / max(image.size)
    wide, high = (max(1, round(side * scale)) for side in image.size)
    image = image.resize((wide, high), Image.Resampling.BOX)
    square = Image.new("L", (SIZE, SIZE))
    square.paste(image, ((SIZE - wide) // 2, (SIZE - high) // 2))
    return np.clip(np.asarray(square, np.float32) / 255 * chance.uniform(1.0, 2.0), 0, 1)
