"""Runs on pages: the drawings of `diff3ds mesh` and the previews of every command, as other programs measure them."""

import numpy as np
import pytest
from needs import needs
from paper import png_page, svg_layer, svg_page
from scipy.spatial import ConvexHull

from diff3ds.cli import FAULT, main

pytestmark = needs("svgelements")
BOX = "\n".join(
    [
        *(f"v {x} {y} {z}" for x in (0, 3) for y in (0, 2) for z in (0, 1)),
        *(f"f {face}" for face in ("1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4")),
    ]
)


@pytest.fixture
def mesh(tmp_path):
    """Runs `diff3ds mesh` on a box."""
    (tmp_path / "box.obj").write_text(BOX)

    def ran(*more):
        main(["mesh", str(tmp_path / "box.obj"), "-o", str(tmp_path / "out"), "--quiet", "--turntable", "0", *more])
        return tmp_path / "out"

    return ran


def fills(measured, size, margin, near):
    """Whether the ink lies in the middle and reaches two opposite margins, and no farther."""
    page, box = measured
    assert page == pytest.approx(size, abs=near)
    free = np.array([*box[:2], *(np.array(page) - box[2:])])
    assert free == pytest.approx(np.roll(free, 2), abs=near)
    assert free.min() == pytest.approx(margin, abs=near)


def test_drawings_of_meshes_fill_their_pages(mesh):
    """Each view its own; a pixel of pictures is a tenth of a millimetre."""
    out = mesh("--azimuth", "30", "75", "--page", "A6", "--landscape", "--margin", "8")
    for view in (1, 2):
        fills(svg_page(out / f"drawing-{view}.svg"), (148, 105), 8, 0.011)
        fills(png_page(out / f"drawing-{view}.png"), (148, 105), 8, 0.15)
    assert svg_page(out / "sketch.svg")[0] == pytest.approx((148, 105), abs=0.01)
    assert png_page(out / "preview.png")[0] == pytest.approx((148, 105), abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "spacing"),
    [("A6", 4), pytest.param("A6", 2, marks=pytest.mark.slow), pytest.param("A4", 4, marks=pytest.mark.slow)],
)
def test_spacing_of_hatching_in_drawings_of_meshes_is_that_of_the_page(mesh, page, spacing):
    """Lines so far apart on paper are as long as the area that they fill over that, at any size of pictures."""
    how = ("--azimuth", "30", "--page", page, "--hatch", "light", "--tones", "1", "--spacing", f"{spacing}mm")
    out = mesh(*how, "--size", "64", "--centerline", "--layers", "kind")
    edges, _ = svg_layer(out / "drawing-1.svg", "layer-crease")
    _, length = svg_layer(out / "drawing-1.svg", "layer-hatching")
    assert ConvexHull(edges).volume / length == pytest.approx(spacing, rel=0.08)


def test_a_pen_of_a_width_draws_meshes_in_millimetres(mesh, capsys):
    """The outline of a box from above is a rectangle, which reaches the margins with half of the pen's width."""
    how = ("--elevation", "90", "--height", "4", "--azimuth", "0", "--page", "100x80", "--margin", "5")
    out = mesh(*how, "--centerline", "--pen-mm", "2", "--speed", "10")
    fills(measured := svg_page(out / "drawing-1.svg"), (100, 80), 5, 0.011)
    text = (out / "drawing-1.svg").read_text()
    assert 'stroke-width="20"' in text
    assert "<rect" not in text
    around = 2 * (np.diff(measured[1].reshape(2, 2), axis=0) - 2).sum()
    arguments = ["mesh", str(out.parent / "box.obj"), "-o", str(out), "--turntable", "0", "--overwrite"]
    main([*arguments, *how, "--centerline", "--pen-mm", "2", "--speed", "10"])
    assert f"lifted once: {around:.0f} mm drawn" in capsys.readouterr().err


def test_previews_lie_on_pages(tmp_path):
    """Four views on one page, whose margins are free."""
    how = ["--prior", "exemplar", "--steps", "2", "--page", "A6", "--margin", "6", "--quiet"]
    main(["text", "a bottle", "-o", str(tmp_path), *how])
    for (size, box), near in ((svg_page(tmp_path / "sketch.svg"), 0.01), (png_page(tmp_path / "preview.png"), 0.21)):
        assert size == pytest.approx((105, 148), abs=near)
        assert (box[:2] > 6 - near).all()
        assert (box[2:] < np.array([99, 142]) + near).all()
        assert max((box[2] - box[0]) / 93, (box[3] - box[1]) / 136) > 0.85


@pytest.mark.parametrize("command", ["text", "image", "views", "mesh", "points"])
@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--margin", "3"], "--margin is for pages: give a --page too"),
        (["--page", "B9"], "page must be A0"),
        (["--page", "A0"], "a page of 8410 x 11890 pixels, more than 67108864: give a lower --dpi"),
        (["--page", "A4", "--margin", "3m"], "margin must be a number of millimetres"),
    ],
)
def test_what_is_no_page_is_refused_by_every_command(tmp_path, capsys, command, options, said):
    given = ["a lamp"] if command == "text" else [str(tmp_path / "none.obj")]
    with pytest.raises(SystemExit) as ended:
        main([command, *given, "-o", str(tmp_path / "out"), *options])
    assert ended.value.code == FAULT
    assert said in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


def test_pens_without_paper_are_refused(mesh, capsys):
    for options in (["--pen-mm", "1"], ["--centerline", "--speed", "3"], ["--page", "A4", "--pen-mm", "1"]):
        with pytest.raises(SystemExit):
            mesh(*options)
        assert "is of a pen on paper: give --centerline and a --page" in " ".join(capsys.readouterr().err.split())
