"""What vpype makes of files for plotters: it finds nothing to mend, and hardly anything to join or to sort better."""

import re

import numpy as np
import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.formats import save_svg
from diff3ds.library import member
from diff3ds.page.sheet.page_setup import PageSetup

pytestmark = needs("vpype", "vpype_cli", "shapely")
PEN = 0.4
PAGE = PageSetup.of("A5", margin=12)
CAMERA = ds.orbit(35.0, 25.0, 3.0, size=400)
# Kinds of the library as wires, and one in colours, a pen for each.
KINDS = ("teapot", "bicycle", "castle", "tractor", "umbrella", "spider", "windmill", "dinosaur", "church")
QUICK = ("teapot", "castle")
DRAWINGS = [
    *QUICK,
    *(pytest.param(name, marks=pytest.mark.slow) for name in (*KINDS, "hatched ball") if name not in QUICK),
]


def drawn(name):
    generator = torch.Generator().manual_seed(3)
    if name == "hatched ball":
        ball = ds.Quadrics.ellipsoids([[0.0, 0, 0]], 1.0)
        (lines,) = ds.visible_lines(member("teapot", generator).sketch[:0], CAMERA, ball, hatch=ds.Hatch(spacing=20.0))
        return lines.drawn("drop").to(torch.float32)
    sketch = member(name, generator).sketch
    if name == "castle":
        sketch = sketch.replace(color=torch.eye(3)[torch.arange(len(sketch)) % 3])
    return sketch


def lines_of(document):
    """Of each pen its lines, in mm of a page whose origin is the upper left corner."""
    mm = 25.4 / 96
    return [[np.stack([line.real, line.imag], 1) * mm for line in layer] for layer in document.layers.values()]


def travelled(pens):
    """How many paths there are, and how far pens go in the air from one to the next, mm."""
    ways = [np.linalg.norm(a[0] - b[-1]) for some in pens for a, b in zip(some[1:], some[:-1], strict=True)]
    return sum(map(len, pens)), float(sum(ways))


@pytest.mark.parametrize("name", DRAWINGS)
def test_vpype_has_little_to_do(tmp_path, name):
    import vpype
    from shapely import LineString, STRtree
    from vpype_cli import execute

    told = save_svg(tmp_path / "a.svg", drawn(name), CAMERA, page=PAGE, centerline=True, pen_mm=PEN)
    # Each layer is a pen's, also where names of colours have digits.
    document = vpype.read_multilayer_svg(str(tmp_path / "a.svg"), 0.1)
    assert document.page_size == pytest.approx((148 * 96 / 25.4, 210 * 96 / 25.4), rel=1e-4)
    pens = lines_of(document)
    assert len(pens) == (3 if name == "castle" else 1)
    points = np.concatenate([line for some in pens for line in some])
    # Nothing is off the page, and no frame goes around it: the ink, half a pen wider, touches two margins alone.
    low, high = points.min(0) - PEN / 2, np.array([148, 210]) - points.max(0) - PEN / 2
    assert np.sort([*low, *high])[:2] == pytest.approx([12, 12], abs=0.05)
    # What lies on other lines of its pen, but for crossings, as long as these are wide at 15 degrees.
    for some in pens:
        shapes = [LineString(line) for line in some]
        tree = STRtree(shapes)
        for number, shape in enumerate(shapes):
            for other in set(tree.query(shape).tolist()) - {number}:
                along = shape.intersection(shapes[other].buffer(PEN / 8, cap_style="flat"))
                runs = [part.length for part in getattr(along, "geoms", [along])]
                assert max(runs, default=0) < 12 * PEN, (number, other)
    count, moved = travelled(pens)
    assert (count, moved) == (told.lifts, pytest.approx(told.moved, abs=0.05))
    # Without its reloop, which begins loops by chance.
    better = execute(f"linemerge -t {PEN}mm linesort --two-opt", document)
    fewer, shorter = travelled(lines_of(better))
    assert count <= 1.1 * fewer
    assert moved <= 1.1 * shorter


@pytest.mark.parametrize("alike", [True, False])
def test_several_views_have_one_layer_a_pen(tmp_path, alike):
    """Views were the outermost groups: vpype made a layer of each, with all colours in it."""
    import vpype

    red, green, blue = torch.eye(3)
    sketch = member("castle", torch.Generator().manual_seed(3)).sketch
    colors = torch.stack([red, green])[torch.arange(len(sketch)) % 2]
    first = sketch.replace(color=colors)
    # The second view may have a pen more, which comes first there.
    second = first if alike else first.replace(color=torch.cat([blue[None], colors[1:]]))
    cameras = ds.orbit(torch.tensor([35.0, 125.0]), 25.0, 3.0, size=400)
    told = save_svg(tmp_path / "a.svg", [first, second], cameras, page=PAGE, centerline=True, pen_mm=PEN)
    document = vpype.read_multilayer_svg(str(tmp_path / "a.svg"), 0.1)
    wanted = ["1 #ff0000", "2 #00ff00"] + ([] if alike else ["3 #0000ff"])
    assert list(document.layers) == list(range(1, len(wanted) + 1))
    assert [layer.metadata["vp_name"] for layer in document.layers.values()] == wanted
    pens = lines_of(document)
    # Both views lie side by side in the layers of both.
    for some in pens[:2]:
        across = np.concatenate(some)[:, 0]
        assert across.min() < 70
        assert across.max() > 78
    assert travelled(pens) == (told.lifts, pytest.approx(told.moved, abs=0.05))
    assert apply_finds(tmp_path / "a.svg") == {"view-0", "view-1"}


def apply_finds(file):
    """Which views' paths have ids that lead back to strokes."""
    return {known.split("-stroke")[0] for known in re.findall(r'id="(view-\d-strokes?-[0-9-]+)', file.read_text())}
