"""`diff3ds render` to .json and .py: what a view shows, as strokes in space."""

import json
import re

import pytest
import torch
import tyro

from diff3ds import Sketch, load, save
from diff3ds.tasks.mesh.mesh_options import MeshOptions
from diff3ds.tasks.render.render_options import OrbitOptions, PictureOptions, SurfaceOptions
from diff3ds.tasks.render.render_views import run_render
from diff3ds.tasks.style_options import StyleOptions

BOARD = "v 0 -1 -1\nv 0 1 -1\nv 0 1 1\nv 0 -1 1\nf 1 2 3\nf 1 3 4\n"


def drawn(folder, name, picture=None, view=None):
    """A line along x through a board, seen from +x."""
    (folder / "board.obj").write_text(BOARD)
    line = Sketch(torch.tensor([[[-0.9, 0.1, 0.2], [0.9, 0.1, 0.2]]], dtype=torch.float64), kinds=["crease"])
    save(folder / "line.json", line)
    hiding = SurfaceOptions(surface=folder / "board.obj", hidden="show" if name.endswith("all.json") else "faint")
    view = view or OrbitOptions(azimuth=(20.0,), elevation=10.0)
    how = (view, picture or PictureOptions(), hiding, StyleOptions())
    return run_render(folder / "line.json", folder / name, *how, lambda _: None)


def test_the_strokes_of_a_view_come_back_as_a_sketch(tmp_path) -> None:
    drawn(tmp_path, "seen.json")
    seen = load(tmp_path / "seen.json")
    of_line = [kind for kind in seen.kinds or () if kind.startswith("crease")]
    assert sorted(of_line) == ["crease", "crease, hidden"]
    row = (seen.kinds or ()).index("crease, hidden")
    ends = seen[row : row + 1].points[0, [0, -1]]
    # Behind the board, and still in space.
    assert ends[:, 0].max() < 0.02
    assert torch.allclose(ends[:, 1:], torch.tensor([0.1, 0.2], dtype=ends.dtype))


def test_a_turn_is_frames_of_grease_pencil(tmp_path) -> None:
    drawn(tmp_path, "turn.py", PictureOptions(turntable=4))
    found = re.search(r'json\.loads\(r"""(.*?)"""\)', (tmp_path / "turn.py").read_text())
    assert found is not None
    scene = json.loads(found[1])
    assert (scene["frames"], scene["turns"]) == (4, True)
    layers = {layer["name"]: [len(strokes) for strokes in layer["frames"]] for layer in scene["layers"]}
    # From the front and from behind one side of the line is seen, and the other not.
    assert all(len(counts) == 4 for counts in layers.values())
    assert layers["crease - visible"][::2] == layers["crease - hidden"][::2] == [1, 1]
    first, third = (
        next(x for x in scene["layers"] if x["name"] == "crease - visible")["frames"][frame][0]["points"]
        for frame in (0, 2)
    )
    assert first[0][1][0] > -0.02 or first[-1][1][0] > 0.8
    assert min(third[0][1][0], third[-1][1][0]) == pytest.approx(-0.9)


@pytest.mark.parametrize(
    ("name", "picture", "view", "what"),
    [
        ("a.json", PictureOptions(turntable=4), None, "a turntable goes to"),
        ("a.py", PictureOptions(background="black"), None, "no page"),
        ("a.py", None, OrbitOptions(azimuth=(0.0, 90.0)), "one perspective view"),
        ("a.py", None, OrbitOptions(height=2.0), "one perspective view"),
    ],
)
def test_what_they_cannot_hold_is_refused(tmp_path, name, picture, view, what) -> None:
    with pytest.raises(ValueError, match=what):
        drawn(tmp_path, name, picture, view)
    assert not (tmp_path / name).exists()


def test_meshes_are_drawn_by_the_cameras_of_a_file(tmp_path) -> None:
    """Whose own cameras, four all around, are not taken for numbers that somebody gave."""
    options = tyro.cli(MeshOptions, args=["--view.cameras", str(tmp_path)])
    assert options.view.cameras == tmp_path
    with pytest.raises(ValueError, match="give either --cameras or --azimuth"):
        OrbitOptions(azimuth=(20.0,), cameras=tmp_path)
