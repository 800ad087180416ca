"""`diff3ds mesh --color`: boxes and sheets whose colours are known, in every format, and files not to be trusted."""

import io
import re
import struct

import numpy as np
import pytest
import torch
from needs import needs
from PIL import Image

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.surfaces.shape.colors import colored
from diff3ds.surfaces.shape.load_surface import load_colored_surface
from diff3ds.tasks.mesh.source import Source

pytestmark = needs("trimesh")

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) * [3, 2, 1]
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
# Of the sides x = 0, x = 3, y = 0, y = 2, z = 0, z = 1.
COLORS = [(0, 0, 255), (255, 0, 0), (0, 80, 0), (0, 255, 0), (255, 255, 0), (255, 255, 255)]
PLY = (
    "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n{}"
    "element face {}\nproperty list uchar int vertex_indices\n{}end_header\n"
)
RGB = "property uchar red\nproperty uchar green\nproperty uchar blue\n"


def write_box(path, quadrangles=True):
    """Sides of six colours, of which some are wound inwards."""
    lines = [PLY.format(8, "", 6 if quadrangles else 12, RGB)]
    lines += [f"{x} {y} {z}\n" for x, y, z in CORNERS]
    for side, color in zip(SIDES, COLORS, strict=True):
        a, b, c, d = side
        for face in [side] if quadrangles else [(a, b, c), (c, a, d)]:
            lines.append(" ".join(map(str, (len(face), *face, *color))) + "\n")
    path.write_text("".join(lines))
    return path


def drawn(path, **options):
    return ds.mesh_to_sketch(path, color=True, turntable=0, size=32, **options)


@pytest.mark.parametrize("quadrangles", [True, False])
def test_a_crease_takes_the_darker_of_its_two_sides(tmp_path, quadrangles):
    sketch = drawn(write_box(tmp_path / "box.ply", quadrangles))
    assert len(sketch) == 12
    from_dark = [COLORS[i] for i in (2, 0, 1, 3, 4, 5)]
    for points, color in zip(sketch.points.double().numpy(), sketch.color, strict=True):
        low, high = points.min(0), points.max(0)
        sides = [2 * axis + (low[axis] > 0) for axis in range(3) if np.isclose(low[axis], high[axis])]
        assert len(sides) == 2
        # White strokes are darkened to .7, but every other side is darker than the white one.
        wanted = min((COLORS[side] for side in sides), key=from_dark.index)
        assert torch.allclose(color.float(), torch.tensor(wanted) / 255, atol=1e-6)


def write_sheet(path, picture, folder="", lines=""):
    """A square of 4 x 4 in the plane z = 0 with a texture that fills it; its border is four strokes."""
    path.write_text(
        "mtllib sheet.mtl\nv 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        "usemtl paper\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
    )
    (path.parent / "sheet.mtl").write_text(f"newmtl paper\n{lines}map_Kd {folder}a texture.png\n")
    if picture is not None:
        Image.fromarray(np.array(picture, np.uint8)).save(path.parent / "a texture.png")
    return path


def by_side(sketch):
    """The colours of the strokes of a square by the side that they lie on."""
    middles = sketch.points.double().mean(1)
    named = {(0, 2): "left", (4, 2): "right", (2, 0): "low", (2, 4): "high"}
    return {
        named[tuple(round(v) for v in middle[:2].tolist())]: [round(v, 3) for v in color]
        for middle, color in zip(middles, sketch.color.tolist(), strict=True)
    }


# Three rows of three: the left column red, the right one blue, the lowest row otherwise green.
RED, BLUE, GREEN, PINK = [255, 0, 0], [0, 0, 255], [0, 204, 0], [255, 204, 204]
TEXTURE = [[RED, PINK, BLUE], [RED, PINK, BLUE], [RED, GREEN, BLUE]]


def test_textures_are_upright_and_no_mixture_comes_up(tmp_path):
    """The upper border has a third of each colour, and pink is nearest to the others: it is darkened to .7."""
    picture = np.repeat(np.repeat(TEXTURE, 10, 0), 10, 1)
    sides = by_side(
        drawn(write_sheet(tmp_path / "sheet.obj", picture, "C:\\\\work\\\\", "Kd 0.1 0.1 0.1\n"), azimuth=(0,))
    )
    assert sides == {"left": [1, 0, 0], "right": [0, 0, 1], "low": sides["low"], "high": [0.875, 0.7, 0.7]}
    assert sides["low"] in ([1, 0, 0], [0, 0, 1], [0, 0.8, 0])


def glb(mesh):
    import trimesh

    return trimesh.Scene(mesh).export(file_type="glb")


