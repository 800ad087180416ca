"""Hatching against what was asked: its spacing, its tone, what hides it, and that a small turn leaves it in place."""

import functools

import numpy as np
import pytest
import torch
import trimesh
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds.bezier import evaluate
from diff3ds.page.picture import Picture
from diff3ds.surfaces.hatching.fans import Fans
from diff3ds.surfaces.hatching.hatch_ways import hatch_ways
from diff3ds.surfaces.hatching.tones import FULL, LIGHT, covered, darkest

SIZE = 320
NOTHING = ds.Sketch(torch.zeros(0, 4, 3, dtype=torch.float64))


def camera(azimuth: float = 30.0, elevation: float = 25.0) -> ds.Cameras:
    return ds.orbit([azimuth], [elevation], 3.2, fov=40.0, size=SIZE).to(torch.float64)


def mesh(found: trimesh.Trimesh) -> ds.TriangleMesh:
    return ds.TriangleMesh(found.vertices, found.faces)


# Once each: a mesh keeps what all of its views need to hatch it, which takes longer than most views.
@functools.cache
def ball(subdivisions: int = 3) -> ds.TriangleMesh:
    return mesh(trimesh.creation.icosphere(subdivisions))


@functools.cache
def plane() -> ds.TriangleMesh:
    return ds.TriangleMesh([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], [[0, 1, 2], [0, 2, 3]])


@functools.cache
def part() -> ds.TriangleMesh:
    """A round peg through a plate, as two pieces that go through each other."""
    plate, peg = trimesh.creation.box((1.8, 1.2, 0.3)), trimesh.creation.cylinder(0.4, 1.4, 48)
    return mesh(trimesh.util.concatenate([plate, peg]))


def hatching(surface: ds.TriangleMesh | ds.Quadrics, view: ds.Cameras, **how) -> ds.Sketch:
    (lines,) = ds.visible_lines(NOTHING, view, surface, contours=False, hatch=ds.Hatch(**how))
    return lines.strokes(True, "hatching")


