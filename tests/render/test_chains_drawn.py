"""Strokes of several segments and widths along them: pictures with known answers and gradients, on all backends."""

import functools
import itertools
import math

import numpy as np
import pytest
import torch
from oracles import cell_centers
from scenes import SAMPLES
from scipy.spatial import cKDTree

from diff3ds import Analytic, Cameras, Chains, MonteCarlo, Sketch, Strokes2D, bezier, orbit, rasterize, render
from diff3ds.bezier.curves import elevate_homogeneous
from diff3ds.render import available_backends

CAMERAS = orbit([30.0, 80.0], [20.0, 50.0], 3.0, size=40)
FLAT = orbit([30.0, 80.0], [20.0, 50.0], 3.0, height=3.0, size=40)
SIZE = (32, 40)


def ring(segments: int) -> Sketch:
    """A translucent circle of so many segments."""
    if segments == 2:
        # A half circle is a rational cubic whose inner weights are a third.
        half = torch.tensor([[1.0, 0, 0], [1, 2, 0], [-1, 2, 0], [-1, 0, 0]], dtype=torch.float64)
        points, weights = torch.stack([half, -half]), torch.tensor([[3.0, 1, 1, 3]] * 2, dtype=torch.float64)
    else:
        angles = [360 * k / segments for k in range(segments + 1)]
        arcs = [bezier.circle((0.0, 0.0, 0.0), 1.0, start=a, stop=b) for a, b in itertools.pairwise(angles)]
        points, weights = (torch.cat(column) for column in zip(*arcs, strict=True))
    return Sketch(
        points, weights, width=0.08, opacity=0.5, color=(0.8, 0.2, 0.1), chains=Chains.of([len(points)], True)
    )


def flat(points, half_width, *, chains=None, opacity=0.5, closed=False) -> Strokes2D:
    """One stroke of segments on the screen, (M, K, 2) in pixels at depth 1; half widths (M, 4), or a number."""
    points = torch.as_tensor(points, dtype=torch.float64)
    ones = torch.ones_like(points[..., :1])
    cubics = elevate_homogeneous(torch.cat([points, ones, ones], -1))[None]
    half = torch.as_tensor(half_width, dtype=torch.float64)
    half = half.reshape(1, 1) if half.ndim == 0 else half[None]
    chains = chains or Chains.of([len(points)], closed)
    count = len(chains)
    color, alpha = torch.zeros(count, 3, dtype=torch.float64), torch.full((count,), opacity, dtype=torch.float64)
    return Strokes2D(cubics, half, color, alpha, chains=chains)


def polygon(corners: np.ndarray, closed: bool = True) -> torch.Tensor:
    ends = np.stack([corners, np.roll(corners, -1, 0)], 1)
    return torch.as_tensor(ends if closed else ends[:-1])


def distance_to(corners: np.ndarray, query: np.ndarray) -> np.ndarray:
    """To a closed polygon."""
    best = np.full(query.shape[:-1], np.inf)
    for a, b in zip(corners, np.roll(corners, -1, 0), strict=True):
        s = np.clip(((query - a) @ (b - a)) / ((b - a) @ (b - a)), 0, 1)
        best = np.minimum(best, np.linalg.norm(query - a - s[..., None] * (b - a), axis=-1))
    return best


def star() -> np.ndarray:
    """Twelve corners, sharp and blunt, turning both ways."""
    angle = np.arange(12) * math.pi / 6
    radius = np.where(np.arange(12) % 2, 7.0, 12.5)
    return np.stack([20 + 1.2 * radius * np.cos(angle), 16 + radius * np.sin(angle)], 1)


@functools.cache
def share_of_star() -> np.ndarray:
    """Of each pixel, what lies within 2 px of its outline, by cells; once for all backends."""
    return (distance_to(star(), cell_centers(SIZE)) < 2.0).mean(1).reshape(SIZE)


# Known pictures


def test_circles_of_any_number_of_segments_are_the_same_picture(backend):
    pictures = [render(ring(count), CAMERAS, backend=backend) for count in (2, 4, 5, 8)]
    for other in pictures[1:]:
        assert (other.color - pictures[0].color).abs().max() < 1e-6
        assert (other.depth - pictures[0].depth).abs().max() < 1e-4
    assert pictures[0].alpha.max() == pytest.approx(0.5, abs=1e-6)


