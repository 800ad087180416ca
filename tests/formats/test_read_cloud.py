"""Clouds of points from files: what is read of each format, and what is refused."""

import io
import random
import warnings

import numpy as np
import pytest
from hostile import broken

from diff3ds.formats.clouds.read_cloud import read_cloud

POINTS = np.array([[0.5, 1.25, -2.0], [3.0, 0.0, 0.125], [-1.0, 2.0, 4.0]])
NORMALS = np.array([[1.0, 0, 0], [0, 0.6, 0.8], [0, 0, -1]])
BOTH = np.hstack([POINTS, NORMALS])


def _ply(table: np.ndarray) -> bytes:
    names = ["x", "y", "z", "nx", "ny", "nz"][: table.shape[1]]
    lines = "".join(f"property float {name}\n" for name in names)
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(table)}\n{lines}end_header\n"
    return header.encode() + table.astype("<f4").tobytes()


def _npy(table: np.ndarray, count: bytes) -> bytes:
    """A file of numpy that says another number of points."""
    file = io.BytesIO()
    np.save(file, table)
    return file.getvalue().replace(b"(%d," % len(table), b"(%s," % count)


def _text(table: np.ndarray, by: str, head: str = "") -> bytes:
    return (head + "\n".join(by.join(map(str, row)) for row in table) + "\n").encode()


def _pcd(table: np.ndarray, kind: str) -> bytes:
    names = ["x", "y", "z", "normal_x", "normal_y", "normal_z"][: table.shape[1]]
    count = len(names)
    header = (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS {' '.join(names)}\nSIZE {'4 ' * count}\nTYPE {'F ' * count}\n"
        f"COUNT {'1 ' * count}\nWIDTH {len(table)}\nHEIGHT 1\nPOINTS {len(table)}\nDATA {kind}\n"
    )
    body = (
        table.astype("<f4").tobytes() if kind == "binary" else "\n".join(" ".join(map(str, r)) for r in table).encode()
    )
    return header.encode() + body


@pytest.mark.parametrize("table", [POINTS, BOTH], ids=["points", "normals"])
@pytest.mark.parametrize("kind", ["ply", "xyz", "csv", "pts", "npy", "ascii", "binary"])
def test_points_and_normals_are_read(tmp_path, table, kind):
    suffix = "pcd" if kind in ("ascii", "binary") else kind
    path = tmp_path / f"cloud.{suffix}"
    if kind == "npy":
        np.save(path, table)
    else:
        path.write_bytes(
            {
                "ply": lambda: _ply(table),
                "xyz": lambda: _text(table, " ", "# a comment\n"),
                "csv": lambda: _text(table, ", ", "x, y, z\n"),
                "pts": lambda: _text(table, " ", "3\n"),
            }.get(kind, lambda: _pcd(table, kind))()
        )
    read = read_cloud(path)
    assert np.allclose(read.points, POINTS, atol=1e-7)
    assert read.normals is None if table is POINTS else np.allclose(read.normals, NORMALS, atol=1e-7)


def test_colours_are_no_normals_and_places_count_once(tmp_path):
    path = tmp_path / "cloud.txt"
    path.write_bytes(_text(np.hstack([POINTS[[0, 1, 1, 2]], 200 * np.ones((4, 3))]), " "))
    read = read_cloud(path)
    assert np.array_equal(read.points, POINTS)
    assert read.normals is None


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.obj", b"", "cannot load '.obj' as a cloud.*: diff3ds mesh draws the lines of a mesh"),
        ("a.xyz", b"", "no line has three numbers"),
        ("a.xyz", b"1 2 3\n4 5\n", "not all the 3 numbers"),
        ("a.xyz", b"1 2 3\n4 5 six\n", "'six' is no number"),
        ("a.xyz", b"nan nan nan\n", "cloud needs points"),
        ("a.npy", b"nonsense", "a.npy"),
        ("a.pcd", b"FIELDS x y z\n", "says what its DATA are"),
        ("a.pcd", _pcd(POINTS, "binary")[:-5], "a.pcd"),
        ("a.pcd", _pcd(POINTS, "ascii").replace(b"ascii", b"binary_compressed"), "only ascii and binary"),
        ("a.pcd", _pcd(POINTS, "binary").replace(b"SIZE 4 4 4 ", b"SIZE 4 4 9 "), r"a\.pcd: not a cloud .*TypeError"),
        ("a.npy", _npy(POINTS, b"99999999999999999999"), r"a\.npy: "),
        ("a.npy", _npy(POINTS, b"42949672940"), r"a\.npy: mmap length is greater than file size"),
        ("a.npy", _npy(POINTS, b"{"), r"a\.npy: not a cloud that can be read \(TokenError"),
        ("a.ply", b"ply\nnothing", "no header of PLY"),
        ("a.ply", _ply(POINTS)[:-5], "cut off or broken"),
    ],
)
def test_what_is_no_cloud_is_refused(tmp_path, name, content, said):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(ValueError, match=said):
        read_cloud(path)


def test_that_faces_are_left_out_is_said(tmp_path):
    path = tmp_path / "mesh.ply"
    face = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    path.write_bytes(_ply(POINTS).replace(b"end_header\n", face) + b"\x03" + np.arange(3, dtype="<i4").tobytes())
    with pytest.warns(UserWarning, match="faces of the file are left out: diff3ds mesh draws"):
        read = read_cloud(path)
    assert len(read.points) == len(POINTS)


SEEDS = {
    ".ply": [_ply(POINTS)],
    ".pcd": [_pcd(POINTS, "ascii"), _pcd(POINTS, "binary")],
    ".npy": [_npy(POINTS, b"%d" % len(POINTS))],
    ".xyz": [_text(POINTS, " "), _text(POINTS, ";", "3\n")],
}


def check_fuzzed(folder, suffix, count, seed):
    """Of so many damaged clouds, each is read as finite points or refused by name; returns how many were read."""
    path, rng, said = folder / f"some file{suffix}", random.Random(seed), []
    for _ in range(count):
        path.write_bytes(broken(rng.choice(SEEDS[suffix]), rng))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                cloud = read_cloud(path)
        except ValueError as error:
            said.append(str(error))
            continue
        assert cloud.points.shape[1:] == (3,)
        assert np.isfinite(cloud.points).all()
    assert [text for text in said if path.name not in text] == []
    return count - len(said)


@pytest.mark.parametrize("suffix", SEEDS)
def test_damaged_clouds_give_points_or_an_error_that_names_the_file(tmp_path, suffix):
    assert 0 < check_fuzzed(tmp_path, suffix, 200, seed=0) < 200
