"""Filled and stroked contours by exact areas: closed forms, finite differences, kernels against the reference."""

import math
from dataclasses import fields, replace

import pytest
import torch
from area_scenes import NO_CPU, VALUES, box, gradients, layers, rich_scene, whole
from other_device import NAME, OtherDevice

import diff3ds as ds
from diff3ds.render.areas import EVEN_ODD, LINEAR, NONZERO, STROKE, Layers, covered_pixels, draw_layers


class TestAreas:
    def test_a_box_covers_what_lies_in_each_pixel(self, backend):
        image = draw_layers(layers([[box(1.25, 2.5, 4.5, 3.75)]], [NONZERO]), 6, 5, backend=backend)
        expected = torch.zeros(5, 6, dtype=torch.float64)
        expected[2, 1:5] = torch.tensor([0.75, 1, 1, 0.5]) * 0.5
        expected[3, 1:5] = torch.tensor([0.75, 1, 1, 0.5]) * 0.75
        assert torch.allclose(image[..., 3], expected, atol=1e-7)

    def test_what_each_layer_covers_is_told_by_itself(self, backend):
        scene = layers([[box(1.25, 2.5, 4.5, 3.75)], [box(-9, -9, -5, -5)], [box(0, 0, 2, 1)]], [NONZERO] * 3)
        found = covered_pixels(scene, 6, 5, backend=backend)
        # Edges are sheared by less than a billionth of a pixel.
        first, none, last = ({k: v for k, v in zip(*map(list, each), strict=True) if v > 1e-6} for each in found)
        shares = [0.375, 0.5, 0.5, 0.25, 0.5625, 0.75, 0.75, 0.375]
        assert first == pytest.approx(dict(zip([13, 14, 15, 16, 19, 20, 21, 22], shares, strict=True)))
        assert none == {}
        assert last == pytest.approx({0: 1, 1: 1})

    def test_moving_an_edge_sweeps_its_length(self, backend):
        scene = layers([[box(1.25, 2.5, 4.5, 3.75)]], [NONZERO])
        points = scene.points.requires_grad_()
        draw_layers(scene, 6, 5, backend=backend)[..., 3].sum().backward()
        half = torch.tensor([1.25, 3.25], dtype=torch.float64) / 2
        sides = torch.tensor([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        assert torch.allclose(points.grad, sides * half, atol=1e-6)

    def test_an_edge_between_two_pixels_moves_one_of_them(self, backend):
        scene = layers([[box(1, 1, 3, 4)]], [NONZERO])
        points = scene.points.requires_grad_()
        draw_layers(scene, 6, 5, backend=backend)[..., 3].sum().backward()
        assert torch.allclose(
            points.grad, torch.tensor([[-1.5, -1], [1.5, -1], [1.5, 1], [-1.5, 1]]).double(), atol=1e-6
        )

    @pytest.mark.parametrize(("rule", "area"), [(NONZERO, 7 + 9 - 3.75), (EVEN_ODD, 7 + 9 - 7.5)])
    def test_what_overlaps_is_united_or_left_out(self, backend, rule, area):
        pair = [box(1, 1, 4.5, 3), box(2, 1.5, 5, 4.5)]
        assert draw_layers(layers([pair], [rule]), 8, 8, backend=backend)[..., 3].sum() == pytest.approx(area)

    def test_an_edge_that_two_share_is_a_seam_between_layers_only(self, backend):
        """Within a layer the area is that of the union; of two opaque layers coverages count as independent."""
        pair = [box(0, 0, 2.5, 4), box(2.5, 0, 5, 4)]
        together, apart = layers([pair], [NONZERO]), layers([[each] for each in pair], [NONZERO] * 2)
        beneath = layers([[box(0, 0, 4, 4)], pair[1:]], [NONZERO] * 2)
        seams = [float(draw_layers(s, 5, 4, backend=backend)[1, 2, 3]) for s in (together, apart, beneath)]
        assert seams == pytest.approx([1, 0.75, 1])

    def test_boxes_wound_against_each_other_cancel_where_they_overlap(self, backend):
        turned = box(2, 1.5, 5, 4.5)[0][::-1], [0, 0, 0, 0], True
        image = draw_layers(layers([[box(1, 1, 4.5, 3), turned]], [NONZERO]), 8, 8, backend=backend)
        assert image[..., 3].sum() == pytest.approx(7 + 9 - 7.5)

    def test_a_stroke_has_the_area_of_its_tube(self, backend):
        line = layers([[([[5.0, 6], [15, 9]], [0], False)]], [STROKE], 2.0)
        area = draw_layers(line, 20, 16, backend=backend)[..., 3].sum()
        assert area == pytest.approx(4 * math.hypot(10, 3) + 4 * math.pi, rel=2e-3)

    def test_a_stroke_grows_by_its_border(self, backend):
        line = layers([[([[5.0, 6], [15, 9]], [0], False)]], [STROKE], 2.0)
        widths = line.half_widths.requires_grad_()
        draw_layers(line, 20, 16, backend=backend)[..., 3].sum().backward()
        assert widths.grad.sum() == pytest.approx(2 * math.hypot(10, 3) + 4 * math.pi, rel=3e-3)

    @pytest.mark.parametrize("points", [[[8.0, 8]], [[8.0, 8]] * 4])
    def test_a_stroke_of_one_place_is_a_disc(self, backend, points):
        dot = layers([[(points, [2] if len(points) == 4 else [], False)]], [STROKE], 3.0)
        assert draw_layers(dot, 16, 16, backend=backend)[..., 3].sum() == pytest.approx(9 * math.pi, rel=5e-3)

    def test_a_hairpin_is_covered_once_and_wholly(self, backend):
        """Both legs of a bend tighter than the stroke is wide: its inner side has no hole."""
        bend = [[2.0, 8], [14, 8], [14, 8.5], [2, 8.5]], [2], False
        image = draw_layers(layers([[bend]], [STROKE], 2.0), 16, 16, backend=backend)
        assert image[7:9, 2:11, 3].min() > 1 - 1e-6
        assert image[..., 3].max() <= 1

    @pytest.mark.parametrize("half_width", [0.0, -1.0])
    def test_no_width_draws_nothing(self, backend, half_width):
        curve = [[5.0, 5], [20, 2], [28, 20], [10, 28]], [2], False
        assert not draw_layers(layers([[curve]], [STROKE], half_width), 32, 32, backend=backend).any()

    def test_no_layers_leave_the_background(self, backend):
        background = torch.rand(4, 5, 4, dtype=torch.float64)
        empty = layers([], [])
        empty = replace(empty, points=torch.zeros(0, 2, dtype=torch.float64), colors=torch.zeros(0, 4).double())
        empty = replace(
            empty, contours=torch.zeros(0, 5, dtype=torch.int32), layers=torch.zeros(0, 5, dtype=torch.int32)
        )
        empty = replace(empty, paints=torch.zeros(0, 4, dtype=torch.int32))
        assert torch.allclose(draw_layers(empty, 5, 4, background, backend=backend), background)
        assert not draw_layers(empty, 5, 4, backend=backend).any()

    def test_translucent_layers_are_straight_colours(self, backend):
        """One over the other: colours by weight, divided by alpha, times what is covered."""
        colors = [[1, 0, 0, 0.5], [0, 0, 1, 0.25]]
        scene = layers([[box(0, 0, 4, 4)], [box(2, 0, 4, 4)]], [NONZERO] * 2, colors=colors)
        image = draw_layers(scene, 4, 4, backend=backend)
        assert torch.allclose(image[0, 0], torch.tensor([1, 0, 0, 0.5], dtype=torch.float64))
        alpha = 0.5 * 0.75 + 0.25
        expected = torch.tensor([0.375 / alpha, 0, 0.25 / alpha, alpha], dtype=torch.float64)
        assert torch.allclose(image[0, 3], expected)

    def test_a_gradient_runs_from_stop_to_stop(self, backend):
        scene = layers([[box(0, 0, 10, 2)]], [NONZERO])
        scene = replace(
            scene,
            paints=whole([[LINEAR, 0, 2, 0]]),
            axes=torch.tensor([[2.0, 0, 8, 0]]).double(),
            offsets=torch.tensor([0.0, 1]).double(),
            colors=torch.tensor([[0.0, 0, 0, 1], [1, 1, 1, 1]]).double(),
        )
        along = (torch.arange(10).double() + 0.5 - 2) / 6
        assert torch.allclose(draw_layers(scene, 10, 2, backend=backend)[0, :, 0], along.clamp(0, 1))

    @pytest.mark.parametrize("name", VALUES)
    def test_gradients_are_finite_differences(self, backend, name):
        scene, step = rich_scene(), 1e-5
        value = getattr(scene, name)
        found = gradients(scene, (32, 32), backend=backend)[1][name]
        upstream = torch.randn((32, 32, 4), generator=torch.Generator().manual_seed(0), dtype=torch.float64)
        chosen = torch.randperm(value.numel(), generator=torch.Generator().manual_seed(1))[:8]
        for k in chosen.tolist():
            moved = []
            for sign in (1, -1):
                changed = value.clone()
                changed.view(-1)[k] += sign * step
                moved.append((draw_layers(replace(scene, **{name: changed}), 32, 32) * upstream).sum())
            expected = float(moved[0] - moved[1]) / (2 * step)
            # Arcs of joints turn with the direction in front of them only.
            assert float(found.view(-1)[k]) == pytest.approx(expected, rel=2e-3, abs=2e-3 * float(found.abs().max()))

    def test_single_precision_draws_the_same(self, backend):
        image, found = gradients(rich_scene(torch.float32), (32, 32), backend=backend)
        expected_image, expected = gradients(rich_scene(), (32, 32), backend=backend)
        assert image.dtype == torch.float32
        assert torch.allclose(image.double(), expected_image, atol=1e-5)
        for name in ("points", "transforms"):
            assert torch.allclose(found[name].double(), expected[name], atol=1e-4 * float(expected[name].abs().max()))


class TestKernels:
    @pytest.mark.parametrize("with_background", [False, True])
    def test_they_draw_and_differentiate_as_the_reference_does(self, kernels, with_background):
        scene = rich_scene()
        background = (
            torch.rand(30, 32, 4, generator=torch.Generator().manual_seed(5)).double() if with_background else None
        )
        image, found = gradients(scene, (32, 30), background=background, backend=kernels)
        expected_image, expected = gradients(scene, (32, 30), background=background, backend="reference")
        # On the inner side of its tight bend the two cut the same tube in different pieces.
        assert torch.allclose(image, expected_image, atol=5e-4)
        for name, value in expected.items():
            assert torch.allclose(found[name], value, atol=1e-3 * (1 + float(value.abs().max()))), name

    @pytest.mark.parametrize("seed", [pytest.param(k, marks=[pytest.mark.slow] * (k > 3)) for k in range(12)])
    def test_contours_by_chance(self, kernels, seed):
        """Loops, cusps and corners of all kinds of segments, in both rules and stroked, some far outside."""
        g = torch.Generator().manual_seed(seed)
        groups, rules = [], []
        for _ in range(3):
            degrees = torch.randint(0, 3, (3,), generator=g).tolist()
            closed = bool(torch.randint(0, 2, (1,), generator=g))
            points = torch.rand(sum(degrees) + 3 + (not closed), 2, generator=g) * 34 - 5
            groups.append([(points.tolist(), degrees, closed)])
            rules.append(int(torch.randint(0, 3, (1,), generator=g)))
        colors = torch.rand(3, 4, generator=g).tolist()
        scene = layers(groups, rules, 0.3 + 2 * float(torch.rand(1, generator=g)), colors)
        (image, found), (expected_image, expected) = (
            gradients(scene, (24, 24), backend=b) for b in (kernels, "reference")
        )
        # On the inner side of tight bends the two cut the same tube in different pieces.
        assert float((image - expected_image).abs().max()) < 3e-3
        assert float((found["points"] - expected["points"]).abs().max()) < 0.02 * float(expected["points"].abs().max())

    @NO_CPU
    def test_layers_on_another_device_are_drawn_on_the_cpu(self):
        expected_image, expected = gradients(rich_scene(torch.float32), (16, 16))
        with OtherDevice():
            scene = rich_scene(torch.float32)
            there = Layers(*(getattr(scene, field.name).to(NAME) for field in fields(scene)))
            image, found = gradients(there, (16, 16))
            assert image.device.type == found["points"].device.type == NAME
            assert torch.equal(image.to("cpu"), expected_image)
            assert torch.equal(found["points"].to("cpu"), expected["points"])

    @pytest.mark.slow
    @NO_CPU
    def test_the_number_of_threads_changes_no_bit(self):
        results = []
        try:
            for count in (1, 3):
                ds.set_num_threads(count)
                results.append(gradients(rich_scene(torch.float32), (32, 32)))
        finally:
            ds.set_num_threads(None)
        assert torch.equal(results[0][0], results[1][0])
        assert all(torch.equal(results[0][1][name], results[1][1][name]) for name in VALUES)

    def test_second_derivatives_are_refused(self):
        scene = rich_scene()
        points = scene.points.requires_grad_()
        (first,) = torch.autograd.grad(draw_layers(scene, 16, 16).square().sum(), points, create_graph=True)
        with pytest.raises(RuntimeError, match="once_differentiable"):
            first.sum().backward()


@pytest.mark.usefixtures("unchecked")
class TestBadInput:
    @pytest.mark.parametrize(
        ("field", "value", "match"),
        [
            ("points", torch.full((4, 2), math.nan), "points must be finite"),
            ("points", torch.full((4, 2), 1e12), "must stay within 1e"),
            ("colors", torch.zeros(1, 3), r"colors must have shape \(n, 4\)"),
            ("contours", whole([[0, 5, 0, 4, 1]]), "contours points to what is not there"),
            ("contours", whole([[0, 3, 0, 4, 1]]), "4 segments, which take 4 points, and 3"),
            ("layers", whole([[0, 1, 3, 0, 0]]), "rule of a layer must be 0 to 2"),
            ("layers", whole([[0, 1, 0, 1, 0]]), "transform of a layer"),
            ("paints", whole([[0, 0, 2, 0]]), "paints points to what is not there"),
            ("inner", torch.zeros(4), "inner must be int32"),
        ],
    )
    def test_tables_that_do_not_fit_are_refused(self, field, value, match):
        value = value.double() if value.is_floating_point() and field != "inner" else value
        scene = replace(layers([[box(1, 1, 3, 3)]], [NONZERO]), **{field: value})
        with pytest.raises((TypeError, ValueError), match=match):
            draw_layers(scene, 8, 8)

    def test_what_are_no_layers_is_refused(self):
        with pytest.raises(TypeError, match="layers must be Layers, the tables of what is painted, got NoneType"):
            draw_layers(None, 8, 8)

    def test_a_picture_without_pixels_is_refused(self):
        with pytest.raises(ValueError, match="a picture has one pixel or more, got 0 x 8"):
            draw_layers(layers([[box(1, 1, 3, 3)]], [NONZERO]), 0, 8)

    @pytest.mark.parametrize(
        ("background", "match"),
        [
            (torch.zeros(8, 9, 4).double(), r"background must have shape \(8, 8, 4\), got \(8, 9, 4\)"),
            (torch.zeros(8, 8, 4), "background must have the dtype of points"),
            (torch.zeros(8, 8, 4, device="meta").double(), "background must be where points are, on cpu, got meta"),
        ],
    )
    def test_a_background_that_does_not_fit_is_refused(self, backend, background, match):
        with pytest.raises((TypeError, ValueError), match=match):
            draw_layers(layers([[box(1, 1, 3, 3)]], [NONZERO]), 8, 8, background, backend=backend)