@pytest.mark.parametrize("closed", [True, False])
def test_a_polyline_covers_by_the_distance_to_all_its_segments(backend, closed):
    corners = star()
    strokes = flat(polygon(corners, closed), 2.0, closed=closed)
    alpha = rasterize(strokes, SIZE, backend=backend).alpha[0].numpy()
    centers = cell_centers(SIZE, 1)[:, 0].reshape(*SIZE, 2)
    if closed:
        expected = 0.5 * np.clip(2.5 - distance_to(corners, centers), 0, 1)
        assert np.abs(alpha - expected).max() < 1e-6
        # Against areas: the pixel is no disc, which is .09 of both edges at 45 degrees, and edges bend at corners.
        assert np.abs(alpha - 0.5 * share_of_star()).max() < 0.13
    # Nowhere is a joint darker than the line.
    assert alpha.max() == pytest.approx(0.5, abs=1e-6)


def test_samples_see_the_same_polyline(backend):
    generator = torch.Generator().manual_seed(0)
    how = MonteCarlo(samples=SAMPLES[backend], generator=generator)
    strokes = flat(polygon(star()), 2.0, closed=True)
    alpha = rasterize(strokes, SIZE, antialiasing=how, backend=backend).alpha[0].numpy()
    assert abs(alpha.mean() - 0.5 * share_of_star().mean()) < 2e-3
    assert alpha.max() == 0.5


def test_a_tapered_line_is_a_trapezoid(backend):
    half = [[1.0, 2.0, 3.0, 4.0]]
    strokes = flat([[[6.0, 16.0], [34.0, 16.0]]], half, opacity=1.0)
    alpha = rasterize(strokes, SIZE, backend=backend).alpha[0].numpy()
    query = cell_centers(SIZE)
    inside = np.abs(query[..., 1] - 16) < 1 + 3 * (query[..., 0] - 6) / 28
    body = (cell_centers(SIZE, 1)[:, 0, 0] > 7) & (cell_centers(SIZE, 1)[:, 0, 0] < 33)
    difference = np.abs(alpha.ravel() - inside.mean(1))[body]
    # Edges that slope by .107 are crossed at their vertical distance: 1 / cos of that, .6 %, and the corners of pixels.
    assert difference.max() < 0.02
    # The cap is half a disc.
    assert alpha[16, 36] == pytest.approx(1.0)
    assert alpha[16, 38] < 1e-6


def test_widths_may_be_zero_at_the_end(backend):
    strokes = flat([[[4.0, 16.0], [36.0, 16.0]]], [[3.0, 2.0, 1.0, 0.0]], opacity=1.0)
    alpha = rasterize(strokes, SIZE, backend=backend).alpha[0]
    assert alpha.isfinite().all()
    assert alpha[16, 4] == pytest.approx(1.0, abs=1e-5)
    assert alpha[16, 37] < 1e-6
    assert (alpha[:, 6:36].sum(0).diff() < 0).all()


