"""Mesh files with one feature each, for the tables of docs/reference/formats-read.md."""

import struct
import warnings
from pathlib import Path

import examples_of_gltf
import numpy as np
from examples_of_gltf import color
from PIL import Image
from read_example import Example

from diff3ds.formats.mesh import MeshFile, read_mesh


def read(path: Path) -> MeshFile:
    """With colours; what of these is missing is said as `diff3ds mesh` says it."""
    found = read_mesh(path, colors=True)
    assert found.colors is not None
    if found.colors.missing:
        warnings.warn(f"{', '.join(found.colors.missing)} cannot be read from the folder of {path.name}", stacklevel=1)
    return found


def text(name: str, content: str | bytes, **beside: str | bytes):
    """Writes a text, and others beside it, whose names end at a double underscore: a__mtl is a.mtl."""

    def make(folder: Path) -> Path:
        for file, words in {name: content, **{k.replace("__", "."): v for k, v in beside.items()}}.items():
            (folder / file).write_bytes(words if isinstance(words, bytes) else words.encode())
        return folder / name

    return make


def area(found: MeshFile) -> float:
    """Of faces in a plane; those that are wound the other way count less than nothing."""
    a, b, c = found.vertices[found.faces].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a).sum(0)) / 2)


def covers(size: float):
    return lambda found: np.isclose(area(found), size)


# A square of 2 x 2; the corners of a U of the area 7, in order around it.
SQUARE = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]
U = [(0, 0, 0), (3, 0, 0), (3, 3, 0), (2, 3, 0), (2, 1, 0), (1, 1, 0), (1, 3, 0), (0, 3, 0)]


def rows(points, more: str = "") -> str:
    return "".join(f"{x} {y} {z}{more}\n" for x, y, z in points)


def obj(faces: str, points=SQUARE, more: str = "") -> str:
    return "".join(f"v {line}\n" for line in rows(points, more).splitlines()) + faces


def picture(*pixels) -> bytes:
    import io

    content = io.BytesIO()
    Image.fromarray(np.array([pixels], np.uint8)).save(content, "PNG")
    return content.getvalue()


RED, GREEN = (255, 0, 0), (0, 255, 0)
UV = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
TEXTURED = "mtllib a.mtl\n" + obj(UV + "usemtl m\nf 1/1 2/2 3/3 4/4\n")


def mtl(line: str, **beside: bytes):
    """The square with a material; its second triangle is at the left."""
    return text("a.obj", TEXTURED, a__mtl=f"newmtl m\n{line}\n", **beside)


OBJ = {
    "faces of any number of corners": Example(text("a.obj", obj("f 1 2 3 4 5 6 7 8\n", U)), covers(7)),
    "indices that count backwards": Example(text("a.obj", obj("f -4 -3 -2 -1\n")), covers(4)),
    "`v/vt/vn`, `v//vn` and `v/vt`, mixed too": Example(
        text("a.obj", obj("vt 0 0\nvn 0 0 1\nf 1/1/1 2//1 3/1\nf 1//1 3//1 4//1\n")), covers(4)
    ),
    "lines that go on after a backslash": Example(text("a.obj", obj("f 1 2 \\\n3 4\n")), covers(4)),
    "a byte order mark, UTF-16, CR and CRLF": Example(
        text("a.obj", obj("f 1 2 3 4\n").replace("\n", "\r\n").encode("utf-16")), covers(4)
    ),
    "groups and objects": Example(
        text("a.obj", obj("o one\nf 1 2 3\ng two\nf 1 3 4\n")), lambda f: len(set(f.part.tolist())) == 2
    ),
    "colours behind vertices": Example(
        text("a.obj", obj("f 1 2 3 4\n", more=" 1 0 .5")), lambda f: color(f) == [1, 0, 0.5]
    ),
    "colours of materials (`Kd`)": Example(mtl("Kd 1 0 .5"), lambda f: color(f) == [1, 0, 0.5]),
    "textures (`map_Kd`), names of other systems and with spaces": Example(
        mtl("map_Kd -bm 1 C:\\old\\A PICTURE.PNG", **{"a picture__png": picture(RED, GREEN)}),
        lambda f: color(f) == [0, 1, 0] and color(f, 1) == [1, 0, 0],
    ),
    "textures scaled, moved and clamped (`-s`, `-o`, `-clamp`)": Example(
        mtl("map_Kd -clamp on -s 1 1 1 -o 1 0 a.png", a__png=picture(RED, GREEN)), lambda f: color(f, 1) == [0, 1, 0]
    ),
    "several materials files in one line": Example(
        text("a.obj", TEXTURED.replace("a.mtl", "b.mtl c.mtl"), b__mtl="newmtl x\n", c__mtl="newmtl m\nKd 0 1 0\n"),
        lambda f: color(f) == [0, 1, 0],
    ),
    "normals, smoothing groups, other maps": Example(
        text("a.obj", obj("vn 0 0 1\ns 1\nmg 1 2\nf 1//1 2//1 3//1 4//1\n")), covers(4)
    ),
    "lines and points": Example(text("a.obj", obj("l 1 2 3\np 1\nf 1 2 3 4\n")), covers(4), "2 lines and points"),
    "weights of vertices": Example(text("a.obj", obj("f 1 2 3 4\n", more=" 2")), covers(4), "weights of vertices"),
    "materials and textures that are not there": Example(text("a.obj", TEXTURED), covers(4), "a.mtl cannot be read"),
    "free-form curves and surfaces": Example(text("a.obj", obj("f 1 2 3\ncurv 0 1 1 2\n")), words="free-form"),
    "commands and other files (`csh`, `call`)": Example(text("a.obj", obj("f 1 2 3\ncsh rm\n")), words="(csh)"),
    "decimal commas": Example(text("a.obj", obj("f 1 2 3\n").replace("2 0 0", "2,5 0 0")), words="commas"),
}

