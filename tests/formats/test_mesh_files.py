"""Meshes from files: one triangle and a square, written by hand in every text format, and what is no mesh."""

import struct

import numpy as np
import pytest

from diff3ds.formats.mesh import load_mesh

# A square at z = 2, right-handed about z.
OBJ = "mtllib none.mtl\nv 0 0 2\nv 3 0 2\nv 3 1 2\nv 0 1 2\nf 1 2 3 4\n"
OFF = "OFF\n4 1 0\n0 0 2\n3 0 2\n3 1 2\n0 1 2\n4 0 1 2 3\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 2\n3 0 2\n3 1 2\n0 1 2\n4 0 1 2 3\n"
)
FACET = "facet normal 0 0 1\nouter loop\nvertex {}\nvertex {}\nvertex {}\nendloop\nendfacet\n"
STL = f"solid s\n{FACET.format('0 0 2', '3 0 2', '3 1 2')}{FACET.format('0 0 2', '3 1 2', '0 1 2')}endsolid s\n"


def corners(vertices: np.ndarray, faces: np.ndarray) -> set:
    return {tuple(point) for point in vertices[faces].reshape(-1, 3).tolist()}


def area(vertices: np.ndarray, faces: np.ndarray) -> list[float]:
    """As a vector, so that it tells which way the faces turn."""
    a, b, c = vertices[faces].transpose(1, 0, 2)
    return (np.cross(b - a, c - a).sum(0) / 2).tolist()


@pytest.mark.parametrize(("suffix", "text"), [(".obj", OBJ), (".OFF", OFF), (".ply", PLY), (".stl", STL)])
def test_a_square_in_every_format(suffix, text, tmp_path):
    (tmp_path / f"square{suffix}").write_text(text)
    vertices, faces = load_mesh(tmp_path / f"square{suffix}")
    assert len(faces) == 2
    assert corners(vertices, faces) == {(0.0, 0.0, 2.0), (3.0, 0.0, 2.0), (3.0, 1.0, 2.0), (0.0, 1.0, 2.0)}
    assert area(vertices, faces) == [0, 0, 3]


def test_gltf_stands_upright_and_looks_at_us(tmp_path):
    """Its y is our z, its z, the front, our x; a scene's places count."""
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene()
    one = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 2, 0]], [[0, 1, 2]], process=False)
    scene.add_geometry(one, transform=trimesh.transformations.translation_matrix([0, 0, 5]))
    (tmp_path / "one.glb").write_bytes(scene.export(file_type="glb"))
    vertices, faces = load_mesh(tmp_path / "one.glb")
    assert corners(vertices, faces) == {(5.0, 0.0, 0.0), (5.0, 1.0, 0.0), (5.0, 0.0, 2.0)}
    assert area(vertices, faces) == [1, 0, 0]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.obj", b"v 0 0 0\nv 1 0 0\n", "a.obj: "),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "a.obj: "),
        ("a.obj", b"v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n", "a.obj: a mesh needs triangles between finite vertices"),
        ("a.obj", b"\xff\xfe\x00", "a.obj: "),
        ("a.obj", b"", "a.obj: "),
        ("a.stl", b"garbage", "a.stl: "),
        ("a.ply", b"ply\nformat", "a.ply: it has no header of PLY"),
        ("a.glb", b"glTF\x02\0\0\0", "a.glb: it is cut off"),
        ("a.fbx", b"", "cannot load '.fbx' as a mesh, only .obj"),
        ("a.xyz", b"0 0 0\n", "of a cloud of points diff3ds points finds the edges"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\n", "of a cloud of points, saved as PLY, diff3ds points finds the edges"),
    ],
)
def test_what_is_no_mesh(name, content, message, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        load_mesh(tmp_path / name)


def test_a_mesh_has_bounds(tmp_path, monkeypatch):
    (tmp_path / "a.obj").write_text(OBJ)
    monkeypatch.setattr("diff3ds.formats.mesh.MAX_MESH_BYTES", 10)
    with pytest.raises(ValueError, match="bytes are more than the 10"):
        load_mesh(tmp_path / "a.obj")


def test_a_scene_that_shows_one_mesh_many_times_has_bounds(tmp_path, monkeypatch):
    """Few bytes, much memory: instances count as often as they are shown, and a file's promises count too."""
    trimesh = pytest.importorskip("trimesh")
    one = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 2, 0]], [[0, 1, 2]], process=False)
    scene = trimesh.Scene(one)
    (name,) = scene.geometry
    for k in range(20):
        scene.graph.update(f"place {k}", matrix=np.eye(4), geometry=name)
    content = scene.export(file_type="glb")
    (tmp_path / "a.glb").write_bytes(content)
    assert len(load_mesh(tmp_path / "a.glb")[1]) == 21
    monkeypatch.setattr("diff3ds.formats.mesh_files.read_gltf.MOST", 20)
    with pytest.raises(ValueError, match="21 vertices are more than the 20 that are read"):
        load_mesh(tmp_path / "a.glb")
    for wrong in (b'"count":9999', b'"count":-999', b'"count":true', b'"count":1e99'):
        longer = content.replace(b'"count":3', wrong)
        text = struct.unpack_from("<I", content, 12)[0] + len(longer) - len(content)
        (tmp_path / "a.glb").write_bytes(longer[:8] + struct.pack("<II", len(longer), text) + longer[16:])
        with pytest.raises(ValueError, match=r"a\.glb: (numbers lie beyond the end of buffer view|.* is no count)"):
            load_mesh(tmp_path / "a.glb")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none.obj"):
        load_mesh(tmp_path / "none.obj")