@pytest.mark.parametrize("space", ["image", "world"])
@pytest.mark.parametrize("along", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_stroke_split_anywhere_draws_the_same(backend, space, along):
    g = torch.Generator().manual_seed(4)
    points = 0.7 * torch.randn(1, 4, 3, generator=g, dtype=torch.float64)
    weights = torch.tensor([[1.0, 2.0, 0.5, 1.5]], dtype=torch.float64)
    width = torch.tensor([[0.05, 0.2, 0.02, 0.1]], dtype=torch.float64)
    whole = Sketch(points, weights, width if along else 0.1, opacity=0.6, width_space=space)
    expected = render(whole, CAMERAS, backend=backend)
    for t in (0.123, 0.5, 0.9):
        # The width is a polynomial in the segment's parameter, which a cut of the homogeneous cubic leaves as it is.
        parts = bezier.split(points, weights, t)
        widths = [w[..., 0] for w, _ in bezier.split(width[..., None], None, t)]
        split_points, split_weights = (torch.cat(column) for column in zip(*parts, strict=True))
        chain = Sketch(
            split_points, split_weights, torch.cat(widths) if along else 0.1, opacity=0.6, width_space=space,
            chains=Chains.of([2]),
        )  # fmt: skip
        drawn = render(chain, CAMERAS, backend=backend)
        assert (drawn.color - expected.color).abs().max() < 1e-5, t
        assert (drawn.depth - expected.depth).abs().max() < 1e-4, t


def test_a_chain_through_the_plane_of_the_camera(backend):
    """Three segments, of which the middle one lies behind it: what is seen of the others, with caps where it is cut."""
    nodes = torch.tensor([[0.0, -0.3, 0.0], [2.5, -0.3, 0.1], [2.5, 0.3, 0.1], [0.0, 0.3, 0.0]]).double()
    points = torch.stack([nodes[:-1], nodes[1:]], 1)
    chain = Sketch(points, width=0.1, opacity=0.5, width_space="world", chains=Chains.of([3]))
    apart = Sketch(points[[0, 2]], width=0.1, opacity=0.5, width_space="world")
    cameras = orbit(0, 0, 2.0, size=40)
    one, two = (render(s, cameras, backend=backend) for s in (chain, apart))
    assert one.alpha.max() > 0.4
    assert (one.alpha - two.alpha).abs().max() < 1e-5
    expected = render(chain, cameras, backend="reference")
    assert (one.alpha - expected.alpha).abs().max() < 1e-5


def test_two_chains_lie_over_each_other_in_depth(backend):
    """The order of strokes is that of depth at each point, whatever their segments."""
    near, far = ring(4), ring(2).transform(torch.diag(torch.tensor([1.5, 1.5, 1.5, 1.0])).double())
    both = Sketch.concatenate([far, near.elevate()])
    opaque = Sketch(both.points, both.weights, 0.2, torch.eye(3)[:2].double(), 1.0, chains=both.chains)
    image = render(opaque, CAMERAS, backend=backend)
    expected = render(opaque, CAMERAS, backend="reference")
    assert (image.color - expected.color).abs().max() < 1e-5


def test_a_stroke_of_five_thousand_segments():
    if "cpu" not in available_backends():
        pytest.skip("without kernels this takes minutes")
    angle = torch.linspace(0, 40 * math.pi, 5001, dtype=torch.float64)
    radius = 5 + 90 * torch.linspace(0, 1, 5001, dtype=torch.float64)
    nodes = 100 + torch.stack([radius * angle.cos(), radius * angle.sin()], -1)
    spiral = flat(torch.stack([nodes[:-1], nodes[1:]], 1), 1.0, opacity=0.5)
    spiral.cubics.requires_grad_()
    alpha = rasterize(spiral, (200, 200), backend="cpu").alpha[0]
    query, ends = cell_centers((200, 200), 1)[:, 0], nodes.numpy()
    nearest = cKDTree(ends).query(query)[1]
    found = np.full(len(query), np.inf)
    for first in (np.maximum(nearest - 1, 0), np.minimum(nearest, 4999)):
        a, along = ends[first], ends[first + 1] - ends[first]
        s = np.clip(((query - a) * along).sum(1) / (along * along).sum(1), 0, 1)
        found = np.minimum(found, np.linalg.norm(query - a - s[:, None] * along, axis=1))
    expected = 0.5 * np.clip(1.5 - found, 0, 1) - 0.5 * np.clip(-0.5 - found, 0, 1)
    assert np.abs(alpha.detach().numpy().ravel() - expected).max() < 1e-4
    alpha.sum().backward()
    assert spiral.cubics.grad.isfinite().all()
    # Some of the shortest segments, near the middle, are nearest to no pixel with an edge.
    assert (spiral.cubics.grad[0, :, :, :2].abs().amax((1, 2)) > 0).double().mean() > 0.85


# Gradients


def leaves(space: str, along: bool, dtype: torch.dtype = torch.float64) -> tuple[dict, Chains]:
    """Values with gradients of an open stroke of four cubics and a closed one of two; and their chains."""
    g = torch.Generator().manual_seed(1)
    chains = Chains.of([4, 2], [False, True])

    def value(*shape: int, low: float, high: float) -> torch.Tensor:
        drawn = low + (high - low) * torch.rand(*shape, generator=g, dtype=torch.float64)
        return drawn.to(dtype).requires_grad_()

    points = (0.6 * torch.randn(6, 4, 3, generator=g, dtype=torch.float64)).to(dtype).requires_grad_()
    width = value(6, 4, low=0.01, high=0.12) if along else value(2, low=0.04, high=0.1)
    given = {"points": points, "weights": value(6, 4, low=0.5, high=2.0), "width": width}
    return given | {"color": value(2, 3, low=0, high=1), "opacity": value(2, low=0.5, high=0.9)}, chains


def sketch_of(values: dict, chains: Chains, space: str) -> Sketch:
    joined = {"points": chains.joined(values["points"])}
    if values["width"].ndim == 2:
        joined["width"] = chains.joined(values["width"])
    return Sketch(**(values | joined), width_space=space, chains=chains)


def loss_of(image, seed: int = 9) -> torch.Tensor:
    g = torch.Generator().manual_seed(seed)
    weights = [torch.rand(x.shape, generator=g, dtype=torch.float64) for x in (image.color, image.alpha, image.depth)]
    seen = (image.alpha > 0.01).detach()
    total = (image.color.double() * weights[0]).sum() + (image.alpha.double() * weights[1]).sum()
    return total + (image.depth.double() * seen * weights[2]).sum()


# Of each kind the others have one.
CASES_ALIKE = [("image", True, CAMERAS), ("world", False, CAMERAS), ("world", True, FLAT)]


@pytest.mark.parametrize(
    ("space", "along", "cameras"),
    [
        ("image", False, CAMERAS),
        ("world", True, CAMERAS),
        *(pytest.param(*case, marks=pytest.mark.slow) for case in CASES_ALIKE),
    ],
)
def test_kernels_agree_with_the_reference(kernels, space, along, cameras):
    results = {}
    for name, dtype in (("reference", torch.float64), (kernels, torch.float32), (kernels, torch.float64)):
        values, chains = leaves(space, along, dtype)
        image = render(sketch_of(values, chains, space), cameras, backend=name)
        gradients = torch.autograd.grad(loss_of(image), list(values.values()))
        results[name, dtype] = image, gradients
    image, gradients = results["reference", torch.float64]
    for dtype in (torch.float32, torch.float64):
        got, got_gradients = results[kernels, dtype]
        assert (got.color.double() - image.color).abs().max() < 1e-5
        for name, a, b in zip(values, got_gradients, gradients, strict=True):
            assert (a.double() - b).norm() < 1e-3 * b.norm(), name
            assert torch.cosine_similarity(a.double().flatten(), b.flatten(), dim=0) > 0.99999, name


@pytest.mark.parametrize("space", ["world", pytest.param("image", marks=pytest.mark.slow)])
def test_gradients_are_differences(space):
    """Of the reference in float64, along a random direction of each kind of value."""
    values, chains = leaves(space, along=True)
    cameras = orbit(40, 20, 3, size=16)

    def loss(given: dict) -> torch.Tensor:
        image = render(sketch_of(given, chains, space), cameras, antialiasing=Analytic(1.0), backend="reference")
        g = torch.Generator().manual_seed(3)
        return (image.color * torch.rand(image.color.shape, generator=g, dtype=torch.float64)).sum()

    gradients = dict(zip(values, torch.autograd.grad(loss(values), list(values.values())), strict=True))
    g = torch.Generator().manual_seed(5)
    step = 1e-5
    for name in values:
        direction = torch.randn(values[name].shape, generator=g, dtype=torch.float64)
        with torch.no_grad():
            ends = [loss(values | {name: values[name].detach() + sign * step * direction}) for sign in (1, -1)]
        measured = float(ends[0] - ends[1]) / (2 * step)
        assert float((gradients[name] * direction).sum()) == pytest.approx(measured, rel=2e-4), name


def open_and_closed(space: str, along: bool) -> tuple[dict, Chains]:
    """An open zigzag and a closed triangle of bowed segments, apart from each other."""

    def bowed(nodes: list, bow: float) -> list[torch.Tensor]:
        segments = []
        for a, b in itertools.pairwise(torch.tensor(nodes, dtype=torch.float64)):
            across = torch.tensor([b[1] - a[1], a[0] - b[0], 0.3], dtype=torch.float64)
            segments.append(torch.stack([a, a + (b - a) / 3 + bow * across, a + 2 * (b - a) / 3 + bow * across, b]))
            bow = -bow
        return segments

    corner = [0.0, -0.7, 0.0]
    zigzag = [[-1.0, -0.9, -0.2], [-0.6, -0.3, 0.2], [-0.8, 0.3, 0.0], [-0.3, 0.9, 0.3]]
    points = torch.stack(bowed(zigzag, 0.2) + bowed([corner, [0.9, -0.5, 0.3], [0.3, 0.5, -0.3], corner], 0.15))
    wide = 0.1 if space == "world" else 0.05
    g = torch.Generator().manual_seed(2)
    width = wide * (1 + torch.rand(6, 4, generator=g, dtype=torch.float64))
    weights = torch.linspace(0.8, 1.4, 24, dtype=torch.float64).reshape(6, 4)
    values = {"points": points, "weights": weights, "width": width if along else 1.5 * width[:2, 0]}
    values = {name: value.requires_grad_() for name, value in values.items()}
    appearance = {"color": torch.zeros(2, 3).double(), "opacity": torch.tensor([0.6, 0.9]).double()}
    return values | appearance, Chains.of([3, 3], [False, True])


@pytest.mark.skipif("cpu" not in available_backends(), reason="without kernels this takes minutes")
@pytest.mark.parametrize("space", ["image", "world"])
@pytest.mark.parametrize("along", [False, True])
def test_outline_samples_have_the_gradient_of_areas(space, along):
    """The boundary term over joints, caps and slopes: against the analytic mode in pixels that are tiny."""

    def gradients(size: int, how) -> list[torch.Tensor]:
        place = (torch.arange(size, dtype=torch.float64) + 0.5) / size
        smooth = (3 * place).sin() * (2 * place).cos()[:, None] / size**2
        values, chains = open_and_closed(space, along)
        image = render(sketch_of(values, chains, space), orbit(0, 10, 2.5, size=size), antialiasing=how, backend="cpu")
        return torch.autograd.grad((image.alpha * smooth).sum(), [values[k] for k in ("points", "weights", "width")])

    exact = gradients(1024, Analytic(blur=1.0))
    runs = [gradients(64, MonteCarlo(64, torch.Generator().manual_seed(k))) for k in range(12)]
    for k, expected in enumerate(exact):
        sampled = torch.stack([run[k] for run in runs]).mean(0)
        assert torch.cosine_similarity(expected.flatten(), sampled.flatten(), dim=0) > 0.999, k
        assert float(sampled.norm()) == pytest.approx(float(expected.norm()), rel=0.02), k


@functools.cache
def sampled_gradients(backend: str, space: str) -> dict[str, torch.Tensor]:
    """Sums over four draws of samples."""
    values, chains = leaves(space, along=True)
    total = [torch.zeros_like(v) for v in values.values()]
    for seed in range(4):
        how = MonteCarlo(4, torch.Generator().manual_seed(seed))
        image = render(sketch_of(values, chains, space), CAMERAS[:1], antialiasing=how, backend=backend)
        part = torch.autograd.grad(image.alpha.sum() + image.color[..., 1].sum(), list(values.values()))
        total = [a + b for a, b in zip(total, part, strict=True)]
    return dict(zip(values, total, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("space", ["world", pytest.param("image", marks=pytest.mark.slow)])
def test_sampled_gradients_agree_between_kernels_and_reference(kernels, space):
    """The same samples inside; points on outlines are others, so that only their sums are alike."""
    results = sampled_gradients("reference", space), sampled_gradients.__wrapped__(kernels, space)
    for name in ("points", "width"):
        a, b = (r[name].flatten() for r in results)
        assert torch.cosine_similarity(a, b, dim=0) > 0.95, name
    for name in ("color", "opacity"):
        a, b = (r[name].flatten() for r in results)
        assert torch.allclose(a, b, rtol=1e-5), name


def test_gradients_of_cameras_flow_through_chains(kernels):
    found = []
    for name in ("reference", kernels):
        values, chains = leaves("image", along=True)
        pose = CAMERAS.world_to_camera.double().requires_grad_()
        cameras = Cameras(pose, CAMERAS.intrinsics, CAMERAS.size)
        image = render(sketch_of(values, chains, "image"), cameras, backend=name)
        found.append(torch.autograd.grad(loss_of(image), pose)[0])
    assert torch.allclose(*found, rtol=1e-3, atol=1e-3 * float(found[0].abs().max()))


# Errors


def test_projected_strokes_are_checked_with_their_chains():
    strokes = flat(polygon(star()), 2.0, closed=True)
    fields = {k: getattr(strokes, k) for k in ("cubics", "half_width", "color", "opacity")}
    with pytest.raises(ValueError, match="chains must be of the 12 segments of cubics"):
        rasterize(Strokes2D(**fields, chains=Chains.of([5, 6])), SIZE)
    bad = Strokes2D(**(fields | {"half_width": torch.full((1, 12, 4), -1.0).double()}), chains=strokes.chains)
    with pytest.raises(ValueError, match=r"half_width of segment 0 \(view 0\) must be finite and not negative"):
        rasterize(bad, SIZE)
