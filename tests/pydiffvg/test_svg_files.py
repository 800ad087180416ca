"""SVG files read as shapes and groups, and written so that they read back to the same scene."""

import math
import xml.etree.ElementTree as ET

import pytest
import torch

import diff3ds.pydiffvg as pydiffvg

SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="64" height="48">{}</svg>'
BLACK = [0.0, 0.0, 0.0, 1.0]


@pytest.fixture
def scene(tmp_path):
    def read(body, whole=False):
        path = tmp_path / "drawing.svg"
        path.write_text(body if whole else SVG.format(body))
        return pydiffvg.svg_to_scene(str(path))

    return read


def drawn(width, height, shapes, groups):
    arguments = pydiffvg.RenderFunction.serialize_scene(width, height, shapes, groups)
    return pydiffvg.RenderFunction.apply(width, height, 2, 2, 0, None, *arguments)


def test_a_path_of_all_commands(scene):
    body = (
        '<path id="p" d="M2 2h8v8l-4 4q-4 0-4-4t2-4 c1 1 2 2 3 2s2 0 2 2M20,20 30,20 30,30Z" stroke="red" fill="none"/>'
    )
    width, height, shapes, (group,) = scene(body)
    assert (width, height) == (64, 48)
    first, second = shapes
    assert first.num_control_points.tolist() == [0, 0, 0, 1, 1, 2, 2]
    assert first.points.tolist()[:6] == [[2, 2], [10, 2], [10, 10], [6, 14], [2, 14], [2, 10]]
    # The control point of t is that of q on the other side.
    assert first.points.tolist()[6:8] == [[2, 6], [4, 6]]
    assert not first.is_closed
    assert second.is_closed
    assert second.points.tolist() == [[20, 20], [30, 20], [30, 30]]
    assert group.shape_ids.tolist() == [0, 1]
    assert group.fill_color is None
    assert group.stroke_color.tolist() == [1, 0, 0, 1]
    assert (group.id, first.id, second.id) == ("p", "p-0", "p-1")
    assert float(first.stroke_width) == 0.5


@pytest.mark.parametrize(
    ("data", "area"),
    [
        ("M10 20a8 8 0 0 1 16 0Z", math.pi * 32),
        ("M10 20a8 8 0 1 1 16 0a8 8 0 1 1-16 0", math.pi * 64),
        ("M10 20A4 4 0 0 0 26 20Z", math.pi * 32),
        # Three quarters of a circle with its chord, and the quarter that it leaves.
        ("M18 12A8 8 0 1 0 26 20Z", math.pi * 48 + 32),
        ("M18 12A8 8 0 0 1 26 20Z", math.pi * 16 - 32),
        ("M10 20a10 5 30 0 0 10 10L10 20", None),
    ],
)
def test_arcs(scene, data, area):
    _, _, shapes, groups = scene(f'<path d="{data}"/>')
    points = shapes[0].points
    if area is None:
        assert points[-1].tolist() == pytest.approx([20, 30])
        return
    assert shapes[0].is_closed
    assert float(drawn(64, 48, shapes, groups)[..., 3].sum()) == pytest.approx(area, rel=5e-3)


def test_shapes_that_are_no_paths(scene):
    body = (
        '<rect x="1" y="2" width="4" height="6"/><circle cx="9" cy="8" r="3"/><ellipse cx="9" cy="8" rx="3" ry="2"/>'
        '<polygon points="1,2 3 4,5-6"/><polyline points="1 2 3 4 5 6"/><line x1="1" x2="2" y2="3"/>'
        '<rect width="20" height="10" rx="2"/>'
    )
    _, _, shapes, groups = scene(body)
    rect, circle, ellipse, polygon, polyline, line, rounded = shapes
    assert (rect.p_min.tolist(), rect.p_max.tolist()) == ([1, 2], [5, 8])
    assert (circle.radius.item(), circle.center.tolist()) == (3, [9, 8])
    assert (ellipse.radius.tolist(), ellipse.center.tolist()) == ([3, 2], [9, 8])
    assert (polygon.points.tolist(), polygon.is_closed) == ([[1, 2], [3, 4], [5, -6]], True)
    assert (polyline.points.tolist(), polyline.is_closed) == ([[1, 2], [3, 4], [5, 6]], False)
    assert (line.points.tolist(), line.is_closed) == ([[1, 0], [2, 3]], False)
    assert rounded.num_control_points.tolist() == [0, 2] * 4
    assert [each.fill_color.tolist() for each in groups] == [BLACK] * 7