def test_gltf_multiplies_in_linear_light(tmp_path):
    """Its y is our z; half of the light is .735 in sRGB, which textures are in."""
    import trimesh
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    square = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]]
    material = PBRMaterial(baseColorFactor=[0.5, 0.0, 0.25, 1.0])
    (tmp_path / "plain.glb").write_bytes(
        glb(trimesh.Trimesh(*square, visual=TextureVisuals(material=material), process=False))
    )
    sketch = drawn(tmp_path / "plain.glb")
    # trimesh writes factors in 256 steps.
    assert torch.allclose(sketch.color.float(), torch.tensor([0.735, 0.0, 0.537]), atol=3e-3)
    picture = Image.fromarray(np.full((2, 2, 3), 188, np.uint8))
    uv = [[0, 0], [1, 0], [1, 1], [0, 1]]
    material = PBRMaterial(baseColorFactor=[1.0, 0.0, 0.5, 1.0], baseColorTexture=picture)
    content = glb(trimesh.Trimesh(*square, visual=TextureVisuals(uv, material), process=False))
    (tmp_path / "textured.glb").write_bytes(content)
    # 188 of 255 is half of the light, and half of that .537.
    assert torch.allclose(drawn(tmp_path / "textured.glb").color.float(), torch.tensor([0.737, 0, 0.54]), atol=3e-3)
    start = content.index(b"\x89PNG")
    (tmp_path / "torn.glb").write_bytes(content[:start] + b"x" * 16 + content[start + 16 :])
    _, colors = load_colored_surface(tmp_path / "torn.glb")
    assert colors.missing == ("the texture of material 0",)


def test_vertices_have_colours_that_mix_and_strokes_far_away_have_the_nearest(tmp_path):
    path = tmp_path / "sheet.obj"
    corners = [(0, 0, "1 0 0"), (4, 0, "1 0 0"), (4, 4, "0 0 1"), (0, 4, "0 0 1")]
    lines = [f"v {x} {y} 0 {color}" for x, y, color in corners]
    path.write_text("\n".join([*lines, "vt 0 0", "f 1/1 2/1 3/1", "f 3/1 1/1 4/1"]))
    mesh, colors = load_colored_surface(path)
    points = torch.tensor([[[0.5, 1.0, 3.0], [3.5, 1.0, 3.0]], [[0.5, 2.0, 0.0], [3.5, 2.0, 0.0]]])
    found = colored(ds.Sketch(points), mesh, colors).color
    assert torch.allclose(found, torch.tensor([[0.75, 0, 0.25], [0.5, 0, 0.5]]), atol=1e-6)


def test_contours_have_colours_too(tmp_path):
    """A drum that is blue, with red ends: the two contours of a view are blue, and the creases too, the darker ones."""
    turn = 2 * np.pi * np.arange(32) / 32
    ring = np.stack([np.cos(turn), np.sin(turn)], 1)
    lines = [f"v {x} {y} {z}" for z in (0, 2) for x, y in ring]
    lines = ["mtllib drum.mtl", *lines, "usemtl wall"]
    lines += [f"f {i + 1} {(i + 1) % 32 + 1} {(i + 1) % 32 + 33} {i + 33}" for i in range(32)]
    lines += ["usemtl end", "f " + " ".join(map(str, range(32, 0, -1))), "f " + " ".join(map(str, range(33, 65)))]
    (tmp_path / "drum.obj").write_text("\n".join(lines))
    (tmp_path / "drum.mtl").write_text("newmtl wall\nKd 0 0 1\nnewmtl end\nKd 1 0 0\n")
    arguments = ["mesh", str(tmp_path / "drum.obj"), "-o", str(tmp_path / "out"), "--color", "--quiet"]
    main([*arguments, "--turntable", "2", "--size", "64", "--azimuth", "0"])
    drawing = (tmp_path / "out" / "drawing-1.svg").read_text()
    assert set(re.findall(r'stroke="(#\w+)"', drawing)) == {"#0000ff"}
    assert drawing.count("<path") > 3
    with Image.open(tmp_path / "out" / "turntable.webp") as film:
        values = np.asarray(film.convert("RGB")).astype(int)
    dark = values[values.min(2) < 100]
    assert len(dark)
    assert (dark[:, 2] > 150).all()


def refused(path):
    with pytest.raises(ValueError, match=path.name) as caught:
        drawn(path)
    return str(caught.value)