FACET = "facet normal 0 0 1\nouter loop\n{}endloop\nendfacet\n"


def solid(*facets, name="s") -> str:
    loops = ("".join(f"vertex {x:e} {y} {z}\n" for x, y, z in facet) for facet in facets)
    return f"solid {name}\n" + "".join(FACET.format(loop) for loop in loops) + f"endsolid {name}\n"


HALVES = (SQUARE[:3], [SQUARE[0], *SQUARE[2:]])


def binary(*facets, header=b"solid by some program", count=None, attribute=0, tail=b"") -> bytes:
    body = b"".join(struct.pack("<12fH", 0, 0, 1, *np.ravel(facet), attribute) for facet in facets)
    return header.ljust(80, b"\0") + struct.pack("<I", len(facets) if count is None else count) + body + tail


NAN = [(0, 0, 0), (float("nan"), 0, 0), (0, 1, 0)]
STL = {
    "text, several solids": Example(
        text("a.stl", solid(HALVES[0]) + solid(HALVES[1], name="facet")),
        lambda f: area(f) == 4 and set(f.part) == {0, 1},
    ),
    "text with loops of more than three vertices": Example(text("a.stl", solid(U)), covers(7)),
    "binary, also with a header that begins with solid": Example(text("a.stl", binary(*HALVES)), covers(4)),
    "colours of VisCAM and SolidView": Example(
        text("a.stl", binary(*HALVES, attribute=0x8000 | 31 << 10)), lambda f: color(f) == [1, 0, 0]
    ),
    "colours of Magics": Example(
        text("a.stl", binary(*HALVES, header=b"COLOR=\x00\xff\x00\xff", attribute=0x8000)),
        lambda f: color(f) == [0, 1, 0],
    ),
    "normals": Example(text("a.stl", solid(*HALVES).replace("0 0 1\n", "9 9 9\n")), covers(4)),
    "a count that is not that of the facets": Example(
        text("a.stl", binary(*HALVES, count=0)), covers(4), "its count, 0"
    ),
    "bytes behind the last facet": Example(text("a.stl", binary(*HALVES, tail=b"x" * 7)), covers(4), "7 bytes behind"),
    "facets with coordinates that are no numbers": Example(
        text("a.stl", binary(*HALVES, NAN)), covers(4), "1 face with coordinates that are no numbers"
    ),
    "files that are cut off": Example(text("a.stl", binary(*HALVES)[:-9]), words="it is cut off"),
}


def ply(points=SQUARE, faces="4 0 1 2 3\n", vertex="", face="", comment="", kind="ascii", name="vertex_indices") -> str:
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    count = len(faces.splitlines())
    head = f"ply\nformat {kind} 1.0\n{comment}element vertex {len(points)}\n{axes}{vertex}"
    return head + f"element face {count}\nproperty list uchar int {name}\n{face}end_header\n"


def ply_text(points=SQUARE, faces="4 0 1 2 3\n", more="", **head) -> str:
    return ply(points, faces, **head) + rows(points, more) + faces


def ply_binary(order: str, kind: str) -> bytes:
    body = b"".join(struct.pack(order + "fff", *point) for point in U)
    body += struct.pack(order + "B8iB3i", 8, *range(8), 3, 0, 1, 2)
    return ply(U, "\n\n", kind=kind).encode() + body


