"""HPGL files: what the words for a plotter draw, in fortieths of a millimetre."""

import re

import numpy as np
import pytest
import torch
from needs import needs
from paper import svg_page

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.formats import save_svg
from diff3ds.formats.vector.hpgl import save_hpgl
from diff3ds.page.sheet.page_setup import PageSetup

PAGE = PageSetup.of("A6", landscape=True, margin=9)
CAMERAS = ds.orbit([20.0, 110.0], 25.0, size=(96, 128))


def rings():
    """Slanted circles of two colours, and a line that ends on one of them."""
    found = []
    for x in (0.1, -0.6):
        ring, weights = ds.bezier.circle((x, 0.0, 0.2), 0.4, (0.3, 0.2, 1.0))
        found.append(ds.Sketch(ring, weights, chains=ds.Chains.of([len(ring)], True)))
    found.append(ds.Sketch(torch.stack([found[0].points[:1, 0], torch.tensor([[0.2, 0.9, 0.5]]).double()], 1)))
    return ds.Sketch.concatenate(found).replace(width=0.01).with_color([1], (1, 0, 0))


def drawn(file):
    """Of each pen what it draws: lines of places, millimetres from the upper left corner of the page."""
    pens, place, lines = {}, None, None
    for word, numbers in re.findall(r"([A-Z]{2})([-\d.,]*);", file.read_text()):
        places = np.array(numbers.split(",") if numbers else [], float)
        if word == "SP":
            lines = pens.setdefault(int(numbers), []) if int(numbers) else None
        elif word == "PU" and numbers:
            place = places
        elif word == "PD":
            lines.append(np.concatenate([place[None], places.reshape(-1, 2)]))
            place = lines[-1][-1]
    return {pen: [line / 40 * (1, -1) + (0, PAGE.height) for line in lines] for pen, lines in pens.items()}


def test_a_plotter_draws_what_svg_files_have(tmp_path):
    """Each pen the paths of its layer, within a step and a half of the cubics of the SVG file."""
    svgpathtools = pytest.importorskip("svgpathtools")
    pen = save_hpgl(tmp_path / "a.hpgl", rings(), CAMERAS, PAGE, pen_mm=0.5)
    same = save_svg(tmp_path / "a.svg", rings(), CAMERAS, page=PAGE, centerline=True, pen_mm=0.5)
    assert pen == same
    pens = drawn(tmp_path / "a.hpgl")
    assert list(pens) == [1, 2]
    assert [len(lines) for lines in pens.values()] == [2, 2]
    paths = svgpathtools.svg2paths(str(tmp_path / "a.svg"))[0]
    places = np.concatenate([[path.point(t) for t in np.linspace(0, 1, 3000)] for path in paths]) / 10
    corners = np.concatenate([line for lines in pens.values() for line in lines])
    away = np.abs(corners[:, 0] + 1j * corners[:, 1] - places[:, None]).min(0)
    # Half a step of rounding each way, and how far places of the SVG file are from each other.
    assert away.max() < 0.025 * 0.71 + 0.03
    assert sum(np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for lines in pens.values() for line in lines) == (
        pytest.approx(pen.drawn, rel=2e-3)
    )


@needs("svgelements")
def test_lines_lie_within_the_margins(tmp_path):
    save_hpgl(tmp_path / "a.hpgl", rings(), CAMERAS, PAGE, pen_mm=1)
    save_svg(tmp_path / "a.svg", rings(), CAMERAS, page=PAGE, centerline=True, pen_mm=1)
    corners = np.concatenate([line for lines in drawn(tmp_path / "a.hpgl").values() for line in lines])
    _, box = svg_page(tmp_path / "a.svg")
    # The lines of the pen are a millimetre wide.
    assert [*(corners.min(0) - 0.5), *(corners.max(0) + 0.5)] == pytest.approx(box, abs=0.03)


def test_the_command_asks_for_paper(tmp_path, capsys):
    ds.save(tmp_path / "a.json", rings())
    source, out = str(tmp_path / "a.json"), str(tmp_path / "a.plt")
    for options, said in (
        ([], "a plotter draws on paper: give a --page, such as A4"),
        (["--page", "A4", "--style", "ink"], "a .plt file has lines alone"),
        (["--page", "A4", "--background", "white"], "a .plt file has lines alone"),
    ):
        with pytest.raises(SystemExit):
            main(["render", source, "-o", out, *options])
        assert said in " ".join(capsys.readouterr().err.split())
    main(["render", source, "-o", out, "--page", "A6", "--speed", "30"])
    assert re.search("the pen is lifted 2 times: .* min .* at 30 mm a second", capsys.readouterr().err)
    assert (tmp_path / "a.plt").read_text().startswith("IN;\nSP1;\nPU")
