"""The scripts for Blender, run by Blender itself: what they build is the sketch, and what was there stays."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from diff3ds import Chains, Sketch, TriangleMesh, bezier
from diff3ds.bezier import evaluate
from diff3ds.bezier.curves import bernstein
from diff3ds.formats.framing import FILLED, ball_of
from diff3ds.formats.scenes.blender import FRAMES, save_blender
from diff3ds.surfaces.on_page import SurfaceOnPage

pytestmark = pytest.mark.slow
INSIDE = Path(__file__).with_name("inside")


def sketch() -> Sketch:
    """A closed circle, two half turns of one segment each, uneven weights with widths that change, and a line."""
    generator = torch.Generator().manual_seed(0)
    ring, weights = bezier.circle((0.0, 0.0, 0.2), 0.8)
    loop = Sketch(ring, weights, width=0.02, chains=Chains.of([len(ring)], True))
    half, half_weights = bezier.ellipse((0.0, 0.0, 0.0), (0.9, 0.0, 0.0), (0.0, 0.5, 0.3), start=0, stop=160)
    turn = Sketch(half, half_weights, width=0.01, color=(0.8, 0.1, 0.1), chains=Chains.of([len(half)], False))
    wild = Sketch(
        torch.rand(4, 4, 3, generator=generator, dtype=torch.float64) - 0.5,
        torch.exp(2 * torch.rand(4, 4, generator=generator, dtype=torch.float64)),
        width=0.03 * torch.rand(4, 4, generator=generator, dtype=torch.float64),
        color=(0.1, 0.1, 0.8),
        opacity=0.5,
    )
    line = Sketch(
        torch.rand(1, 2, 3, generator=generator, dtype=torch.float64), width=torch.tensor([[0.02, 0.0]]).double()
    )
    names = [f"lamp/part {n}" for n in range(3)] + ["tiny/rod/bar", "tiny/rod/bar", "", ""]
    kinds = ["crease"] * 4 + ["contour"] * 2 + [""]
    return Sketch.concatenate([loop, turn, wild, line]).replace(names=names, kinds=kinds)


def off(whole: Sketch, points: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far points are from the strokes, and their radii from the radius of one there, world units."""
    cubics = whole.elevate(3).with_widths_along()
    query = torch.from_numpy(points)
    away, wrong = [], []
    for row in range(len(cubics.points)):
        t, _, distance = bezier.closest_point(cubics.points[row], cubics.weights[row], query)
        wide = (bernstein(t, 3) @ cubics.width[row]) * ball_of(whole)[1] / FILLED
        away.append(distance)
        wrong.append((wide - torch.from_numpy(radii)).abs())
    distance, which = torch.stack(away).min(0)
    return distance.numpy(), torch.stack(wrong).gather(0, which[None])[0].numpy()


def to_chords(points: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """How far points are from the nearest of chords."""
    along = last - first
    relative = points[:, None] - first
    t = ((relative * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-30)).clip(0, 1)
    return np.sqrt(((relative - t[..., None] * along) ** 2).sum(-1)).min(1)


@pytest.mark.parametrize("strokes", ["curves", "grease-pencil"])
def test_curves_and_grease_pencil_are_the_sketch(blender, tmp_path, strokes) -> None:
    whole = sketch()
    save_blender(tmp_path / "scene.py", whole, strokes=strokes, unit="cm")
    blender(INSIDE / "measure.py", tmp_path / "scene.py", tmp_path / "found.json")
    found = json.loads((tmp_path / "found.json").read_text())
    assert len(found) == (len(whole) if strokes == "curves" else 1)
    radius = ball_of(whole)[1]
    # A hundredth of a metre a world unit.
    points = np.concatenate([100 * np.array(each["points"]) for each in found])
    radii = np.concatenate([100 * np.array(each["radii"]) for each in found])
    away, wrong = off(whole, points, radii)
    assert away.max() < 1e-3 * radius
    # Within a hundredth of the widest of all.
    assert wrong.max() < 1e-2 * radii.max()
    # Nothing of the sketch is missing: its points are on the chords.
    offsets = np.cumsum([0, *(len(each["points"]) for each in found)])
    chords = np.concatenate([np.array(each["chords"]) + more for each, more in zip(found, offsets, strict=False)])
    places = evaluate(whole.points, whole.weights, torch.linspace(0, 1, 101, dtype=torch.float64)).reshape(-1, 3)
    assert to_chords(places.numpy(), points[chords[:, 0]], points[chords[:, 1]]).max() < 1e-3 * radius


# That there is a collection more, and what it holds, is all that the open scene may notice.
NOTICED = (
    "Scene.objects:",
    "view_layers[0].layer_collection.children:",
    "view_layers[0].objects:",
)


@pytest.mark.parametrize("strokes", ["curves", "grease-pencil"])
@pytest.mark.parametrize("rendered", [(), ("picture.png", "16", "16"), ("turn.mp4", "16", "16", "--turntable")])
def test_a_file_with_work_in_it_is_left_as_it_was(blender, tmp_path, strokes, rendered) -> None:
    if rendered and strokes == "grease-pencil":
        pytest.skip("Grease Pencil is drawn on a graphics card alone")
    surface = SurfaceOnPage(TriangleMesh(np.eye(3), [[0, 1, 2]]))
    save_blender(tmp_path / "scene.py", sketch(), strokes=strokes, unit="mm", surface=surface)
    script = tmp_path / "scene.py"
    script.write_text(script.read_text().replace(f'"frames":{FRAMES}', '"frames":2'))
    where = [str(tmp_path / rendered[0]), *rendered[1:]] if rendered else []
    said = blender(INSIDE / "leaves_be.py", script, *(["--", *where] if where else []))
    changed = [line for line in said.splitlines() if line.startswith("CHANGED ")]
    assert [line for line in changed if line != "CHANGED " and not any(way in line for way in NOTICED)] == []
    new = next(line for line in said.splitlines() if line.startswith("NEW "))
    assert ("'curves'" in new) == (strokes == "curves")
    if rendered:
        content = (tmp_path / rendered[0]).read_bytes()
        assert content.startswith(b"\x89PNG") or b"ftyp" in content[:16]