COLOURS = {
    'fill="#f00"': [1, 0, 0, 1],
    'fill="#ff000080"': [1, 0, 0, 128 / 255],
    'fill="rgb(0, 51,255)"': [0, 0.2, 1, 1],
    'fill="rgba(0,51,255,.5)"': [0, 0.2, 1, 0.5],
    'fill="rgb(0% 20% 100% / 50%)"': [0, 0.2, 1, 0.5],
    'fill="hsl(240, 100%, 50%)"': [0, 0, 1, 1],
    'fill="DarkGreen"': [0, 100 / 255, 0, 1],
    'style="fill:currentColor;color:blue"': [0, 0, 1, 1],
    'fill="red" style="fill: lime; fill-opacity:.5"': [0, 1, 0, 0.5],
    'fill="red" opacity=".5" fill-opacity="50%"': [1, 0, 0, 0.25],
    'class="a b"': [0, 0, 1, 0.5],
    'id="named" class="a"': [1, 1, 1, 0.5],
    "": [1, 1, 0, 0.5],
}


@pytest.mark.parametrize("attributes", COLOURS)
def test_colours(scene, attributes):
    sheet = "<style>/* x */ rect {fill: yellow; opacity: .5} .a{fill:blue} #named {fill:white}</style>"
    styled = any(word in attributes for word in ("class", "id")) or not attributes
    _, _, _, (group,) = scene((sheet if styled else "") + f'<rect width="4" height="4" {attributes}/>')
    assert group.fill_color.tolist() == pytest.approx(COLOURS[attributes])


def test_groups_hand_down(scene):
    body = (
        '<g transform="translate(10,20) scale(2)" fill="none" stroke="blue" stroke-width="3" opacity=".5">'
        '<g transform="rotate(90)"><path d="M1 2L3 4"/><path d="M1 2L3 4" transform="scale(2 1)"/></g>'
        '<circle r="2" stroke-opacity=".5" display="none"/><circle r="2" visibility="hidden"/><circle r="0"/></g>'
    )
    _, _, (first, second), (one, two) = scene(body)
    # Only turned and scaled: in the points, with the width.
    torch.testing.assert_close(first.points, torch.tensor([[6.0, 22.0], [2.0, 26.0]]))
    assert first.stroke_width.item() == pytest.approx(3)
    assert torch.equal(one.shape_to_canvas, torch.eye(3))
    # Stretched: the stroke is stretched too.
    assert second.points.tolist() == [[1, 2], [3, 4]]
    assert second.stroke_width.item() == 1.5
    torch.testing.assert_close(
        two.shape_to_canvas, torch.tensor([[0.0, -2.0, 10.0], [4.0, 0.0, 20.0], [0.0, 0.0, 1.0]])
    )
    assert one.stroke_color.tolist() == [0, 0, 1, 0.5]
    assert one.fill_color is None


def test_clones_view_boxes_and_units(scene):
    whole = (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:x="http://www.w3.org/1999/xlink"'
        ' viewBox="-10 -20 200 100" width="9in">'
        '<defs><rect id="r" width="1in" height="10%"/><symbol id="s" viewBox="0 0 2 2"><circle r="1"/></symbol></defs>'
        '<use x:href="#r" x="5" fill="red"/><use href="#s" width="20" height="10" x="1"/></svg>'
    )
    width, height, (rect, circle), (first, second) = scene(whole, whole=True)
    assert (width, height) == (200, 100)
    assert rect.p_max.tolist() == [96, 10]
    torch.testing.assert_close(first.shape_to_canvas, torch.tensor([[1.0, 0, 15], [0, 1, 20], [0, 0, 1]]))
    assert first.fill_color.tolist() == [1, 0, 0, 1]
    torch.testing.assert_close(second.shape_to_canvas, torch.tensor([[5.0, 0, 16], [0, 5, 20], [0, 0, 1]]))
    assert circle.radius.item() == 1


def test_gradients(scene):
    body = (
        '<linearGradient id="a"><stop offset="0" stop-color="red"/><stop offset="1" style="stop-color:#00f;'
        'stop-opacity:.5"/>'
        '</linearGradient><linearGradient id="b" href="#a" gradientUnits="userSpaceOnUse" x1="1" x2="5" y2="4"'
        ' gradientTransform="scale(2 1)"/><radialGradient id="c" href="#a" cx=".25" r="50%"/>'
        '<rect x="10" y="20" width="20" height="10" fill="url(#a)" fill-opacity=".5"/>'
        '<rect width="20" height="10" fill="url(#b)" transform="translate(3)"/>'
        '<rect x="10" y="20" width="20" height="10" fill="url(#c)" stroke="url(#none) green"/>'
    )
    with pytest.warns(UserWarning, match="left out are paints that are no gradients"):
        _, _, _, (one, two, three) = scene(body)
    linear = one.fill_color
    assert (linear.begin.tolist(), linear.end.tolist()) == ([10, 20], [30, 20])
    assert linear.stop_colors.tolist() == [[1, 0, 0, 0.5], [0, 0, 1, 0.25]]
    # By its definition: the share along the axis of the point that the transform came from.
    linear = two.fill_color
    for x, y in ((4.0, 1.0), (7.5, -3.0), (20.0, 9.0)):
        u, v = (x - 3) / 2, y
        expected = ((u - 1) * 4 + v * 4) / 32
        step = linear.end - linear.begin
        assert float((torch.tensor([x, y]) - linear.begin) @ step / (step @ step)) == pytest.approx(expected, abs=1e-6)
    assert three.fill_color.center.tolist() == [15, 25]
    assert three.fill_color.radius.tolist() == pytest.approx([10, 5])
    assert three.stroke_color.tolist() == pytest.approx([0, 128 / 255, 0, 1])


