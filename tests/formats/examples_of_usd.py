"""USD files with one feature each, for the tables of docs/reference/formats-read.md."""

from pathlib import Path

import pytest
from read_curves import reaches
from read_example import Example

HEAD = '#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n'
# A line of 1 along x, as the inside of a prim.
LINE = """
    int[] curveVertexCounts = [2]
    int[] order = [2]
    double[] knots = [0, 0, 1, 1]
    point3f[] points = [(0, 0, 0), (1, 0, 0)]
"""
FAR = LINE.replace("(1, 0, 0)", "(9, 0, 0)")


def curves(inside: str = LINE, kind: str = "NurbsCurves", name: str = "a") -> str:
    return f'def {kind} "{name}"\n{{{inside}}}\n'


def usd(body: str, head: str = HEAD, **beside: str):
    """A file with this body, and others of its folder by their names."""

    def make(folder: Path) -> Path:
        pytest.importorskip("pxr")
        for name, content in beside.items():
            (folder / f"{name}.usda").write_text(content)
        (folder / "a.usda").write_text(head + body)
        return folder / "a.usda"

    return make


def usdz(folder: Path) -> Path:
    pytest.importorskip("pxr")
    from pxr import Sdf, UsdUtils

    (folder / "in.usda").write_text(HEAD + 'def "b" (references = @other.usda@</a>) {}\n')
    (folder / "other.usda").write_text(HEAD + curves())
    assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(folder / "in.usda")), str(folder / "a.usdz"))
    for name in ("in", "other"):
        (folder / f"{name}.usda").unlink()
    return folder / "a.usdz"


def basis(points: str, kind: str, wrap: str = "nonperiodic", counts: str = "[4]", of: str = "cubic") -> str:
    return curves(
        f'''
    uniform token type = "{of}"
    uniform token basis = "{kind}"
    uniform token wrap = "{wrap}"
    int[] curveVertexCounts = {counts}
    point3f[] points = {points}
''',
        "BasisCurves",
    )


