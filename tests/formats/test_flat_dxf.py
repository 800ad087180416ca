"""Views as flat DXF files, as ezdxf reads them: millimetres on the page, exact curves, hidden lines on their layer."""

import numpy as np
import pytest
import torch
from needs import needs

import diff3ds as ds
from diff3ds.cli import main

pytestmark = needs("ezdxf")
# Before the half of what is seen along x.
WALL = "v 0.5 0 -2\nv 0.5 2 -2\nv 0.5 2 2\nv 0.5 0 2\nf 1 2 3 4\n"


@pytest.fixture
def source(tmp_path):
    """A circle and a stroke along y in the plane x = 0, and one upwards from its middle."""
    ring, weights = ds.bezier.circle((0.0, 0.0, 0.0), 1.0, (1.0, 0.0, 0.0))
    ring = ds.Sketch(ring, weights, chains=ds.Chains.of([len(ring)], True), color=torch.tensor([1.0, 0, 0]).double())
    lines = torch.tensor([[[0.0, -1, 0], [0, 1, 0]], [[0.0, 0, 0], [0, 0, 0.5]]], dtype=torch.float64)
    ds.save(tmp_path / "a.json", ds.Sketch.concatenate([ring, ds.Sketch(lines)]))
    return tmp_path / "a.json"


def entities(source, *options):
    import ezdxf
    import ezdxf.bbox

    file = source.with_name("a.dxf")
    main(["render", str(source), "-o", str(file), "--quiet", "--elevation", "0", *map(str, options)])
    document = ezdxf.readfile(file)
    box = ezdxf.bbox.extents(document.modelspace(), fast=False)
    return document, list(document.modelspace()), np.array([box.extmin, box.extmax])


def test_a_view_is_flat_and_in_millimetres(source):
    """Seen along x, 2 units fill 80 mm: the circle is one, with its normal up, in the middle of the page."""
    document, found, box = entities(source, "--azimuth", 0, "--height", 4, "--page", "100x200", "--margin", "1cm")
    (circle,) = [entity for entity in found if entity.dxftype() == "CIRCLE"]
    assert (*circle.dxf.center, circle.dxf.radius) == pytest.approx((50, 100, 0, 40), abs=1e-6)
    assert tuple(circle.dxf.extrusion) == (0, 0, 1)
    assert (circle.dxf.layer, document.header["$INSUNITS"]) == ("COLOR_FF0000", 4)
    up = [entity.dxf.end for entity in found if entity.dxftype() == "LINE"][-1]
    assert tuple(up) == pytest.approx((50, 120, 0), abs=1e-6)
    assert box == pytest.approx(np.array([[10, 60, 0], [90, 140, 0]]), abs=0.01)
    assert np.array([document.header["$EXTMIN"], document.header["$EXTMAX"]]) == pytest.approx(box, abs=0.01)


def test_curves_stay_exact_in_perspective(source):
    """A circle seen aslant is one ellipse, no spline, and where it touches the border of the page it is not cut."""
    for azimuth in (10, 30, 40, 60):
        _, found, box = entities(source, "--azimuth", azimuth, "--page", "A6")
        assert sorted(entity.dxftype() for entity in found) == ["ELLIPSE", "LINE", "LINE"], azimuth
        assert min(*box[0, :2], 105 - box[1, 0], 148 - box[1, 1]) == pytest.approx(10, abs=0.01)


def test_hidden_lines_have_a_layer(source, tmp_path):
    (tmp_path / "wall.obj").write_text(WALL)
    view = ("--azimuth", 30, "--surface", tmp_path / "wall.obj", "--hidden", "show", "--no-contours")
    _, found, _ = entities(source, *view[:-2], "faint", "--no-contours")
    assert {entity.dxf.layer for entity in found} == {"hidden", "visible"}
    _, found, _ = entities(source, *view[:-2], "drop", "--no-contours")
    assert {entity.dxf.layer for entity in found} == {"visible"}


def test_old_cutters_get_polylines(source):
    document, found, box = entities(source, "--azimuth", 0, "--height", 4, "--dxf-version", "R12", "--page", "A5")
    assert document.dxfversion == "AC1009"
    assert {entity.dxftype() for entity in found} == {"POLYLINE"}
    assert (box[0, 0], box[1, 0]) == pytest.approx((10, 138), abs=0.02)


def test_what_a_flat_file_has_not_is_refused(source, capsys):
    for options, said in (
        (["--style", "ink"], "a .dxf file has lines alone"),
        (["--centerline"], "--centerline is for .svg, .pdf, .hpgl and .plt files"),
    ):
        with pytest.raises(SystemExit):
            entities(source, *options)
        assert said in " ".join(capsys.readouterr().err.split())
    assert not source.with_name("a.dxf").exists()