def test_what_is_left_out_is_said(scene):
    body = (
        '<text>a</text><image/><g clip-path="url(#a)"><path d="M0 0L9 9" stroke="red" stroke-dasharray="2 1"/></g>'
        '<style>g > path {fill: red}</style><path d="M0 0L9 9L9 0" fill="chartreux"/>'
    )
    with pytest.warns(
        UserWarning, match="left out are clip-path, image elements, paints such as 'chartreux', stroke-dash"
    ):
        _, _, shapes, _ = scene(body)
    assert len(shapes) == 1


def test_illustrators_entities_are_read(scene):
    whole = (
        '<!DOCTYPE svg PUBLIC "a" "http://example.org/a.dtd" [<!ENTITY ns "http://www.w3.org/2000/svg">]>'
        '<svg xmlns="&ns;" viewBox="0 0 9 9"><path d="M0 0L9 9L9 0"/></svg>'
    )
    assert len(scene(whole, whole=True)[2]) == 1


BOMB = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 9}">' for k in range(1, 9))
FAULTS = {
    "<svg": "not an SVG file",
    "<html/>": "it begins with the element 'html'",
    '<svg xmlns="http://www.w3.org/2000/svg"><rect width="4" height="4"/></svg>': "it says no size",
    SVG.format('<path d="M0 0L"/>'): "a number of 'L' lacks",
    SVG.format('<path d="M0 0Lnan 1"/>'): "cannot read path data",
    SVG.format('<path d="M0 0L1e7 1"/>'): "at most 1e",
    SVG.format('<circle r="4q"/>'): "expected a length, got '4q'",
    SVG.format('<path d="M0 0L1 1" transform="spin(3)"/>'): "cannot read the transform",
    SVG.format('<g id="a"><use href="#b"/></g><g id="b"><use href="#a"/></g>'): "128 deep",
    f'<!DOCTYPE svg [<!ENTITY a0 "lol">{BOMB}]><svg>&a8;</svg>': "declares the entity 'a1'",
    '<!DOCTYPE svg [<!ENTITY a SYSTEM "file:///etc/passwd">]><svg>&a;</svg>': "declares the entity 'a'",
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 0 9"/>': "a viewBox has a corner and a positive size",
}


@pytest.mark.parametrize("content", FAULTS, ids=list(FAULTS.values()))
def test_broken_and_hostile_files(scene, content):
    with pytest.raises(ValueError, match=FAULTS[content].replace("(", r"\(")) as caught:
        scene(content, whole=True)
    assert "drawing.svg: " in str(caught.value)


def test_clones_of_clones_are_bounded(scene, monkeypatch):
    monkeypatch.setattr("diff3ds.svg.drawing.MAX_CLONED", 100)
    body = "<g id='a0'><rect width='1' height='1'/></g>"
    for k in range(1, 9):
        body += f"<g id='a{k}'>" + f"<use href='#a{k - 1}'/>" * 10 + "</g>"
    with pytest.raises(ValueError, match="its clones draw more than"):
        scene(body)


