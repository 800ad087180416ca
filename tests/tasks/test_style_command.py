"""`--style` of `diff3ds render` and `diff3ds export`."""

from pathlib import Path

import numpy as np
import pytest
import torch
from ink import ink_apart
from needs import needs
from paper import pdf_pages, png_page, svg_page
from PIL import Image

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.tasks.style_options import StyleOptions

pytestmark = needs("pathops", "resvg_py")

POINTS = torch.tensor([[[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]], [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]]])


@pytest.fixture
def source(tmp_path):
    ds.save(tmp_path / "sketch.json", ds.Sketch(POINTS, width=0.02))
    return str(tmp_path / "sketch.json")


def opened(file):
    with Image.open(file) as picture:
        return np.asarray(picture)


def test_svg_png_sheets_and_turntables(source, tmp_path):
    common = ["--style", "charcoal", "--size", "64", "--quiet"]
    main(["render", source, "-o", str(tmp_path / "a.svg"), *common])
    text = (tmp_path / "a.svg").read_text()
    assert 'id="stroke-0"' in text
    main(["render", source, "-o", str(tmp_path / "a.png"), *common])
    picture = opened(tmp_path / "a.png")
    assert picture.shape == (64, 64, 3)
    assert 0.5 < (picture == 255).mean() < 0.99
    main(["render", source, "-o", str(tmp_path / "s.png"), "--azimuth", "0", "90", "--sheet", *common])
    assert opened(tmp_path / "s.png").shape == (64, 128, 3)
    main(["render", source, "-o", str(tmp_path / "t.gif"), "--turntable", "3", *common])
    with Image.open(tmp_path / "t.gif") as film:
        assert film.n_frames == 3
    main(["render", source, "-o", str(tmp_path / "c.png"), "--background", "transparent", *common])
    assert opened(tmp_path / "c.png").shape == (64, 64, 4)


def test_a_mesh_hides_what_lies_behind_it(source, tmp_path):
    # A wall before the horizontal stroke's right half, seen from +x.
    (tmp_path / "wall.obj").write_text("v 0.5 0 -0.5\nv 0.5 2 -0.5\nv 0.5 2 0.5\nv 0.5 0 0.5\nf 1 2 3 4\n")
    view = ["--azimuth", "0", "--elevation", "0", "--height", "3", "--size", "60", "--style", "technical", "--quiet"]
    wall = ["--surface", str(tmp_path / "wall.obj"), "--no-contours"]
    main(["render", source, "-o", str(tmp_path / "a.png"), *view])
    main(["render", source, "-o", str(tmp_path / "b.png"), *view, *wall])
    plain, hidden = (opened(tmp_path / name)[28:32].min(axis=(0, 2)) for name in ("a.png", "b.png"))
    # The stroke runs from y = -1 to 1, 20 pixels a unit, through the middle.
    assert (plain[12:48] < 128).all()
    assert (hidden[12:28] < 128).all()
    assert (hidden[34:48] == 255).all()


@needs("svgelements", "svgpathtools", "pypdfium2")
@pytest.mark.parametrize("style", ["ink", "technical"])
def test_a_page_in_a_style_has_its_margins(source, tmp_path, style):
    """By what is inked, in SVG, PDF and PNG files."""
    for suffix, measure, near in ((".svg", svg_page, 0.011), (".pdf", pdf_pages, 0.011), (".png", png_page, 0.1)):
        file, page = tmp_path / f"a{suffix}", ["--page", "A6", "--margin", "7mm", "--background"]
        main(
            [
                "render",
                source,
                "-o",
                str(file),
                "--quiet",
                "--style",
                style,
                *page,
                "1,1,1" if suffix == ".png" else "transparent",
            ]
        )
        size, box = next(measure(file)) if suffix == ".pdf" else measure(file)
        assert size == pytest.approx((105, 148), abs=0.01)
        free = [box[0], box[1], size[0] - box[2], size[1] - box[3]]
        assert min(free) == pytest.approx(7, abs=near)
        assert free == pytest.approx(free[2:] + free[:2], abs=2 * near)


