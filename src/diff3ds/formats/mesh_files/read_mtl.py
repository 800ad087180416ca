"""Materials of Wavefront OBJ files: the diffuse colour and its texture."""

from dataclasses import dataclass

import numpy as np

from diff3ds.formats.mesh_colors import Wrap
from diff3ds.formats.mesh_files.text_numbers import numbers

# Options before the name of a texture, and how many words follow on each.
_OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-bm": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-mm": 2, "-texres": 1,
    "-type": 1, "-o": 3, "-s": 3, "-t": 3,
}  # fmt: skip
_VECTORS = ("-o", "-s", "-t")


@dataclass
class Material:
    """A material.

    Attributes:
        color: diffuse, sRGB as programs take it; None where it has none.
        picture: the name of its texture.
        moved: by which texture coordinates are multiplied, along u and v, and what is added then.
        wrap: what the texture does beyond its borders.
    """

    color: tuple[float, float, float] | None = None
    picture: str | None = None
    moved: tuple[float, float, float, float] = (1.0, 1.0, 0.0, 0.0)
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")


def read_mtl(content: bytes) -> dict[str, Material]:
    """The materials of a file by name; what is no colour is passed over.

    Raises:
        ValueError: colours or places of textures that are no numbers.
    """
    found: dict[str, Material] = {}
    material = Material()
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
        word, _, rest = line.strip().replace("\t", " ").partition(" ")
        word, rest = word.lower(), rest.strip()
        if word == "newmtl":
            material = found.setdefault(rest, Material())
        elif word == "kd" and not rest.startswith(("spectral", "xyz")):
            values = np.clip(np.nan_to_num(numbers(rest.split("#")[0].encode())), 0, 1)
            if len(values):
                # One number is of all three channels.
                red, green, blue = (float(values[min(k, len(values) - 1)]) for k in range(3))
                material.color = red, green, blue
        elif word == "map_kd":
            _read_map(material, rest)
    return found


def _read_map(material: Material, rest: str) -> None:
    """The name of a texture, which may have spaces, and the options before it."""
    scale, offset = [1.0, 1.0], [0.0, 0.0]
    while (words := rest.split(None, 1)) and words[0].lower() in _OPTIONS and len(words) > 1:
        option, rest = words[0].lower(), words[1]
        values = []
        for _ in range(_OPTIONS[option]):
            value, *more = rest.split(None, 1)
            # Vectors may be shorter.
            if not more or (option in _VECTORS and not _is_number(value)):
                break
            values.append(value)
            rest = more[0]
        if option in ("-o", "-s"):
            chosen = offset if option == "-o" else scale
            chosen[: min(2, len(values))] = [float(value) for value in values[:2]]
        elif option == "-clamp" and values == ["on"]:
            material.wrap = ("clamp", "clamp")
    material.moved = (scale[0], scale[1], offset[0], offset[1])
    material.picture = rest or None


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
