"""Details that a drawing of a thing lacks are left out of it, and only those."""

import pytest
import torch
from test_bend import CAMERA, lines_of
from test_studio import HOUSE

import diff3ds as ds
from diff3ds.library import CATEGORIES, member
from diff3ds.recognition.side_seen import alike
from diff3ds.surfaces.draw import visible_lines
from diff3ds.surfaces.shape.triangle_mesh import TriangleMesh
from diff3ds.tasks.exact_prior.left_out import drawn_strokes
from diff3ds.tasks.studio.drawn import save_drawing

# A house has two windows and a door, the last of its strokes.
WINDOWS, DOOR = 8, 3


def made(kind: str, *attributes: str):
    return member(kind, torch.Generator().manual_seed(0), attributes)


def seen(sketch: ds.Sketch, one) -> ds.Sketch:
    """What people draw: nothing that is hidden."""
    surface = TriangleMesh.of_triangles(one.faces.numpy())
    return visible_lines(sketch, CAMERA.resize(256), surface, contours=False)[0].parts.seen_of(sketch)


def left_out(one, drawing: ds.Sketch) -> list[int]:
    stays = drawn_strokes(one.sketch, one.details, one.faces, lines_of(drawing))
    return (~stays).nonzero()[:, 0].tolist()


def test_the_windows_that_nobody_drew_are_left_out():
    house = made("house")
    count = len(house.sketch)
    windows = list(range(count - WINDOWS, count))
    door = list(range(count - WINDOWS - DOOR, count - WINDOWS))
    assert left_out(house, seen(house.sketch, house)) == []
    assert left_out(house, seen(house.sketch[: count - WINDOWS], house)) == windows
    assert left_out(house, seen(house.sketch[: count - WINDOWS - DOOR], house)) == [*door, *windows]


def test_windows_of_another_form_keep_those_of_the_house():
    # Each stands on a corner, and is as wide as the house's: none of its lines lies along one of these.
    house = made("house")
    count = len(house.sketch)
    other = house.sketch.replace(points=house.sketch.points.clone())
    for first in (count - WINDOWS, count - WINDOWS // 2):
        window = other.points[first : first + 4, :, 1:]
        middle = window.mean((0, 1))
        y, z = (window - middle).unbind(-1)
        window[:] = middle + torch.stack([y - z, y + z], -1) / 2
    assert left_out(house, seen(other, house)) == []


def test_what_a_drawing_cannot_show_stays():
    # From behind the door and the windows are hidden.
    house = made("house")
    turned = house.sketch.replace(points=house.sketch.points * torch.tensor([-1.0, -1.0, 1.0]))
    faces = house.faces * torch.tensor([-1.0, -1.0, 1.0])
    surface = TriangleMesh.of_triangles(faces.numpy())
    drawing = visible_lines(turned, CAMERA.resize(256), surface, contours=False)[0].parts.seen_of(turned)
    assert bool(drawn_strokes(turned, house.details, faces, lines_of(drawing)).all())


def test_no_kind_is_made_of_details_alone_and_none_hides_anything():
    with_details = 0
    for kind, category in CATEGORIES.items():
        one = made(kind)
        assert len(one.details) == len(one.sketch), kind
        with_details += int(one.details.max()) >= 0
        assert bool((one.details < 0).any()), kind
        parts = category.make(lambda low, high: (low + high) / 2, ())
        assert not [part for part in parts if part.detail and part.solids], kind
    assert with_details > 10


def test_what_was_asked_for_is_no_detail():
    house = made("house")
    lines = lines_of(house.sketch).lines
    (found,) = alike(lines, "house", ("two floors",), CAMERA, 1)
    plain = made("house", "two floors")
    # Windows of the second floor came with it.
    assert int((found.details >= 0).sum()) < int((plain.details >= 0).sum())
    assert bool((found.details >= 0).any())


@pytest.mark.slow
def test_the_command_leaves_out_the_windows_that_nobody_drew(tmp_path):
    save_drawing(tmp_path / "house.png", HOUSE)
    sketch = ds.image_to_sketch(tmp_path / "house.png", shows="a house", steps=300)
    # 15 strokes of the walls and the roof, of which some go on in each other, and three of the door.
    assert len(sketch.segments()) <= 18