@needs("pypdfium2")
@pytest.mark.parametrize("style", ["ink", "watercolour"])
def test_a_pdf_in_a_style_looks_as_its_svg(source, tmp_path, style):
    """Watercolour multiplies; PDFium draws what resvg does. On paper both layers of fibres lie below it."""
    import pypdfium2

    how = ["--style", style, "--size", "96", "--quiet"]
    main(["render", source, "-o", str(tmp_path / "a.pdf"), *how])
    main(["render", source, "-o", str(tmp_path / "a.png"), *how])
    with pypdfium2.PdfDocument(tmp_path / "a.pdf") as document:
        drawn = document[0].render(scale=96 / 72).to_numpy()[..., 2::-1].astype(float)
    expected = opened(tmp_path / "a.png").astype(float)
    assert drawn.shape == expected.shape
    assert np.abs(drawn - expected).mean() < 1.5
    assert ink_apart(drawn / 255, expected / 255) == 0
    main(["render", source, "-o", str(tmp_path / "b.pdf"), *how, "--paper"])
    with pypdfium2.PdfDocument(tmp_path / "a.pdf") as plain, pypdfium2.PdfDocument(tmp_path / "b.pdf") as paper:
        counts = [len(list(document[0].get_objects())) for document in (plain, paper)]
    assert counts[1] == counts[0] + 2


def test_a_stroke_is_drawn_once(source, tmp_path):
    """Also one that another passes, and that is in several parts there."""
    main(["render", source, "-o", str(tmp_path / "a.svg"), "--style", "technical", "--quiet"])
    assert (tmp_path / "a.svg").read_text().count("<path") == 2


def test_export_draws_the_same_view(source, tmp_path):
    main(["render", source, "-o", str(tmp_path / "a.svg"), "--style", "ink", "--style-seed", "3", "--quiet"])
    main(["export", source, str(tmp_path / "b.svg"), "--style", "ink", "--style-seed", "3", "--quiet"])
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


def test_options_change_the_drawing(source, tmp_path):
    (tmp_path / "dot.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"><circle r="3"/></svg>')
    brush = str(tmp_path / "dot.svg")
    drawn = set()
    for options in (
        ["--style", "ink"],
        ["--style", "ink", "--style-width", "2"],
        ["--style", "ink", "--style-seed", "1"],
        ["--style", "ink", "--depth-cue", "1"],
        ["--style", "ink", "--paper"],
        ["--brush", brush],
        ["--style", "scattered", "--brush", brush],
    ):
        main(["render", source, "-o", str(tmp_path / "a.svg"), "--quiet", *options])
        drawn.add((tmp_path / "a.svg").read_text())
    assert len(drawn) == 7


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"depth_cue": 0.5}, "--depth-cue is for styles: give a --style too"),
        ({"paper": True}, "--paper is for styles"),
        ({"style": "scattered"}, "--style scattered needs --brush FILE.svg"),
        ({"style": "ink", "brush": Path("a.svg")}, "--style ink has a brush of its own: leave --brush out"),
        ({"style": "ink", "style_width": 0.0}, "style_width must be positive, got 0"),
        ({"style": "ink", "depth_cue": 2.0}, "depth_cue must be from 0 to 1, got 2"),
    ],
)
def test_options_that_do_not_fit(options, message):
    with pytest.raises(ValueError, match=message):
        StyleOptions(**options)


@pytest.mark.parametrize(
    ("command", "file", "options", "message"),
    [
        ("export", "a.step", [], r"--style draws .svg files here"),
        ("render", "a.png", ["--engine", "blender"], "--engine is for strokes without a style: leave it out"),
        ("render", "a.svg", ["--centerline"], "--centerline is for strokes without a style: leave it out"),
        ("render", "a.svg", ["--style", "stretched", "--brush", "{source}"], "sketch.json: not an SVG file"),
    ],
)
def test_refusals_write_nothing(source, tmp_path, capsys, command, file, options, message):
    out = tmp_path / file
    out.write_bytes(b"old")
    target = ["-o", str(out)] if command == "render" else [str(out)]
    options = [option.format(source=source) for option in options]
    with pytest.raises(SystemExit):
        main([command, source, *target, *(["--style", "ink"] if "--brush" not in options else []), *options])
    assert message in " ".join(capsys.readouterr().err.split())
    assert out.read_bytes() == b"old"
