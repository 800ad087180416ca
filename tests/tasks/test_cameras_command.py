"""`diff3ds cameras`: projects converted, upright and to scale; photographs of a known scene placed by pycolmap."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from needs import needs
from PIL import Image

import diff3ds as ds
from diff3ds.photogrammetry.find_project import sparse_points
from diff3ds.photogrammetry.placing import centers_of, moved, turned_up, up_of
from diff3ds.tasks.cameras.register import _pairs
from diff3ds.tasks.cameras.registration_options import RegistrationOptions
from diff3ds.tasks.cameras.run_cameras import are_estimated, run_cameras
from diff3ds.transforms import read_views

TILTED = torch.linalg.qr(torch.tensor([[1.0, 0.2, 0.3], [-0.4, 1.0, 0.1], [0.2, 0.5, 1.0]], dtype=torch.float64))[0]
TILTED = TILTED * TILTED.det()


def colmap_project(folder, cameras, names):
    """A model written by hand, with matrices as quaternions by the largest of four."""
    (folder / "sparse").mkdir(parents=True)
    (folder / "images").mkdir()
    height, width = cameras.size
    fx, cx, cy = (float(cameras.intrinsics[0][i]) for i in ((0, 0), (0, 2), (1, 2)))
    (folder / "sparse" / "cameras.txt").write_text(f"1 SIMPLE_PINHOLE {width} {height} {fx} {cx} {cy}\n")
    lines = []
    for i, (name, pose) in enumerate(zip(names, cameras.world_to_camera.double(), strict=True)):
        values, vectors = torch.linalg.eigh(_quaternion_matrix(pose[:3, :3]))
        w, x, y, z = vectors[:, values.argmax()].tolist()
        lines += [f"{i + 1} {w} {x} {y} {z} {' '.join(map(str, pose[:3, 3].tolist()))} 1 {name}", ""]
        Image.new("RGB", (width, height)).save(folder / "images" / name)
    (folder / "sparse" / "images.txt").write_text("\n".join(lines) + "\n")
    return folder


def _quaternion_matrix(r):
    """Whose eigenvector of the largest eigenvalue is the quaternion (w, x, y, z) of a rotation (Bar-Itzhack)."""
    a, b, c = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    return torch.tensor(
        [
            [r.trace(), a, b, c],
            [a, r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [b, r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1]],
            [c, r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1]],
        ]
    )


CAMERAS = ds.orbit([0.0, 90.0, 180.0, 270.0], [20.0, 30.0, 10.0, 25.0], 2.0, size=(24, 32))
NAMES = ["a.png", "b.png", "c.png", "d.png"]


def test_a_project_comes_in_units_of_the_user(tmp_path):
    """Cameras at 2 units from the origin; between a and c the user has measured 500 mm."""
    source = colmap_project(tmp_path / "scan", CAMERAS, NAMES)
    lines = []
    path = run_cameras(
        source, tmp_path / "out", RegistrationOptions(scale=500.0, between=("a", "c.png")), say=lines.append
    )
    views = read_views(path)
    factor = 500 / float((CAMERAS.centers[0] - CAMERAS.centers[2]).norm())
    np.testing.assert_allclose(centers_of(views), CAMERAS.centers * factor, atol=1e-3)
    assert views[0].picture.resolve() == (source / "images" / "a.png").resolve()
    assert not Path(json.loads(path.read_text())["frames"][0]["file_path"]).is_absolute()
    assert json.loads((tmp_path / "out" / "cameras.json").read_text())["points"] == 0
    assert lines == [f"{source / 'sparse'}: 4 cameras"]
    with pytest.raises(ValueError, match="between: 0 pictures with cameras are called 'e'"):
        run_cameras(source, tmp_path / "other", RegistrationOptions(scale=500.0, between=("a", "e")))
    assert not (tmp_path / "other").exists()
    with pytest.raises(ValueError, match="two different places, got 'a' twice"):
        RegistrationOptions(scale=500.0, between=("a", "a"))
    with pytest.raises(ValueError, match="scale and between belong together"):
        RegistrationOptions(scale=5.0)


def test_up_is_what_level_photographs_say(tmp_path):
    """Cameras of an orbit in a tilted world, two of them held upright, which EXIF says."""
    source = colmap_project(tmp_path, CAMERAS, NAMES)
    views = run_cameras(source, tmp_path / "out")
    views = moved(read_views(views), torch.tensor([1.0, 2.0, 3.0]).double(), TILTED, 0.5)
    torch.testing.assert_close(up_of(views), TILTED[:, 2], rtol=0, atol=1e-6)
    # A camera turned by a quarter: what is stored has up at its left (EXIF 6).
    quarter = torch.tensor([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]], dtype=torch.float64)
    for view in views[::2]:
        view.world_to_camera[:3] = quarter @ view.world_to_camera[:3]
        exif = Image.Exif()
        exif[0x0112] = 6
        Image.open(view.picture).save(view.picture, exif=exif)
    torch.testing.assert_close(up_of(views), TILTED[:, 2], rtol=0, atol=1e-6)
    upright = moved(views, torch.zeros(3).double(), turned_up(up_of(views)), 1.0)
    torch.testing.assert_close(up_of(upright), torch.tensor([0.0, 0, 1]).double(), rtol=0, atol=1e-6)


def test_which_photographs_are_compared():
    files = [Path(f"f{i:03d}.jpg") for i in range(100)]
    names = [file.stem for file in files]
    assert len(list(_pairs(names[:50], files[:50], RegistrationOptions()))) == 50 * 49 // 2
    pairs = set(_pairs(names, files, RegistrationOptions()))
    # 8 neighbours, and steps of 16 and 32, round a closed sequence.
    assert len(pairs) == 100 * 10
    assert {("f000", "f001"), ("f000", "f099"), ("f010", "f042")} <= pairs
    assert all(a < b for a, b in pairs)
    # Without zeros before them, numbers sort otherwise than names do.
    bare = sorted(Path(f"f{i}.jpg") for i in range(100))
    of_bare = {
        frozenset((bare[names.index(a)].stem, bare[names.index(b)].stem))
        for a, b in _pairs(names, bare, RegistrationOptions())
    }
    assert of_bare == {frozenset(f"f{int(name[1:])}" for name in pair) for pair in pairs}
    other = [Path(f"{i}-by-night.jpg") for i in range(100)]
    assert len(list(_pairs(names, other, RegistrationOptions()))) == 100 * 99 // 2
    assert len(list(_pairs(names[:20], files[:20], RegistrationOptions(order="sequence")))) < 20 * 19 // 2


def test_too_few_photographs(tmp_path):
    Image.new("RGB", (8, 8)).save(tmp_path / "a.png")
    with pytest.raises((ValueError, ImportError), match=r"at least 3 photographs, got 1|needs pycolmap: pip install"):
        run_cameras(tmp_path, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileNotFoundError, match="no pictures either"):
        run_cameras(tmp_path / "empty", tmp_path / "other")


@needs("pycolmap")
def test_photographs_of_a_known_scene(tmp_path):
    """A plane of random blocks from ten sides: centres come back to 2 % of their spread, and up with them."""
    generator = np.random.default_rng(0)
    blocks = np.kron(generator.random((24, 24)), np.ones((8, 8)))
    texture = torch.from_numpy(blocks)
    size, names = (160, 200), [f"{i}.png" for i in range(10)]
    cameras = ds.orbit([30.0 * i for i in range(10)], [50.0, 60.0] * 5, 2.0, fov=45.0, size=size).to(torch.float64)
    rows, columns = torch.meshgrid(*(torch.arange(2 * n).double() / 2 + 0.25 for n in size), indexing="ij")
    (tmp_path / "photos").mkdir()
    for i, name in enumerate(names):
        pixels = torch.stack([columns, rows, torch.ones_like(rows)], -1)
        rays = pixels @ torch.linalg.inv(cameras.intrinsics[i]).mT @ cameras.world_to_camera[i, :3, :3]
        center = cameras.centers[i]
        hit = center[:2] - rays[..., :2] * (center[2] / rays[..., 2:])
        grid = hit[None] / 0.8
        shown = torch.nn.functional.grid_sample(texture[None, None], grid, align_corners=False)
        small = torch.nn.functional.avg_pool2d(shown, 2)[0, 0]
        Image.fromarray((255 * small).byte().numpy()).save(tmp_path / "photos" / name)
    lines, stages = [], []
    run_cameras(tmp_path / "photos", tmp_path / "out", report=lambda p: stages.append(p.stage), say=lines.append)
    views = read_views(tmp_path / "out" / "transforms.json")
    assert are_estimated(tmp_path / "out" / "transforms.json")
    points = sparse_points(tmp_path / "out" / "transforms.json")
    assert len(points) == json.loads((tmp_path / "out" / "cameras.json").read_text())["points"]
    # On the plane, in a world whose unit is the cameras' distance.
    spread = torch.linalg.eigvalsh(torch.cov(points.mT))
    assert spread[0] < 1e-3 * spread[1]
    assert len(views) >= 8
    assert list(dict.fromkeys(stages)) == ["read photographs", "features", "matches", "cameras"]
    assert f"{len(views)} of 10 photographs placed" in lines[-1]
    truth = cameras.centers[[names.index(view.picture.name) for view in views]]
    found = centers_of(views)
    a, b = found - found.mean(0), truth - truth.mean(0)
    u, s, vh = torch.linalg.svd(a.mT @ b)
    turn = u @ torch.diag(torch.tensor([1.0, 1.0, float((u @ vh).det().sign())]).double()) @ vh
    off = (s.sum() / a.square().sum() * a @ turn - b).norm(dim=1)
    assert float(off.max()) < 0.02 * float(b.norm(dim=1).max())
    torch.testing.assert_close(turn[2], torch.tensor([0.0, 0, 1]).double(), rtol=0, atol=0.02)
    # The same to the last bit, whatever the number of threads.
    threads = ds.get_num_threads()
    try:
        ds.set_num_threads(1 if threads > 1 else 2)
        run_cameras(tmp_path / "photos", tmp_path / "again")
    finally:
        ds.set_num_threads(threads)
    one, other = ((tmp_path / name / "transforms.json").read_bytes() for name in ("out", "again"))
    assert one == other