def random_scene(seed):
    g = torch.Generator().manual_seed(seed)

    def rand(*size):
        return torch.rand(*size, generator=g)

    shapes = [
        pydiffvg.Path(torch.tensor([0, 1, 2]), 40 * rand(6, 2), True, 1 + rand(()), id="closed"),
        pydiffvg.Path(torch.tensor([2, 0, 1]), 40 * rand(7, 2), False, 1 + rand(())),
        pydiffvg.Path(torch.tensor([2]), 40 * rand(4, 2), False, 1 + rand(())),
        pydiffvg.Circle(5 + 9 * rand(()), 40 * rand(2), 1 + rand(())),
        pydiffvg.Ellipse(5 + 9 * rand(2), 40 * rand(2), 1 + rand(())),
        pydiffvg.Rect(20 * rand(2), 20 + 20 * rand(2), 1 + rand(())),
        pydiffvg.Polygon(40 * rand(5, 2), True, 1 + rand(())),
        pydiffvg.Polygon(40 * rand(5, 2), False, 1 + rand(())),
    ]
    stops = {"offsets": torch.tensor([0.1, 0.4, 0.9]), "stop_colors": rand(3, 4)}
    linear = pydiffvg.LinearGradient(40 * rand(2), 40 * rand(2), **stops)
    radial = pydiffvg.RadialGradient(40 * rand(2), 9 + 20 * rand(2), **stops)
    skewed = torch.eye(3)
    skewed[:2] += 0.3 * rand(2, 3)
    return shapes, [
        pydiffvg.ShapeGroup(torch.tensor([0]), rand(4), id="mine", stroke_color=rand(4)),
        pydiffvg.ShapeGroup(torch.tensor([1]), None, stroke_color=rand(4), shape_to_canvas=skewed),
        pydiffvg.ShapeGroup(torch.tensor([2, 2]), linear, stroke_color=radial, shape_to_canvas=skewed),
        pydiffvg.ShapeGroup(torch.tensor([3]), radial, stroke_color=linear),
        pydiffvg.ShapeGroup(torch.tensor([4]), rand(4), stroke_color=linear),
        pydiffvg.ShapeGroup(torch.tensor([5]), linear, shape_to_canvas=skewed),
        pydiffvg.ShapeGroup(torch.tensor([6]), rand(4), use_even_odd_rule=False, stroke_color=rand(4)),
        pydiffvg.ShapeGroup(torch.tensor([7, 3, 5, 4, 0]), rand(4), shape_to_canvas=skewed),
    ]


@pytest.mark.parametrize("group", range(8))
def test_what_is_written_reads_back_to_the_same_scene(tmp_path, group):
    shapes, groups = random_scene(group)
    pydiffvg.save_svg(tmp_path / "a" / "out.svg", 48, 40, shapes, groups[group : group + 1])
    width, height, again, groups_again = pydiffvg.svg_to_scene(tmp_path / "a" / "out.svg")
    assert (width, height) == (48, 40)
    (one,) = groups_again
    assert one.use_even_odd_rule == groups[group].use_even_odd_rule
    if group == 0:
        assert one.id == "mine"
        torch.testing.assert_close(again[0].points, shapes[0].points)
        torch.testing.assert_close(one.fill_color, groups[0].fill_color)
    expected = drawn(48, 40, shapes, groups[group : group + 1])
    torch.testing.assert_close(drawn(width, height, again, groups_again), expected, atol=2e-3, rtol=0)


def test_fillings_are_written_over_their_strokes(tmp_path):
    """As DiffVG paints them; SVG paints strokes last unless told otherwise."""
    circle, colors = pydiffvg.Circle(torch.tensor(9.0), torch.tensor([20.0, 20.0])), torch.rand(2, 4)
    for fill, expected in ((colors[0], "stroke"), (None, None)):
        group = pydiffvg.ShapeGroup(torch.tensor([0]), fill, stroke_color=colors[1])
        pydiffvg.save_svg(tmp_path / "out.svg", 40, 40, [circle], [group])
        (element,) = ET.parse(tmp_path / "out.svg").iter("{http://www.w3.org/2000/svg}circle")
        assert element.get("paint-order") == expected


def test_widths_that_svg_does_not_know(tmp_path):
    shapes = [pydiffvg.Polygon(torch.rand(3, 2) * 40, False, torch.tensor([1.0, 2.0, 3.0]))]
    shapes.append(pydiffvg.Circle(torch.tensor(9.0), torch.tensor([20.0, 20.0])))
    black, red = torch.tensor(BLACK), torch.tensor([1.0, 0.0, 0.0, 1.0])
    group = pydiffvg.ShapeGroup(torch.tensor([0, 1]), red, stroke_color=black)
    with pytest.warns(UserWarning, match="one width a stroke: the mean"):
        pydiffvg.save_svg(tmp_path / "out.svg", 48, 40, shapes, [group])
    _, _, again, groups = pydiffvg.svg_to_scene(tmp_path / "out.svg")
    assert [each.stroke_color is None for each in groups] == [False, False, True]
    assert [float(each.stroke_width) for each in again[:2]] == [2, 1]


def test_path_data_as_paths():
    first, second = pydiffvg.from_svg_path("M0 0L4 0L4 4M9 9L5 5Z", 2 * torch.eye(3))
    assert first.points.tolist() == [[0, 0], [8, 0], [8, 8]]
    assert (first.is_closed, second.is_closed) == (False, True)
    (closed,) = pydiffvg.from_svg_path("M0 0L4 0L4 4", force_close=True)
    assert (closed.is_closed, closed.num_control_points.tolist()) == (True, [0, 0, 0])


def test_a_missing_file_is_told_with_what_to_give(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.svg is not there: give a drawing"):
        pydiffvg.svg_to_scene(str(tmp_path / "none.svg"))
