"""Printed markers: their corners in space, whatever the lens, and what is said where they do not help."""

import sys
from dataclasses import replace

import numpy as np
import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.distortion import Distortion
from diff3ds.formats import save_png
from diff3ds.photogrammetry.markers import is_marker, marker_corners
from diff3ds.photogrammetry.placing import distance_between
from diff3ds.tasks.cameras.registration_options import RegistrationOptions
from diff3ds.tasks.cameras.run_cameras import run_cameras
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions
from diff3ds.transforms import View

SIDE, SIZE = 0.3, (300, 400)
LENS = Distortion(radial=(-0.3, 0.05))


def photographed(folder, names):
    """Photographs of marker 7 on the ground: of its corner 0 at (.1, .2), its side along x and -y, by a bent lens."""
    import cv2

    sheet = np.full((8 * 40, 8 * 40), 255, np.uint8)
    sheet[40:280, 40:280] = cv2.aruco.generateImageMarker(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50), 7, 240
    )
    cameras = ds.orbit([20.0, 80.0, 130.0], [50.0, 60.0, 45.0], 2.0, fov=45, size=SIZE, target=(0.5, 0.3, 0.0))
    views = []
    for i, name in enumerate(names):
        pose, lens = cameras.world_to_camera[i].double(), cameras.intrinsics[i].double()
        # Three by three rays a pixel, made straight by what Newton's method finds.
        y, x = ((np.mgrid[: 3 * SIZE[0], : 3 * SIZE[1]] + 0.5) / 3).reshape(2, -1)
        bent = torch.from_numpy(np.stack([x - float(lens[0, 2]), y - float(lens[1, 2])])) / lens[0, 0]
        straight = bent.clone()
        for _ in range(20):
            square = (straight**2).sum(0)
            straight = bent / (1 + LENS.radial[0] * square + LENS.radial[1] * square**2)
        rays = pose[:3, :3].mT @ torch.cat([straight, torch.ones(1, straight.shape[1], dtype=torch.float64)])
        center = -(pose[:3, :3].mT @ pose[:3, 3])
        ground = center[:, None] - rays * (center[2] / rays[2])
        # The sheet has a margin of a sixth of the marker's side.
        across = (ground[:2] - torch.tensor([[0.1], [0.2]])) * torch.tensor([[1.0], [-1.0]]) / SIDE * 240 + 40
        column, row = across.floor().long().numpy()
        inside = (column >= 0) & (row >= 0) & (column < 320) & (row < 320)
        value = np.where(inside, sheet[np.clip(row, 0, 319), np.clip(column, 0, 319)], 160) / 255
        image = value.reshape(SIZE[0], 3, SIZE[1], 3).mean((1, 3))
        save_png(folder / name, torch.from_numpy(image).float()[..., None])
        views.append(View(folder / name, None, SIZE, pose, lens, LENS))
    return views


@needs("cv2")
def test_corners_are_where_the_marker_lies(tmp_path):
    views = photographed(tmp_path, ["a.png", "b.png", "c.png"])
    found = torch.stack(marker_corners(views, [f"aruco:7:{corner}" for corner in range(4)]))
    expected = torch.tensor([[0.1, 0.2, 0], [0.4, 0.2, 0], [0.4, -0.1, 0], [0.1, -0.1, 0]], dtype=torch.float64)
    # A pixel is .004 wide: a third of one.
    torch.testing.assert_close(found, expected, rtol=0, atol=0.0015)
    assert distance_between(views, ("aruco:7:0", "aruco:7:1")) == pytest.approx(SIDE, rel=0.003)
    straight = [replace(view, distortion=Distortion()) for view in views]
    assert (marker_corners(straight, ["aruco:7:2"])[0] - expected[2]).norm() > 0.004
    # From a corner to a camera will do as well.
    away = (views[1].world_to_camera[:3, :3] @ expected[0] + views[1].world_to_camera[:3, 3]).norm()
    assert distance_between(views, ("aruco:7:0", "b")) == pytest.approx(float(away), rel=0.002)
    with pytest.raises(ValueError, match="aruco:8:0 is seen in 0 photographs, and 2 are needed"):
        marker_corners(views, ["aruco:8:0"])
    with pytest.raises(ValueError, match="aruco:7:0 is seen in 1 photographs"):
        marker_corners(views[:1], ["aruco:7:0"])
    with pytest.raises(ValueError, match="aruco:7:0 is seen from one direction only"):
        marker_corners([views[0], views[0]], ["aruco:7:0"])
    aside = replace(views[1], world_to_camera=views[1].world_to_camera + torch.eye(4)[:, [3, 0, 1, 2]] * 0.5)
    with pytest.raises(ValueError, match="do not fit together"):
        marker_corners([views[0], aside], ["aruco:7:0"])


def test_which_names_are_markers(tmp_path, monkeypatch):
    assert is_marker("aruco:7:0")
    assert not any(is_marker(name) for name in ("aruco:7", "aruco:7:4", "aruco:123:0", "IMG_7", "1,2,3"))
    monkeypatch.setitem(sys.modules, "cv2", None)
    assert marker_corners([], []) == []
    with pytest.raises(ImportError, match=r'pip install "diff3ds\[markers\]"'):
        marker_corners([], ["aruco:7:0"])
    # Before anything is looked at.
    options = {"scale": 40.0, "between": ("aruco:7:0", "aruco:7:1")}
    for run, given in ((run_cameras, RegistrationOptions(**options)), (run_views, ViewsOptions(**options))):
        with pytest.raises(ImportError, match="markers are found by OpenCV"):
            run(tmp_path / "nothing", tmp_path / "out", given)