ZIGZAG = "[(0, 0, 0), (6, 6, 0), (12, 0, 0), (18, 6, 0)]"
SQUARE = "[(0, 0, 0), (6, 0, 0), (6, 6, 0), (0, 6, 0)]"
UNIT_LINE = reaches([0, 0, 0], [1, 0, 0], 1)
INSTANCES = f"""
class Xform "proto" {{ {curves()} }}
def Xform "x" (
    instanceable = true
    inherits = </proto>
) {{}}
def Xform "y" (
    instanceable = true
    inherits = </proto>
) {{
    double3 xformOp:translate = (5, 2, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
INSTANCER = f"""
def PointInstancer "many" {{
    rel prototypes = [</many/line>]
    int[] protoIndices = [0, 0]
    point3f[] positions = [(0, 0, 1), (4, 0, 3)]
    def Xform "line" {{
        double3 xformOp:translate = (0, 7, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        {curves()}
    }}
}}
"""
VARIANTS = f"""
def Xform "v" (
    variants = {{ string size = "small" }}
    prepend variantSets = "size"
) {{
    variantSet "size" = {{
        "small" {{ {curves()} }}
        "large" {{ {curves(FAR)} }}
    }}
}}
"""
COLORS = """
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 0, 1)] (interpolation = "vertex")
"""
MOVES = LINE.replace("point3f[] points = [", "point3f[] points.timeSamples = { 3: [").replace(
    "(1, 0, 0)]", "(1, 0, 0)], 4: [(0, 0, 0), (9, 0, 0)] }"
)
OTHERS = 'def Sphere "s" {}\ndef Mesh "m" {}\ndef Points "p" {}\n'
HIDDEN = 'def Xform "h" { token visibility = "invisible"\n' + curves(FAR) + "}\n"


def purpose(name: str) -> str:
    return curves() + curves(FAR + f'    uniform token purpose = "{name}"\n', name="b")


USD = {
    "NurbsCurves, rational, with ranges": Example(
        usd(curves(LINE + "    double2[] ranges = [(0.25, 0.5)]\n")), reaches([0.25, 0, 0], [0.5, 0, 0], 1)
    ),
    "BasisCurves: linear": Example(
        usd(basis(SQUARE, "bezier", "periodic", of="linear")), reaches([0, 0, 0], [6, 6, 0])
    ),
    "BasisCurves: Bézier": Example(
        usd(basis("[(0, 0, 0), (0, 4, 0), (4, 4, 0), (4, 0, 0)]", "bezier")), reaches([0, 0, 0], [4, 3, 0], 1)
    ),
    "BasisCurves: B-spline": Example(usd(basis(ZIGZAG, "bspline")), reaches([6, 2, 0], [12, 4, 0], 1)),
    "BasisCurves: Catmull-Rom": Example(usd(basis(ZIGZAG, "catmullRom")), reaches([6, 0, 0], [12, 6, 0], 1)),
    "BasisCurves: pinned": Example(usd(basis(ZIGZAG, "catmullRom", "pinned")), reaches([0, 0, 0], [18, 6, 0], 1)),
    "BasisCurves: periodic": Example(
        usd(basis(SQUARE, "bspline", "periodic")), reaches([0.25, 0.25, 0], [5.75, 5.75, 0], 1)
    ),
    "BasisCurves with a wrong number of points": Example(
        usd(basis("[(0, 0, 0), (1, 0, 0), (9, 9, 9)]", "bezier", counts="[3]") + curves(name="b")),
        UNIT_LINE,
        "1 broken BasisCurves",
    ),
    "curves of a degree above 3": Example(
        usd(
            curves(
                LINE.replace("[2]\n    double", "[5]\n    double")
                .replace("Counts = [2]", "Counts = [5]")
                .replace("[0, 0, 1, 1]", "[0, 0, 0, 0, 0, 1, 1, 1, 1, 1]")
                .replace("[(0, 0, 0), (1, 0, 0)]", "[(0, 0, 0), (1, 0, 0), (2, 1, 0), (3, 0, 0), (4, 0, 0)]")
            )
        ),
        words="of degree 4",
    ),
    "instances": Example(usd(INSTANCES), reaches([0, 0, 0], [6, 2, 0], 2)),
    "point instancers": Example(usd(INSTANCER), reaches([0, 7, 1], [5, 7, 3], 2)),
    "variants: those that are selected": Example(usd(VARIANTS), UNIT_LINE),
    "colours, the mean one along a curve": Example(
        usd(curves(LINE + COLORS)), reaches([0, 0, 0], [1, 0, 0], 1, [0.5, 0, 0.5])
    ),
    "y up, which is meant where a file does not say": Example(
        usd(curves(LINE.replace("(1, 0, 0)", "(1, 2, 3)")), HEAD.replace('    upAxis = "Z"\n', "")),
        reaches([0, -3, 0], [1, 0, 2], 1),
    ),
    "no unit: centimetres are assumed": Example(
        usd(curves(), HEAD.replace("    metersPerUnit = 1\n", "")),
        reaches([0, 0, 0], [0.01, 0, 0], 1),
        "no unit of length",
    ),
    "what is invisible": Example(usd(curves() + HIDDEN), UNIT_LINE, "1 invisible"),
    "purpose render, beside proxies": Example(
        usd(purpose("proxy") + curves(FAR + '    uniform token purpose = "render"\n', name="c")),
        reaches([0, 0, 0], [9, 0, 0], 2),
    ),
    "purpose proxy, where nothing is rendered": Example(usd(purpose("proxy")), UNIT_LINE, "1 proxies"),
    "purpose guide": Example(usd(purpose("guide")), UNIT_LINE, "1 guides"),
    "what moves: the first frame": Example(usd(curves(MOVES)), UNIT_LINE, "1 curves move"),
    "meshes, points, solids": Example(usd(curves() + OTHERS), UNIT_LINE, "1 Mesh, 1 Points, 1 Sphere"),
    "prims that are not active, classes, overs": Example(
        usd(curves() + 'def Xform "n" (active = false) {\n' + curves(FAR) + "}\n"), UNIT_LINE
    ),
    "files of its folder that it refers to": Example(
        usd('def "b" (references = @./other.usda@</a>) {}\n', other=HEAD + curves()), UNIT_LINE
    ),
    "references to files that are missing or elsewhere": Example(
        usd(curves() + 'def Xform "b" (references = @../other.usda@</a>) {}\n'), words="refers to others"
    ),
    "packages": Example(usdz, UNIT_LINE),
}
