"""`ds.render` with a surface: what is dropped, faint or dashed, whose contours are drawn, and gradients."""

import numpy as np
import pytest
import torch
from solids import box, icosphere, torus

import diff3ds as ds
from diff3ds.render.backends import set_num_threads
from diff3ds.surfaces.draw import Lines, visible_lines

BEHIND = torch.tensor([[[-3.0, 3, 0.2], [3, 3, 0.2]]], dtype=torch.float64)


def front(size: int = 200) -> ds.Cameras:
    return ds.look_at(torch.tensor([[0.0, -6, 0]]), size=size).to(torch.float64)


def row(rendering: ds.Rendering) -> np.ndarray:
    """Ink along the picture of the stroke behind the box, 0.2 above the middle at depth 9."""
    size = rendering.alpha.shape[1]
    height = size / 2 - 0.2 / 9 * size / 2 / np.tan(np.deg2rad(30))
    return rendering.alpha[0, int(height)].numpy()


def test_hidden_parts_are_dropped_faint_dashed_or_shown():
    mesh, sketch = ds.TriangleMesh(*box()), ds.Sketch(BEHIND, width=0.02)
    whole = row(ds.render(sketch, front()))
    # Of the stroke's 600 parts 120 on either side are seen.
    ink = {
        how: row(ds.render(sketch, front(), surface=mesh, hidden=how)) for how in ("drop", "faint", "dashed", "show")
    }
    assert np.array_equal(ink["show"], whole)
    middle, beside = slice(75, 125), slice(45, 58)
    for how in ("drop", "faint", "dashed"):
        assert np.allclose(ink[how][beside], whole[beside])
    assert ink["drop"][middle].max() == 0
    assert np.allclose(ink["faint"][middle], 0.25 * whole[middle])
    assert 0.3 < (ink["dashed"][middle] > 0.5).mean() < 0.9
    assert ink["dashed"][middle].min() < 0.15


def test_draw_is_render_with_a_surface():
    mesh, sketch, cameras = ds.TriangleMesh(*box()), ds.Sketch(BEHIND, width=0.02), ds.orbit([0.0, 50], 20, size=48)
    drawn = ds.draw(sketch.to(torch.float32), cameras, mesh, hidden="faint", contours=False, background=0.5)
    same = ds.render(sketch.to(torch.float32), cameras, surface=mesh, hidden="faint", contours=False, background=0.5)
    assert all(torch.equal(getattr(drawn, name), getattr(same, name)) for name in ("color", "alpha", "depth"))


def test_contours_are_drawn_unless_told_not_to():
    ball, nothing = ds.TriangleMesh(*icosphere(3)), ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64))
    drawn = ds.render(nothing, front(), surface=ball)
    assert float(drawn.alpha.sum()) > 100
    assert float(ds.render(nothing, front(), surface=ball, contours=False).alpha.sum()) == 0
    # Each view has lines of its own, over its own ground.
    cameras = ds.orbit([0.0, 90], 0.0, 4.0, size=64)
    both = ds.render(nothing.to(torch.float32), cameras, surface=ball, background=torch.rand(2, 64, 64, 3))
    assert both.color.shape == (2, 64, 64, 3)
    assert both.color.dtype == torch.float32


def test_gradients_flow_to_visible_parts_and_to_no_others():
    points = torch.cat([BEHIND, BEHIND / 3 + torch.tensor([0.0, 0, 0.2])]).requires_grad_()
    mesh = ds.TriangleMesh(*box())

    def loss(points: torch.Tensor) -> torch.Tensor:
        drawn = ds.render(ds.Sketch(points, width=0.02), front(64), surface=mesh, contours=False)
        ground = torch.linspace(0, 1, 64, dtype=torch.float64)
        return (drawn.alpha[0] * ground[:, None]).sum()

    (grad,) = torch.autograd.grad(loss(points), points)
    assert float(grad[1].abs().max()) == 0  # behind the front wall
    step = torch.zeros_like(points)
    step[0, :, 2] = 1e-5
    # Up and down, along edges of the box that hide it in the same places.
    with torch.no_grad():
        difference = (loss(points + step) - loss(points - step)) / 2e-5
    assert float(grad[0, :, 2].sum()) == pytest.approx(float(difference), rel=1e-3)


def test_strokes_of_several_segments_and_changing_widths_are_cut_as_they_are():
    circle = ds.bezier.circle((0.0, 3, 0), 2.5, normal=(0.0, 1, 0))
    chains = ds.Chains.of([len(circle[0])], closed=True)
    width = torch.tensor([[0.01, 0.02, 0.01]], dtype=torch.float64).expand(len(circle[0]), 3)
    ring = ds.Sketch(*circle, width=width, chains=chains)
    (lines,) = ds.visible_lines(ring, front(), ds.TriangleMesh(*box((-1, -1, -4), (1, 1, 4))), contours=False)
    seen, unseen = lines.strokes(True), lines.strokes(False)
    assert len(seen) == len(unseen) == 2
    total = sum(float(ds.bezier.length(s.points, s.weights).sum()) for s in (seen, unseen))
    assert total == pytest.approx(2 * np.pi * 2.5)
    assert seen.width.shape == seen.points.shape[:2]
    whole = ds.visible_lines(ring, front(), ds.TriangleMesh(*box((20, 0, 0), (21, 1, 1))), contours=False)[0]
    assert bool(whole.strokes(True).chains.closed.all())


