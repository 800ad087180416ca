"""Distortion that a refinement finds: pictures are read again without it, also by whoever reads the file of cameras."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds.curves.shapes.curve_set import Curves
from diff3ds.distortion import Distortion
from diff3ds.edges.cameras.coarse_to_fine import Refined
from diff3ds.edges.evidence.bias import Bias
from diff3ds.edges.reconstruct import Result
from diff3ds.formats import save_png
from diff3ds.formats.png import load_reduced
from diff3ds.pictures.reading import decoded_once
from diff3ds.pictures.reading.lens import undistorted
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions
from diff3ds.transforms import read_views, save_transforms

K1 = 0.15
CAMERAS = ds.orbit(
    [137.508 * (i + 0.5) for i in range(12)],
    [np.degrees(np.arcsin(1 - (i + 0.5) / 6)) for i in range(12)],
    2.4,
    fov=60,
    size=128,
)


def box(width=0.012):
    ends = torch.tensor([[x, y, z] for x in (-0.6, 0.6) for y in (-0.6, 0.6) for z in (-0.6, 0.6)])
    pairs = [(a, b) for i, a in enumerate(ends) for b in ends[i + 1 :] if int((a != b).sum()) == 1]
    return ds.Sketch(torch.stack([torch.stack([a, b]) for a, b in pairs]), width=width)


@pytest.fixture
def scene(tmp_path):
    """Drawings of a box that a lens has bent, with true cameras that do not say so."""
    ink = ds.render(box(), CAMERAS).alpha
    # The inverse of k1, to a pixel's hundredth within these pictures, as its series in r^2.
    inverse = Distortion((-K1, 3 * K1**2, -12 * K1**3, 55 * K1**4, -273 * K1**5))
    for view in range(12):
        bent, _ = undistorted(ink[view, ..., None], CAMERAS.intrinsics[view].double(), inverse, range(128))
        save_png(tmp_path / f"{view}.png", bent.permute(1, 2, 0))
    save_transforms(tmp_path / "transforms.json", CAMERAS, [f"{view}.png" for view in range(12)])
    return tmp_path


def lengths(sketch):
    return (sketch.points[:, -1] - sketch.points[:, 0]).norm(dim=1).sort().values


def known(cameras, ridges, report, lens, textured):
    """What a refinement finds that makes no mistake, where one lens took all pictures, which are edge maps."""
    assert (lens, textured) == (Distortion(), False)
    return Refined(cameras.world_to_camera, cameras.intrinsics, np.full(len(ridges), 5.0), K1)


def test_pictures_are_read_again_without_the_distortion(scene, monkeypatch):
    """By the run that finds it, by one that goes on, and by one that reads the file of cameras."""
    seen, said, decoded, decode = [], [], [], load_reduced

    def counted(path, least):
        decoded.append(path.name)
        return decode(path, least)

    def looked_at(cameras, ridges, save, **rest):
        seen.append((cameras, ridges))
        line = Curves(torch.linspace(0, 0.5, 12).reshape(1, 4, 3), torch.tensor([0]), torch.tensor([[0, 1]]))
        save(Result(1, line, Bias(0.0, 0.0, 0.0)))

    options = ViewsOptions(target="edges", refine_cameras=True)
    with monkeypatch.context() as patch:
        patch.setattr("diff3ds.tasks.views.edge_fit.edge_sketch.reconstruct", looked_at)
        patch.setattr("diff3ds.tasks.views.edge_fit.refined_views.refined_cameras", known)
        patch.setattr(decoded_once, "load_reduced", counted)
        run_views(scene, scene / "out", options, say=said.append)
    # Read twice, decoded once.
    assert sorted(decoded) == sorted(f"{view}.png" for view in range(12))
    monkeypatch.setattr("diff3ds.tasks.views.edge_fit.edge_sketch.reconstruct", looked_at)
    about = json.loads((scene / "out" / "run.json").read_text())["cameras"]
    assert about["distortion"]["k1"] == K1
    assert any(f"{about['distortion']['pixels_at_corners']:.1f} pixels at the corners" in line for line in said)
    assert [view.distortion.radial for view in read_views(scene / "out" / "transforms_refined.json")] == [(K1,)] * 12
    run_views(scene, scene / "out", replace(options, resume=True))
    run_views(scene / "out" / "transforms_refined.json", scene / "again", ViewsOptions(target="edges"))
    # Frames may be others.
    for cameras, ridges in seen:
        torch.testing.assert_close(cameras.intrinsics, seen[0][0].intrinsics)
        for here, there in zip(ridges, seen[0][1], strict=True):
            np.testing.assert_array_equal(here.points, there.points)
    assert len(seen) == 3
    # They are where a pinhole sees the edges of the box.
    edges = ds.bezier.evaluate(box().points, None, torch.linspace(0, 1, 400)).reshape(-1, 3).double()
    seen_edges = CAMERAS.seen(torch.nn.functional.pad(edges, (0, 1), value=1.0) @ CAMERAS.projection.double().mT)[0]
    off = [cKDTree(on.numpy()).query(r.points)[0] for on, r in zip(seen_edges, seen[0][1], strict=True)]
    # Corners and crossings pull; with the distortion it is .6.
    assert np.median(np.concatenate(off)) < 0.15


@pytest.mark.slow
def test_distortion_is_found_and_taken_out(scene):
    found = run_views(scene, scene / "out", ViewsOptions(target="edges", refine_cameras=True))
    about = json.loads((scene / "out" / "run.json").read_text())["cameras"]
    assert about["distortion"]["k1"] == pytest.approx(K1, abs=0.02)
    assert len(found) == 12
    # The size of the whole is one with the cameras' distances.
    torch.testing.assert_close(lengths(found) / lengths(found).mean(), torch.ones(12), atol=0.015, rtol=0)