def test_what_has_no_colours_says_so_and_leaves_no_files(tmp_path, capsys):
    from diff3ds.formats.mesh import save_surface

    save_surface(tmp_path / "plain.glb", CORNERS, np.array([side[:3] for side in SIDES]))
    assert "plain.glb: no face has a colour: colours are read from OBJ" in refused(tmp_path / "plain.glb")
    path = write_sheet(tmp_path / "sheet.obj", None)
    assert "no face has a colour; a texture.png cannot be read beside it" in refused(path)
    (tmp_path / "sheet.mtl").unlink()
    assert "no face has a colour; sheet.mtl cannot be read beside it" in refused(path)
    with pytest.raises(SystemExit):
        main(["mesh", str(path), "-o", str(tmp_path / "out"), "--color"])
    assert "no face has a colour" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


def test_only_pictures_in_the_folder_are_read_and_only_so_large_ones(tmp_path, monkeypatch):
    inner = tmp_path / "inner"
    inner.mkdir()
    path = write_sheet(inner / "sheet.obj", [[RED]], "../")
    (inner / "a texture.png").rename(tmp_path / "a texture.png")
    assert "../a texture.png cannot be read" in refused(path)
    # With a colour of its own the material goes without it, which is said.
    (inner / "sheet.mtl").write_text("newmtl paper\nKd 0 0 1\nmap_Kd ../a texture.png\n")
    lines = []
    from diff3ds.tasks.mesh.draw_mesh import run_mesh
    from diff3ds.tasks.mesh.mesh_options import MeshOptions

    sketch = run_mesh(path, tmp_path / "out", MeshOptions(color=True, turntable=0, size=32), say=lines.append)
    assert sketch.color.tolist() == [[0, 0, 1]] * 4
    assert any("../a texture.png cannot be read" in line for line in lines)
    (inner / "a texture.png").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 10 10\n%%EndComments\n")
    write_sheet(path, None)
    assert "a texture is of the kind EPS" in refused(path)
    write_sheet(path, TEXTURE)
    monkeypatch.setattr("diff3ds.formats.mesh_colors.MAX_PIXELS", 8)
    assert "textures have more than the 8 pixels that are read: 3 x 3" in refused(path)
    monkeypatch.undo()
    content = io.BytesIO()
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)).save(content, "PNG")
    (inner / "a texture.png").write_bytes(content.getvalue()[:2000])
    assert "a texture of 64 x 64 cannot be read" in refused(path)
    huge = struct.pack(">II", 60000, 60000).join([content.getvalue()[:16], content.getvalue()[24:]])
    (inner / "a texture.png").write_bytes(huge)
    assert "cannot be read beside it" in refused(path)


def test_colours_of_faces_of_different_sizes(tmp_path):
    """A red square and a blue triangle at an angle: their common edge is blue, the darker one."""
    head = PLY.format(5, "", 2, RGB)
    (tmp_path / "a.ply").write_text(head + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n2 0 1\n4 0 1 2 3 255 0 0\n3 1 4 2 0 0 255\n")
    sketch = drawn(tmp_path / "a.ply")
    blue = {tuple(p) for p, c in zip(sketch.points.mean(1).tolist(), sketch.color.tolist(), strict=True) if c[2] == 1}
    assert blue == {(1, 0.5, 0), (1.5, 0, 0.5), (1.5, 0.5, 0.5)}
    assert len(sketch) == 6


def test_without_inner_walls_faces_keep_their_colours(tmp_path):
    lines = [PLY.format(16, "", 24, RGB)]
    # The inner box first, so that what is left has other numbers than in the file.
    for share in (0.8, 1.0):
        lines += [f"{x} {y} {z}\n" for x, y, z in share * CORNERS + (1 - share) * np.array([1.5, 1, 0.5])]
    for first, inner in ((0, True), (8, False)):
        for side, color in zip(SIDES, COLORS, strict=True):
            a, b, c, d = side[::-1] if inner else side
            for face in [(a, b, c), (c, d, a)]:
                numbers = (3, *(first + corner for corner in face), *((9, 9, 9) if inner else color))
                lines.append(" ".join(map(str, numbers)) + "\n")
    (tmp_path / "shell.ply").write_text("".join(lines))
    mesh, colors = load_colored_surface(tmp_path / "shell.ply")
    outer = Source(mesh, colors)._outer()
    assert (len(mesh), len(outer.mesh)) == (24, 12)
    middles = outer.mesh.vertices[outer.mesh.faces].mean(1)
    side = np.abs(np.concatenate([middles, middles - [3, 2, 1]], 1)).argmin(1)
    wanted = np.array([COLORS[2 * (k % 3) + k // 3] for k in side]) / 255
    np.testing.assert_allclose(outer.colors.at(np.arange(12), middles), wanted, atol=1e-6)
