"""The base colours of glTF's materials: factors, vertices and textures, with their transforms and samplers."""

from typing import Any

import numpy as np

from diff3ds._shapes import Array, Float, Index, Int
from diff3ds.formats.mesh_colors import NO_TEXTURE, Pictures, Wrap
from diff3ds.formats.mesh_files.gltf_file import GltfFile
from diff3ds.formats.mesh_files.polygons import Paint

_WRAPS: dict[int, Wrap] = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_GLOSSY, _MOVED = "KHR_materials_pbrSpecularGlossiness", "KHR_texture_transform"


class GltfMaterials:
    """Colours of primitives.

    Attributes:
        left_out: what changes how things look and is not read.
    """

    def __init__(self, file: GltfFile) -> None:
        """Decodes nothing yet."""
        self._file, self._pictures = file, Pictures()
        self._missing: dict[str, None] = {}
        self._seen_through: dict[str, None] = {}

    @property
    def left_out(self) -> tuple[str, ...]:
        """Materials that are drawn as if nothing was seen through them, in one line."""
        names = list(self._seen_through)
        shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        return (f"left out: transparency of the material {shown}: what has it is drawn whole",) if names else ()

    def paint(self, primitive: dict[str, Any], faces: Int[Index, "F 3"], vertices: int) -> Paint:
        """The colours of a primitive's triangles.

        Raises:
            ValueError: a broken texture, or colours of other vertices than there are.
        """
        paint = Paint.none(3 * len(faces), len(faces))
        attributes = primitive["attributes"]
        corners = faces.ravel()
        if "COLOR_0" in attributes:
            paint.color[:] = self._colors(attributes["COLOR_0"], vertices)[corners]
        if "material" not in primitive:
            return paint
        material = self._file.one("materials", primitive["material"])
        name = repr(material.get("name", primitive["material"]))[:80]
        if material.get("alphaMode", "OPAQUE") != "OPAQUE":
            self._seen_through[name] = None
        glossy = material.get("extensions", {}).get(_GLOSSY)
        own = material.get("pbrMetallicRoughness", {}) if glossy is None else glossy
        factor = np.array(own.get("baseColorFactor" if glossy is None else "diffuseFactor", [1, 1, 1, 1]), np.float64)
        if factor.shape != (4,):
            raise ValueError(f"the colour of material {name} is not of four numbers")
        paint.color[:] = np.where(np.isfinite(paint.color), paint.color, 1.0) * np.clip(np.nan_to_num(factor[:3]), 0, 1)
        info = own.get("baseColorTexture" if glossy is None else "diffuseTexture")
        if info is None:
            return paint
        moved = info.get("extensions", {}).get(_MOVED, {})
        number = self._texture(info.get("index"))
        uv = attributes.get(f"TEXCOORD_{moved.get('texCoord', info.get('texCoord', 0))}")
        if number == NO_TEXTURE or uv is None:
            self._missing[f"the texture of material {name}"] = None
            return paint
        places = self._file.values(uv, 2)
        if len(places) != vertices:
            raise ValueError(f"{len(places)} texture coordinates are of {vertices} vertices")
        places = _transformed(places, moved) * [1, -1] + [0, 1]
        paint.uv[:] = places[corners]
        paint.texture[:] = number
        return paint

    def joined(self, paints: list[Paint]) -> Paint:
        """All colours, one after the other."""
        color, uv, texture = (
            np.concatenate([getattr(paint, name) for paint in paints]) for name in ("color", "uv", "texture")
        )
        return Paint(color, uv, texture, tuple(self._pictures.textures), True, tuple(self._missing))

    def _colors(self, number: Any, vertices: int) -> Float[Array, "V 3"]:
        """Linear light, RGB or RGBA."""
        found = self._file.accessor(number)
        if found.ndim != 2 or found.shape[1] not in (3, 4) or len(found) != vertices:
            raise ValueError(f"colours of vertices must be RGB or RGBA, {vertices} of them")
        if found.dtype.kind != "f":
            # Whole numbers are shares, also where the file forgets to say so.
            found = found / np.iinfo(found.dtype).max
        return np.clip(np.nan_to_num(found[:, :3].astype(np.float64)), 0, 1)

    def _texture(self, number: Any) -> int:
        """Which picture a texture is; WebP comes before its fallback, other kinds of pictures give way to theirs."""
        texture = self._file.one("textures", number)
        webp = texture.get("extensions", {}).get("EXT_texture_webp", {})
        source = webp.get("source", texture.get("source"))
        if source is None:
            return NO_TEXTURE
        sampler = self._file.one("samplers", texture["sampler"]) if "sampler" in texture else {}
        wrap = (_WRAPS.get(sampler.get(name, 10497), "repeat") for name in ("wrapS", "wrapT"))
        image = self._file.one("images", source)
        try:
            content = (
                self._file.view(image["bufferView"])[0]
                if "bufferView" in image
                else self._file.resource(image.get("uri"))
            )
        except ValueError as error:
            self._missing[f"a texture: {error}"] = None
            return NO_TEXTURE
        along, across = wrap
        return self._pictures.number(source, content, (along, across))


def _transformed(uv: Float[Array, "V 2"], moved: dict[str, Any]) -> Float[Array, "V 2"]:
    """Texture coordinates of glTF, scaled, turned clockwise in the picture, and moved."""
    scale, offset = (np.array(moved.get(k, v), np.float64) for k, v in (("scale", [1, 1]), ("offset", [0, 0])))
    turn = float(moved.get("rotation", 0.0))
    if scale.shape != (2,) or offset.shape != (2,):
        raise ValueError("a texture is moved by other than two numbers")
    c, s = np.cos(turn), np.sin(turn)
    return np.asarray((uv * scale) @ np.array([[c, -s], [s, c]]) + offset)