def test_kinds_are_kept_and_chosen_by():
    sketch = ds.Sketch(torch.cat([BEHIND, BEHIND + 1]))
    (lines,) = ds.visible_lines(sketch, front(), ds.TriangleMesh(*icosphere(2)), kinds=["crease", "border"])
    assert lines.kinds[:2] == ("crease", "border")
    assert lines.kinds[2:] == ("contour",) * (len(lines.sketch) - 2)
    assert len(lines.strokes(True, "border")) + len(lines.strokes(False, "border")) >= 1
    assert float(lines.strokes(False, "crease").points[..., 2].max()) == pytest.approx(0.2)


def test_views_of_meshes_are_the_same_in_any_number_of_copies_of_the_process():
    mesh = ds.TriangleMesh(*torus(1.0, 0.4, 40, 20))
    ring = ds.Sketch(*ds.bezier.circle((0.0, 0.0, 0.2), 1.4))
    cameras = ds.orbit([0.0, 40.0, 80.0, 120.0], 30.0, 4.0, size=200)
    found = []
    for threads in (1, 2, 3):
        set_num_threads(threads)
        told: list[int] = []
        # A mesh of which nothing is known yet.
        views = ds.visible_lines(ring, cameras, mesh.with_crease(50.0), told=told.append)
        assert told == [1, 2, 3, 4]
        found.append([numbers(view) for view in views])
    alone = [numbers(*ds.visible_lines(ring, cameras[view], mesh)) for view in range(4)]
    assert found == [alone, alone, alone]
    # Where processes are not copied, other threads do not know of the caller's `no_grad` by themselves.
    points = torch.tensor(mesh.vertices, requires_grad=True)
    given = ds.TriangleMesh(points, mesh.faces)
    with torch.no_grad():
        assert not ds.contours(given, cameras)[0].points.requires_grad
    assert ds.contours(given, cameras)[0].points.requires_grad
    set_num_threads(None)


def numbers(lines: Lines) -> list[list[float]]:
    """All that a view found."""
    parts = lines.parts
    values = (lines.sketch.points.flatten(), parts.segment, parts.start, parts.stop, parts.visible)
    return [np.asarray(value).tolist() for value in values]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"surface": "ball.obj"}, "surface must be a TriangleMesh or Quadrics, got str"),
        ({"hidden": "gone"}, "hidden must be one of 'drop', 'faint', 'dashed', 'show', got 'gone'"),
    ],
)
@pytest.mark.usefixtures("unchecked")
def test_other_surfaces_and_ways_are_refused(arguments, message):
    given = {"surface": ds.TriangleMesh(*box())} | arguments
    with pytest.raises((TypeError, ValueError), match=message):
        ds.render(ds.Sketch(BEHIND), front(), **given)
    with pytest.raises((TypeError, ValueError), match=message):
        ds.draw(ds.Sketch(BEHIND), front(), **given)


@pytest.mark.usefixtures("unchecked")
def test_what_draw_takes():
    with pytest.raises(TypeError, match="draw takes a Sketch and Cameras, got Tensor and Cameras"):
        ds.draw(BEHIND, front(), ds.TriangleMesh(*box()))
    with pytest.raises(TypeError, match="surface must be a TriangleMesh or Quadrics, got NoneType"):
        ds.draw(ds.Sketch(BEHIND), front(), None)


def test_kinds_are_one_a_stroke():
    with pytest.raises(ValueError, match="kinds must be one a stroke, 1, got 2"):
        ds.visible_lines(ds.Sketch(BEHIND), front(), ds.TriangleMesh(*box()), kinds=["a", "b"])


def test_outlines_fitted_for_all_sides_give_way_to_those_of_the_view():
    """A ball with a ring around it, drawn for some other side, and a line that is there from everywhere."""
    ring, weights = ds.bezier.circle((0.0, 0.0, 0.0), 1.0, (1.0, 0.4, 0.2))
    line = torch.tensor([[[0.0, 0.0, 1.2], [0, 0, 1.4], [0, 0, 1.6], [0, 0, 1.8]]], dtype=torch.float64)
    fitted = ds.Sketch(ring, weights, chains=ds.Chains.of([len(ring)], True), kinds=["contour"])
    sketch = ds.Sketch.concatenate([fitted, ds.Sketch(line, kinds=["crease"])])
    ball, camera = ds.TriangleMesh(*icosphere(4)), ds.orbit(30.0, 20.0)
    [lines] = visible_lines(sketch, camera, ball)
    [alone] = visible_lines(sketch[1], camera, ball)
    assert lines.kinds == alone.kinds == ("crease", "contour")
    assert torch.equal(lines.drawn("drop").points, alone.drawn("drop").points)
    assert lines.layers("drop") == ["crease", "contour"]
    # Where the view has none of its own, these are what there is.
    [without] = visible_lines(sketch, camera, ball, contours=False)
    assert without.kinds == ("contour", "crease")
    found = without.origins("faint")
    assert [seen for _, seen in found] == [not kind.endswith("hidden") for kind in without.layers("faint")]
    assert {row for row, seen in found if not seen} == {0}
    assert lines.numbers == (1, -1)


@pytest.mark.parametrize("hidden", ["drop", "faint", "dashed", "show"])
def test_what_is_drawn_is_made_anew_of_the_sketch_each_time(hidden):
    points = BEHIND.clone().requires_grad_()
    (lines,) = visible_lines(ds.Sketch(points, width=0.02), front(), ds.TriangleMesh(*box()), contours=False)
    with torch.no_grad():
        lines.layers(hidden)
        lines.drawn(hidden)
    lines.drawn(hidden).points.sum().backward()
    once = points.grad.clone()
    assert float(once.abs().sum()) > 1
    lines.drawn(hidden).points.sum().backward()
    torch.testing.assert_close(points.grad, 2 * once)
