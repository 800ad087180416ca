"""PDF: its pages by another program against the picture of the same sketch, layers, and structure."""

import dataclasses
import importlib.util
import re
import zlib

import numpy as np
import pytest
import torch
from ink import ink_apart

import diff3ds as ds
from diff3ds.formats import save_pdf, save_svg
from diff3ds.page.sheet.page_setup import PageSetup

CAMERAS = ds.orbit([20.0, 110.0], 25.0, size=(96, 128))


def colored(space="image"):
    g = torch.Generator().manual_seed(3)
    points = ds.Sketch.random(12, generator=g).points
    return ds.Sketch(points, width=0.05, color=torch.rand(12, 3, generator=g), width_space=space)


def objects(path):
    """The objects of a file by number, found through its table of places as readers do; and the page's operators."""
    data = path.read_bytes()
    assert data.startswith(b"%PDF-1.5\n")
    assert data.endswith(b"%%EOF\n")
    start = int(re.search(rb"startxref\n(\d+)\n%%EOF\n$", data)[1])
    rows = data[start:].split(b"trailer")[0].split(b"\n")[3:-1]
    found = {}
    for number, row in enumerate(rows, 1):
        assert len(row) == 19
        place = int(row[:10])
        head = f"{number} 0 obj\n".encode()
        assert data[place : place + len(head)] == head
        found[number] = data[place + len(head) :].split(b"\nendobj\n")[0]
    packed = re.match(rb"<< /Length (\d+) /Filter /FlateDecode >>\nstream\n", found[4])
    content = found[4][packed.end() : packed.end() + int(packed[1])]
    assert found[4][packed.end() + int(packed[1]) :] == b"\nendstream"
    return found, zlib.decompress(content).decode("ascii")


@pytest.mark.skipif(importlib.util.find_spec("pypdfium2") is None, reason="pypdfium2 is not installed")
@pytest.mark.parametrize("space", ["image", "world"])
def test_looks_as_rendered(tmp_path, space):
    import pypdfium2

    sketch = dataclasses.replace(colored(space), opacity=torch.linspace(0.3, 1, 12))
    ds.save(tmp_path / "a.pdf", sketch, CAMERAS[0])
    with pypdfium2.PdfDocument(tmp_path / "a.pdf") as document:
        picture = document[0].render(scale=96 / 72).to_numpy()[..., ::-1].astype(float)
    rendered = ds.render(sketch, CAMERAS[0]).color[0].numpy() * 255
    assert picture.shape == rendered.shape
    assert np.abs(picture - rendered).mean() < 3
    assert ink_apart(picture / 255, rendered / 255) == 0


def test_a_page_has_its_size_and_every_stroke(tmp_path):
    save_pdf(tmp_path / "a.pdf", colored(), CAMERAS, page=PageSetup(127, 47.625, 0, "none"))
    found, content = objects(tmp_path / "a.pdf")
    # Two views of 128 x 96 pixels beside each other; 127 mm are 5 inches of 72 points.
    assert b"/MediaBox [0 0 360 135]" in found[3]
    assert content.count("re W n") == 2
    save_svg(tmp_path / "a.svg", colored(), CAMERAS)
    assert len(re.findall(r"^S$|^f$", content, re.MULTILINE)) == (tmp_path / "a.svg").read_text().count("<path")
    save_pdf(tmp_path / "b.pdf", colored(), CAMERAS, page=PageSetup(127, 47.625, 0, "none"))
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


def test_layers_are_optional_content_a_colour(tmp_path):
    color = torch.tensor([[1.0, 0, 0], [0, 0, 1]]).repeat(6, 1)
    save_pdf(tmp_path / "a.pdf", dataclasses.replace(colored("world"), color=color), CAMERAS[0], centerline=True)
    found, content = objects(tmp_path / "a.pdf")
    assert sorted(v for v in found.values() if b"/OCG " in v) == [
        b"<< /Type /OCG /Name (#0000ff) >>",
        b"<< /Type /OCG /Name (#ff0000) >>",
    ]
    assert content.count("BDC") == content.count("EMC") == 2
    # Pens stroke, and fill nothing, not even the page unless it is asked for.
    assert content.count("\nS\n") == 12
    assert re.search(r"\bf\b", content) is None
    save_pdf(tmp_path / "a.pdf", colored(), CAMERAS[0], centerline=True, background=(1.0, 1.0, 1.0))
    assert " re f\n" in objects(tmp_path / "a.pdf")[1]


def test_transparent_strokes_have_a_state(tmp_path):
    sketch = dataclasses.replace(colored(), opacity=0.25 * torch.ones(12))
    save_pdf(tmp_path / "a.pdf", sketch, CAMERAS[0], background=None)
    found, content = objects(tmp_path / "a.pdf")
    assert b"/A0 << /CA 0.25 /ca 0.25 >>" in found[3]
    assert content.count("/A0 gs") == 12
    assert " re f" not in content


def test_bad_arguments_leave_the_old_file(tmp_path):
    (tmp_path / "a.pdf").write_text("old")
    with pytest.raises(ValueError, match="at least one view"):
        save_pdf(tmp_path / "a.pdf", colored(), CAMERAS[:0])
    with pytest.raises(ValueError, match="tolerance must be positive, got 0"):
        save_pdf(tmp_path / "a.pdf", colored(), CAMERAS, tolerance=0)
    with pytest.raises(ValueError, match="a picture needs cameras"):
        ds.save(tmp_path / "a.pdf", colored())
    assert (tmp_path / "a.pdf").read_text() == "old"