def points_on(strokes: ds.Sketch, view: ds.Cameras) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points every half a pixel or less along strokes, their pixels, and the directions there in the picture."""
    picture = Picture.of(view, 0)
    hull = picture.seen(strokes.points.numpy())[0]
    count = int(np.linalg.norm(np.diff(hull, axis=1), axis=2).sum(1).max() * 2) + 2
    points = evaluate(strokes.points, strokes.weights, torch.linspace(0, 1, count, dtype=torch.float64)).numpy()
    pixels = picture.seen(points)[0]
    length = np.linalg.norm(np.diff(pixels, axis=1), axis=2).sum(1)
    # As many of each segment as it is long.
    step = np.maximum(count // np.maximum(length * 2, 1).astype(int), 1)
    kept = (np.arange(count) % step[:, None]) == 0
    way = np.gradient(pixels, axis=1)
    way /= np.linalg.norm(way, axis=2, keepdims=True).clip(1e-12)
    return points[kept], pixels[kept], way[kept]


@pytest.mark.parametrize("surface", [plane, ball, pytest.param(part, marks=pytest.mark.slow)])
def test_lines_are_as_far_apart_as_asked(surface):
    view, spacing = camera(), 5.0
    _, pixels, way = points_on(hatching(surface(), view, tones=1, spacing=spacing), view)
    tree = cKDTree(pixels)
    gaps = []
    for row in np.random.default_rng(0).choice(len(pixels), 400):
        near = pixels[tree.query_ball_point(pixels[row], 2 * spacing)] - pixels[row]
        across, along = np.abs(near @ [-way[row, 1], way[row, 0]]), near @ way[row]
        beside = across[(np.abs(along) < 0.6) & (across > 0.3 * spacing)]
        # At an edge of the surface there is a line on one side only, and behind it other lines.
        if len(beside):
            gaps.append(beside.min() / spacing)
    gaps = np.array(gaps)
    assert len(gaps) > 200
    assert abs(gaps.mean() - 1) < 0.15
    assert (np.abs(gaps - 1) < 0.15).mean() > 0.8


@pytest.mark.parametrize(
    ("tones", "stipple"),
    [
        (1, False),
        pytest.param(4, False, marks=pytest.mark.slow),
        (4, True),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in [(3, False), (1, True), (3, True)]),
    ],
)
def test_a_ball_is_as_dark_as_the_light_says(tones, stipple):
    view = camera()
    strokes = hatching(ball(4), view, tones=tones, spacing=4.0, stipple=stipple)
    drawn = 1 - ds.render(strokes, view).color[0, ..., 0].numpy()
    pose = view.world_to_camera[0].numpy()
    x, y = np.meshgrid(np.arange(SIZE) + 0.5, np.arange(SIZE) + 0.5)
    inverse = np.linalg.inv(view.intrinsics[0].numpy())
    rays = np.stack([x, y, np.ones_like(x)], -1) @ inverse.T
    rays /= np.linalg.norm(rays, axis=2, keepdims=True)
    # Where a ray meets the unit ball around the origin: in the camera's axes its middle is the shift of the pose.
    middle = pose[:3, 3]
    half = rays @ middle
    square = half**2 - middle @ middle + 1
    inside = square > 0
    normals = (half - np.sqrt(np.maximum(square, 0)))[..., None] * rays - middle
    asked = darkest(tones) * (1 - np.clip(normals @ LIGHT, 0, 1))
    weight = gaussian_filter(inside * 1.0, 6)
    got, want = (gaussian_filter(image * inside, 6) / weight.clip(1e-9) for image in (drawn, asked))
    assert want[inside].max() > 0.35
    assert np.abs(got - want)[inside].mean() < 0.02
    assert np.corrcoef(got[inside], want[inside])[0, 1] > 0.98


def test_lines_leave_no_gaps_where_they_turn():
    """On a knobbly ball, where directions of curvature change within a few faces and lines begin and end."""
    found, view, spacing = trimesh.creation.icosphere(4), camera(), 2.5
    x, y, z = found.vertices.T
    found.vertices *= 1 + 0.12 * (np.sin(6 * x) * np.sin(5 * y + 1) * np.cos(6 * z))[:, None]
    surface, picture = mesh(found), Picture.of(view, 0)
    corners = surface.vertices[surface.faces]
    points = corners.mean(1)
    light = LIGHT @ view.world_to_camera[0, :3, :3].numpy()
    towards = picture.towards(points)
    facing = (surface.face_normals * towards).sum(1) / np.linalg.norm(towards, axis=1)
    # Where there are lines of the first tone, away from outlines.
    dark = (facing > 0.5) & (surface.face_normals @ light < 0.6)
    dark[dark] = ~hidden_by_rays(points[dark], view.centers[0].numpy(), surface, 0.01)
    assert dark.sum() > 400
    _, drawn, _ = points_on(hatching(surface, view, tones=1, spacing=spacing), view)
    away = cKDTree(drawn).query(picture.seen(points[dark])[0])[0] / spacing
    # Between lines it is half a spacing.
    assert away.max() < 1
    assert (away < 0.6).mean() > 0.95


def test_dots_are_evenly_spread_and_half_a_spacing_wide():
    view, spacing = camera(), 6.0
    strokes = hatching(plane(), view, spacing=spacing, stipple=True)
    assert (strokes.width * SIZE - spacing / 2).abs().max() < 1e-9
    ends = Picture.of(view, 0).seen(strokes.points.numpy())[0]
    apart = cKDTree(ends.mean(1)).query(ends.mean(1), 2)[0][:, 1]
    assert len(apart) > 500
    # Of dots by chance some lie on each other; spread evenly, the nearest is not much nearer than most.
    assert np.quantile(apart, 0.01) > 0.8 * np.median(apart)
    # They are a fifth longer than wide, but for the perspective.
    assert np.linalg.norm(np.diff(ends, axis=1), axis=2).max() < 0.25 * spacing / 2


def test_a_plane_across_the_light_is_dark_and_one_towards_it_is_bare():
    view = camera()
    light = LIGHT @ view.world_to_camera[0, :3, :3].numpy()
    aside = np.cross(light, [0.3, 0.5, 0.8])
    aside /= np.linalg.norm(aside)
    other = np.cross(light, aside)
    corners = [-aside - other, aside - other, aside + other, other - aside]
    assert len(hatching(ds.TriangleMesh(corners, [[0, 1, 2], [0, 2, 3]]), view)) == 0


def test_an_open_surface_has_two_sides_and_a_closed_one_none_within():
    square = plane()
    above, below = camera(30.0, 40.0), camera(30.0, -40.0)
    assert len(hatching(square, above)) > 20
    assert len(hatching(square, below)) > 20
    # A ball seen from inside of it.
    inside = ds.look_at(torch.zeros(1, 3), (1.0, 0.0, 0.0), fov=60.0, size=SIZE).to(torch.float64)
    assert len(hatching(ball(), inside)) == 0


def hidden_by_rays(points: np.ndarray, eye: np.ndarray, surface: ds.TriangleMesh, margin: float) -> np.ndarray:
    """Whether rays from points to the eye meet a triangle farther away than a margin (Möller and Trumbore 1997)."""
    a, b, c = surface.vertices[surface.faces].transpose(1, 0, 2)
    one, other = b - a, c - a
    found = np.zeros(len(points), bool)
    for row, point in enumerate(points):
        way = (eye - point) / np.linalg.norm(eye - point)
        across = np.cross(way, other)
        area = (one * across).sum(1)
        area = np.where(np.abs(area) < 1e-12, np.inf, area)
        u = ((point - a) * across).sum(1) / area
        beside = np.cross(point - a, one)
        v = (way * beside).sum(1) / area
        far = (other * beside).sum(1) / area
        found[row] = ((u > 1e-6) & (v > 1e-6) & (u + v < 1 - 1e-6) & (far > margin) & np.isfinite(area)).any()
    return found


@pytest.mark.parametrize("stipple", [pytest.param(False, marks=pytest.mark.slow), True])
def test_no_line_runs_through_what_hides_it(stipple):
    view, surface = camera(), part()
    strokes = hatching(surface, view, spacing=5.0, stipple=stipple)
    points, _, _ = points_on(strokes, view)
    points = points[np.random.default_rng(1).choice(len(points), 700)]
    eye = view.centers[0].numpy()
    # Half a pixel, as strokes are fitted: 1/200 of the size.
    assert hidden_by_rays(points, eye, surface, 0.01).mean() < 0.002
    # And the test sees hidden lines: those of the plate go on under the peg.
    turned = np.array([0.1, 0.1, 0.149])
    assert hidden_by_rays(turned[None], eye, surface, 0.01).all()


@pytest.mark.parametrize(
    ("surface", "stipple", "share"),
    [
        pytest.param(part, False, 0.99, marks=pytest.mark.slow),
        (ball, False, 0.9),
        pytest.param(ball, True, 0.9, marks=pytest.mark.slow),
    ],
)
def test_a_small_turn_leaves_lines_where_they_are(surface, stipple, share):
    solid, views = surface(), [camera(30.0), camera(30.1)]
    drawn = [points_on(hatching(solid, view, tones=1, spacing=5.0, stipple=stipple), view) for view in views]
    moved = Picture.of(views[1], 0).seen(drawn[0][0])[0]
    away = cKDTree(drawn[1][1]).query(moved)[0]
    assert (away < 1).mean() > share
    assert np.median(away) < 0.3


def test_lines_go_around_a_cylinder_and_slant_on_its_ends():
    found = mesh(trimesh.creation.cylinder(0.5, 2.0, 48))
    fans = Fans.of(found)
    ways = hatch_ways(found, fans)
    side = np.abs(fans.normals[:, 2]) < 0.1
    assert np.abs(ways[side, 2]).max() < 0.05
    ends = ways[~side]
    assert np.abs(ends @ ends[0]).min() > 0.99


def test_coverages_of_all_tones_make_the_tone():
    tone = np.linspace(0, darkest(4), 101)
    lines, across, between, both = (covered(tone, number) for number in range(4))
    np.testing.assert_allclose(1 - (1 - lines - between) * (1 - across - both), tone, atol=1e-12)
    assert lines.max() == across.max() == FULL


def test_depth_hatches_what_is_near():
    view = camera(0.0, 30.0)
    _, pixels, _ = points_on(hatching(plane(), view, by="depth"), view)
    # The lower half of the plane's picture is its near half.
    middle = Picture.of(view, 0).seen(np.zeros(3))[0][1]
    low, high = (pixels[:, 1] > middle).sum(), (pixels[:, 1] < middle).sum()
    assert low > 2 * high


@pytest.mark.parametrize("stipple", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_picture_is_laid_over_what_is_seen(stipple):
    """A ramp from white at the left to black at the right, and black below the middle, on a square from above."""
    ramp = np.broadcast_to(1 - (np.arange(64) + 0.5) / 64, (64, 64)).copy()
    ramp[32:] = 0
    view = ds.orbit([0.0], [90.0], 4.0, fov=30.0, size=200).to(torch.float64)
    strokes = hatching(plane(), view, by=ramp, tones=4, spacing=4.0, stipple=stipple)
    got = gaussian_filter(1 - ds.render(strokes, view).color[0, ..., 0].numpy(), 6)
    corners = Picture.of(view, 0).seen(plane().vertices)[0]
    (left, top), (right, low) = corners.min(0), corners.max(0)
    for across, down in [(0.2, 0.25), (0.5, 0.25), (0.8, 0.25), (0.2, 0.75), (0.8, 0.75)]:
        place = round(top + down * (low - top)), round(left + across * (right - left))
        assert got[place] == pytest.approx(darkest(4) * (across if down < 0.5 else 1), abs=0.06)


@pytest.mark.slow
def test_solids_are_hatched_as_their_meshes():
    view = camera()
    for how in ({}, {"stipple": True}):
        exact = hatching(ds.Quadrics.ellipsoids([[0.0, 0, 0]], 1.0), view, tones=1, **how)
        close = hatching(ball(4), view, tones=1, **how)
        length = [len(points_on(strokes, view)[1]) for strokes in (exact, close)]
        assert abs(length[0] / length[1] - 1) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("stipple", [pytest.param(False, marks=pytest.mark.slow), True])
def test_hidden_parts_of_hatching_are_never_drawn(stipple):
    view, solid, how = camera(), part(), ds.Hatch("light", stipple=stipple)
    edges = ds.Sketch(torch.tensor([[[-2.0, 0, 0], [2, 0, 0]]], dtype=torch.float64), width=0.01, width_space="world")
    (lines,) = ds.visible_lines(edges, view, solid, hatch=how)
    shown, kept = lines.drawn("show"), lines.drawn("drop")
    assert len([k for k in lines.layers("show") if k == "hatching"]) == lines.layers("drop").count("hatching") > 20
    assert "hatching, hidden" not in lines.layers("faint")
    assert shown.width_space == kept.width_space == "world"
    # In both spaces lines are as wide on the page.
    (flat,) = ds.visible_lines(NOTHING, view, solid, hatch=how)
    pictures = [ds.render(found.strokes(True, "hatching"), view).color for found in (lines, flat)]
    assert (pictures[0] - pictures[1]).abs().mean() < 2e-3


def test_what_is_no_hatching_is_refused(unchecked):
    with pytest.raises(ValueError, match=r"'light' or 'depth', or by a picture of shape \(H, W\), got 'dark'"):
        ds.render(NOTHING, camera(), surface=plane(), hatch="dark")
    with pytest.raises(TypeError, match="hatch must be"):
        ds.render(NOTHING, camera(), surface=plane(), hatch=3)
    with pytest.raises(ValueError, match=r"shape \(H, W\) and values in \[0, 1\], got shape \(2, 2, 3\)"):
        ds.Hatch(np.zeros((2, 2, 3)))
    with pytest.raises(ValueError, match=r"values in \[0, 1\], got others"):
        ds.Hatch(np.full((2, 2), 255.0))
    with pytest.raises(ValueError, match="from 1 to 4, got 5"):
        ds.Hatch("light", 5)
    with pytest.raises(ValueError, match=r"at least 1 pixel, got 0\.5"):
        ds.Hatch("light", spacing=0.5)