RGB = "property {0} red\nproperty {0} green\nproperty {0} blue\n"
STRIPS = ply(faces="").replace("face 0", "tristrips 1") + rows(SQUARE) + "9 0 1 3 2 -1 0 1 3 2\n"
PLY = {
    "text, little and big endian, faces of different sizes": Example(
        text("a.ply", ply_binary(">", "binary_big_endian")), covers(7 + 4.5)
    ),
    "lists called `vertex_index`": Example(text("a.ply", ply_text(name="vertex_index")), covers(4)),
    "strips (`tristrips`)": Example(text("a.ply", STRIPS), covers(8)),
    "colours of vertices, whole numbers and shares": Example(
        text("a.ply", ply_text(vertex=RGB.format("ushort"), more=" 65535 0 0")), lambda f: color(f) == [1, 0, 0]
    ),
    "colours of faces": Example(
        text("a.ply", ply_text(face=RGB.format("float"), faces="4 0 1 2 3 0 .5 1\n")), lambda f: color(f) == [0, 0.5, 1]
    ),
    "textures (`TextureFile`), by vertices or faces": Example(
        text(
            "a.ply",
            ply_text(
                comment="comment TextureFile A.PNG\n",
                face="property list uchar float texcoord\n",
                faces="4 0 1 2 3 8 0 0 1 0 1 1 0 1\n",
            ),
            a__png=picture(RED, GREEN),
        ),
        lambda f: color(f) == [0, 1, 0] and color(f, 1) == [1, 0, 0],
    ),
    "normals, other properties and elements": Example(
        text(
            "a.ply",
            ply_text(vertex="property double quality\n", more=" 7").replace(
                "end_header", "element edge 1\nproperty int vertex1\nend_header"
            )
            + "0\n",
        ),
        covers(4),
    ),
    "textures that are not there": Example(
        text("a.ply", ply_text(comment="comment TextureFile b.png\n")), covers(4), "b.png cannot be read"
    ),
    "faces of fewer than three corners": Example(
        text("a.ply", ply_text(faces="4 0 1 2 3\n2 0 1\n")), covers(4), "1 face of fewer than three corners"
    ),
    "clouds of points": Example(
        text("a.ply", ply(faces="") + rows(SQUARE)),
        words="a cloud of 4 points without faces is no mesh: diff3ds points finds its edges",
    ),
    "range images": Example(
        text("a.ply", ply(faces="").replace("element face 0", "element range_grid 1") + rows(SQUARE) + "1 0\n"),
        words="a range image",
    ),
    "files that are cut off": Example(
        text("a.ply", ply_binary("<", "binary_little_endian")[:-5]), words="it is cut off"
    ),
}


def off(points=SQUARE, faces="4 0 1 2 3\n", head="OFF\n", more="") -> str:
    return f"{head}{len(points)} {len(faces.splitlines())} 0\n{rows(points, more)}{faces}"


OFF = {
    "faces of any number of corners, mixed": Example(
        text("a.off", off(U, "8 0 1 2 3 4 5 6 7\n3 0 1 2\n")), covers(7 + 4.5)
    ),
    "comments, blank lines, counts behind the header, or no header": Example(
        text("a.off", "# one\n\n" + off(head="OFF") + "\n# two\n"), covers(4)
    ),
    "COFF: colours of vertices": Example(
        text("a.off", off(head="COFF\n", more=" 255 0 0 255")), lambda f: color(f) == [1, 0, 0]
    ),
    "colours of faces": Example(text("a.off", off(faces="4 0 1 2 3  0 .5 1\n")), lambda f: color(f) == [0, 0.5, 1]),
    "4OFF: homogeneous coordinates": Example(text("a.off", off(head="4OFF\n", more=" 2")), covers(1)),
    "NOFF and STOFF: normals and texture coordinates": Example(
        text("a.off", off(head="STNOFF\n", more=" 0 0 1 .5 .5")), covers(4)
    ),
    "nOFF of other than three dimensions": Example(
        text("a.off", "nOFF\n4\n1 1 0\n0 0 0 0\n1 0\n"), words="three dimensions"
    ),
    "binary OFF": Example(text("a.off", b"OFF BINARY\n\0\0\0\4"), words="a binary OFF file"),
    "files that are cut off": Example(text("a.off", off()[:-12]), words="it is cut off"),
}

EXAMPLES = {
    "glTF 2.0: `.glb`, `.gltf`": examples_of_gltf.EXAMPLES,
    "Wavefront OBJ: `.obj`": OBJ,
    "STL: `.stl`": STL,
    "PLY: `.ply`": PLY,
    "OFF: `.off`": OFF,
}
