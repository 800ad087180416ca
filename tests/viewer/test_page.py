"""The page as a file: what it holds, what it lets in, and that a sketch comes back from it bit for bit."""

import base64
import hashlib
import json
import re
from html.parser import HTMLParser

import pytest
import torch
from sweep import sweep

import diff3ds as ds
from diff3ds.viewer.page import page_text

SKETCH = ds.Sketch(torch.tensor([[[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1]]]) / 3)


class Elements(HTMLParser):
    """Names, attributes and texts of the elements of a page."""

    def __init__(self, text):
        super().__init__()
        self.found, self.inside = [], False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs), ""))
        self.inside = True

    def handle_endtag(self, tag):
        self.inside = False

    def handle_data(self, data):
        if self.inside:
            tag, attributes, text = self.found[-1]
            self.found[-1] = (tag, attributes, text + data)

    def one(self, tag, **wanted):
        (found,) = [(a, t) for name, a, t in self.found if name == tag and wanted.items() <= a.items()]
        return found


def page_of(path, sketch):
    ds.save(path, sketch)
    return Elements(path.read_text(encoding="utf-8"))


def held(page, path):
    path.write_text(page.one("script", id="sketch")[1], encoding="utf-8")
    return ds.load(path)


@sweep("dtype", [torch.float32, torch.float64])
def test_the_page_holds_the_sketch_bit_for_bit(dtype, tmp_path):
    random = torch.Generator().manual_seed(0)

    def numbers(*shape):
        return torch.rand(*shape, generator=random, dtype=dtype)

    points = numbers(5, 4, 3)
    points[1, 0], points[2, 0], points[0, 0] = points[0, 3], points[1, 3], points[2, 3]
    width = 0.01 * (1 + 0 * numbers(5, 4))
    sketch = ds.Sketch(
        points,
        numbers(5, 4) + 0.1,
        width,
        numbers(3, 3),
        numbers(3),
        "world",
        ds.Chains.of([3, 1, 1], [True, False, False]),
    )
    again = held(page_of(tmp_path / "a.html", sketch), tmp_path / "a.json")
    assert again.width_space == "world"
    assert again.chains.closed.tolist() == [True, False, False]
    for name, value in sketch.tensors().items():
        assert torch.equal(getattr(again, name), value), name


def test_nothing_but_its_own_script_and_style_is_let_in(tmp_path):
    page = page_of(tmp_path / "a.html", SKETCH)
    policy = page.one("meta", **{"http-equiv": "Content-Security-Policy"})[0]["content"]
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))

    def digest(text):
        return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"

    assert rules == {
        "default-src": "'none'",
        "script-src": digest(page.one("script", type="module")[1]),
        "style-src": digest(page.one("style")[1]),
        "base-uri": "'none'",
        "form-action": "'none'",
    }
    assert not [a for _, a, _ in page.found if a.keys() & {"src", "href", "style", "onclick", "onload"}]
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert not re.findall(r"https?://|@import|url\(|\beval\b|innerHTML", text)


@sweep("name", ["</script><script>alert(1)<!--", "{{script}} {{sketch}}", '"><img onerror=alert(1)>', "a ü & 'b'"])
def test_a_name_is_only_text(name, tmp_path):
    text = page_text(name, json.dumps({"version": 1, "note": name}), {"middle": [0, 0, 0], "radius": 1})
    page = Elements(text)
    plain = Elements(page_text("a", json.dumps({"version": 1}), {"middle": [0, 0, 0], "radius": 1}))
    assert [tag for tag, _, _ in page.found] == [tag for tag, _, _ in plain.found]
    assert page.one("title")[1].strip() == name
    assert page.one("h1")[1].strip() == name
    assert json.loads(page.one("script", id="sketch")[1])["note"] == name
    assert page.one("canvas")[0]["aria-label"] == name


def test_a_page_is_small(tmp_path):
    ds.save(tmp_path / "a.html", ds.Sketch.random(112, generator=torch.Generator().manual_seed(0)))
    assert (tmp_path / "a.html").stat().st_size < 200_000


def test_pages_have_z_up_and_no_unit(tmp_path):
    from diff3ds.tasks.export.export import run_export
    from diff3ds.tasks.export.export_options import ExportOptions
    from diff3ds.tasks.style_options import StyleOptions

    ds.save(tmp_path / "a.json", SKETCH)
    with pytest.raises(ValueError, match="pages show sketches with z up: leave --up out"):
        run_export(tmp_path / "a.json", tmp_path / "a.html", ExportOptions(up="y"), StyleOptions())
    for beside in (None, tmp_path / "a.json"):
        with pytest.raises(ValueError, match=r"a \.html file says no unit of length"):
            run_export(
                tmp_path / "a.json", tmp_path / "a.html", ExportOptions(unit="mm", beside=beside), StyleOptions()
            )
    with pytest.raises(ValueError, match=r"--beside is for \.html files"):
        run_export(tmp_path / "a.json", tmp_path / "a.obj", ExportOptions(beside=tmp_path / "a.json"), StyleOptions())
    with pytest.raises(ValueError, match=r"a \.html file says no unit of length"):
        run_export(tmp_path / "a.json", tmp_path / "a.html", ExportOptions(unit="mm"), StyleOptions())
    assert not (tmp_path / "a.html").exists()
    run_export(tmp_path / "a.json", tmp_path / "a.html", ExportOptions(scale=2), StyleOptions())
    again = held(Elements((tmp_path / "a.html").read_text(encoding="utf-8")), tmp_path / "b.json")
    assert torch.equal(again.points, 2 * SKETCH.points)
