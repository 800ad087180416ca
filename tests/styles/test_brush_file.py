"""Brushes from SVG files: areas of known shapes, and files that are broken or hostile."""

import contextlib
import math

import numpy as np
import pytest
import torch
from needs import needs
from style_pages import CAMERA, lines, stroke

import diff3ds as ds
from diff3ds import styles
from diff3ds.styles.brush_file import MAX_BYTES, load_brush

pytestmark = needs("pathops")

PAGE = styles.Page((256, 256), 4.0, 0)


@pytest.fixture
def brush(tmp_path):
    def load(content, space='xmlns="http://www.w3.org/2000/svg"'):
        file = tmp_path / "brush.svg"
        file.write_text(f"<svg {space}>{content}</svg>" if not content.startswith(("<?", "<!", "<x")) else content)
        return load_brush(file)

    return load


SQUARE = (0, 0, 4, 4)
SHAPES = {
    '<rect x="1" y="2" width="3" height="4"/>': (12.0, (1, 2, 4, 6)),
    '<rect width="10" height="6" rx="2"/>': (60 - (4 - math.pi) * 4, (0, 0, 10, 6)),
    '<circle cx="5" cy="5" r="2px"/>': (math.pi * 4, (3, 3, 7, 7)),
    '<ellipse cx="0" cy="0" rx="4" ry="1"/>': (math.pi * 4, (-4, -1, 4, 1)),
    '<polygon points="0,0 4 0,4,3"/>': (6.0, (0, 0, 4, 3)),
    '<path d="M0 0h4v3z"/>': (6.0, (0, 0, 4, 3)),
    '<path d="m1,1 4,0 0,3-4,0"/>': (12.0, (1, 1, 5, 4)),
    '<path d="M0,0L4,0L4,4L0,4ZM1,1L1,3L3,3L3,1Z"/>': (12.0, SQUARE),
    '<path d="M0,0L4,0L4,4L0,4ZM1,1L3,1L3,3L1,3Z"/>': (16.0, SQUARE),
    '<path fill-rule="evenodd" d="M0,0L4,0L4,4L0,4ZM1,1L3,1L3,3L1,3Z"/>': (12.0, SQUARE),
    '<path style="fill-rule: evenodd" d="M0,0H4V4H0ZM1,1H3V3H1Z"/>': (12.0, SQUARE),
    '<rect width=".04" height=".03"/><rect x="9e-2" width=".01" height=".01"/>': (1.3e-3, (0, 0, 0.1, 0.03)),
    # Two thirds of base times height under a parabola; S and T mirror the last handle.
    '<path d="M0,0Q2,3 4,0T8,0Z"/>': (8.0, (0, -1.5, 8, 1.5)),
    '<path d="M0,0C0,4 4,4 4,0S8-4 8,0Z"/>': (2 * 0.6 * 16, (0, -3, 8, 3)),
    '<path d="M2,0A2,2 0 1 1-2,0A2 2 0 1 1 2 0"/>': (math.pi * 4, (-2, -2, 2, 2)),
    '<path d="M2,0a2,2,0,00-4,0z"/>': (math.pi * 2, (-2, -2, 2, 0)),
    '<path d="M2,0a2,2,0,01-4,0z"/>': (math.pi * 2, (-2, 0, 2, 2)),
    '<g transform="translate(10 0) scale(2)"><rect width="1" height="3"/></g>': (12.0, (10, 0, 12, 6)),
    '<rect width="4" height="2" transform="rotate(90)"/>': (8.0, (-2, 0, 0, 4)),
    '<rect width="4" height="2" transform="matrix(1 0 1 1 0 0)"/>': (8.0, (0, 0, 6, 2)),
    '<rect width="4" height="4"/><rect x="2" width="4" height="4"/>': (24.0, (0, 0, 6, 4)),
    '<rect width="4" height="4"/><g fill="none"><circle r="9"/><circle r="1" fill="red"/></g>': (
        16 + 0.75 * math.pi, (-1, -1, 4, 4),
    ),
    '<defs><circle r="9"/></defs><rect width="4" height="4"/><circle r="9" display="none"/>': (16.0, SQUARE),
    '<i:path xmlns:i="u" d="M0 0H9V9Z"/><polyline points="0,0 9,9 9,0"/><rect width="4" height="4"/>': (16.0, SQUARE),
}  # fmt: skip


@pytest.mark.parametrize("content", SHAPES)
def test_shapes_have_their_areas(brush, content):
    area, bounds = SHAPES[content]
    shape = brush(content)
    assert shape.area == pytest.approx(area, rel=1e-3)
    assert shape.bounds == pytest.approx(bounds, rel=2e-3, abs=2e-4 * max(map(abs, bounds)))


DOCTYPE = '<!DOCTYPE svg [<!ENTITY a "M0 0H9V9Z">]><svg xmlns="http://www.w3.org/2000/svg"><path d="&a;"/></svg>'
BOMB = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 9))
OUTSIDE = '<!DOCTYPE svg [<!ENTITY a SYSTEM "file:///etc/passwd">]><svg xmlns="http://www.w3.org/2000/svg">&a;</svg>'
BROKEN = {
    "<g>": "not an SVG file",
    "<xml/>": "it begins with the element 'xml'",
    "": "there is no filled shape in it",
    '<path/><path d=""/><path d="M3 3"/><polygon/><rect/>': "there is no filled shape in it",
    '<path fill="none" stroke="red" d="M0 0L9 9"/>': "there is no filled shape in it",
    '<path d="M0 0L9 9"/>': "there is no filled shape in it",
    '<image href="http://example.org/a.png"/>': "an element 'image'",
    '<use href="#a"/>': "an element 'use'",
    "<text>a</text>": "an element 'text'",
    '<rect width="4" height="4" clip-path="url(#a)"/>': "a clip-path",
    "<style>.a{fill:none}</style>": "style sheet",
    '<path d="L9 9"/>': "path data begins with M",
    '<path d="M0 0L9"/>': "a number of 'L' lacks",
    '<path d="M0 0X9"/>': "cannot read path data at 'X9'",
    '<path d="M0 0L1e9 0L0 1"/>': "expected a number of at most 10000",
    '<path d="M0 0l9000 0l9000 0l0 9"/>': "coordinates beyond 10000",
    '<g transform="scale(9999)"><g transform="scale(9999)"><rect width="9" height="9"/></g></g>': "coordinates beyond",
    "<g transform='scale(9999)'>" * 60 + "<circle r='9'/>" + "</g>" * 60: "coordinates beyond",
    '<g transform="scale(0)"><rect width="9" height="9"/></g>': "there is no filled shape in it",
    '<path d="M0 0Z9"/>': "cannot read path data",
    '<circle r="50%"/>': "expected a number",
    '<rect width="nan" height="4"/>': "expected a number",
    '<g transform="spin(3)"/>': "cannot read the transform",
    '<g transform="scale(1,2,3)"/>': "cannot read the transform",
    '<path d="M0 0' + "h1h-1" * 20_000 + '"/>': "more than 20000 path commands",
    "<g/>" * 10_001: "more than 10000 elements",
    "<g>" * 70 + "</g>" * 70: "64 deep",
    DOCTYPE: "its document type declares entities",
    f'<!DOCTYPE svg [<!ENTITY a0 "lol">{BOMB}]><svg>&a8;</svg>': "its document type declares entities",
    OUTSIDE: "its document type declares entities",
}


@pytest.mark.parametrize("content", BROKEN, ids=[text[:24] or "empty" for text in BROKEN])
def test_broken_and_hostile_files(brush, content):
    with pytest.raises(ValueError, match=BROKEN[content].replace("(", r"\(")) as caught:
        brush(content)
    assert "brush.svg: " in str(caught.value)


def test_large_and_binary_files(tmp_path):
    (tmp_path / "large.svg").write_bytes(b" " * (MAX_BYTES + 1))
    with pytest.raises(ValueError, match="more than the 1048576 of a brush"):
        load_brush(tmp_path / "large.svg")
    g = torch.Generator().manual_seed(0)
    good = b'<svg xmlns="http://www.w3.org/2000/svg"><path d="M0,0C22,-24 62,-22 100,0C62,22 22,24 0,0Z"/></svg>'
    for _ in range(300):
        data = bytearray(good)
        for place in torch.randint(len(data), (3,), generator=g).tolist():
            data[place] = int(torch.randint(256, (1,), generator=g))
        file = tmp_path / "fuzz.svg"
        file.write_bytes(bytes(data[: int(torch.randint(20, len(data) + 1, (1,), generator=g))]))
        with contextlib.suppress(ValueError):
            load_brush(file)


def test_a_stretched_brush_covers_the_line_and_follows_it(brush):
    shape = brush('<rect width="50" height="10"/>')
    (line,) = lines(stroke((-0.5, 0.0), (0.5, 0.0), width=8 / 256))
    (mark,) = styles.Stretched(shape, width=3.0).marks(line, PAGE, 0)
    assert mark.path.area == pytest.approx(128 * 24, rel=1e-3)
    triangle = brush('<polygon points="0,0 50,5 0,10"/>')
    (mark,) = styles.Stretched(triangle, width=3.0).marks(line, PAGE, 0)
    assert mark.path.area == pytest.approx(128 * 12, rel=2e-3)
    # The left end lies on the beginning.
    assert mark.path.bounds == pytest.approx((64, 116, 192, 140), abs=0.1)
    left_half = [p for p in mark.path.points if p[0] < 100]
    assert np.ptp([p[1] for p in left_half]) > 20
    points, weights = ds.bezier.circle((0.0, 0.0, 0.0), 0.5, (1.0, 0.0, 0.0))
    (ring,) = lines(ds.Sketch(points, weights, width=8 / 256, chains=ds.Chains.of([len(points)], True)))
    (mark,) = styles.Stretched(shape, width=3.0).marks(ring, PAGE, 0)
    assert mark.path.area == pytest.approx(math.pi * (76**2 - 52**2), rel=5e-3)


def test_a_hole_of_a_brush_stays_one(brush):
    shape = brush('<path fill-rule="evenodd" d="M0,0H50V10H0ZM10,3H40V7H10Z"/>')
    (line,) = lines(stroke((-0.5, 0.0), (0.5, 0.0), width=8 / 256))
    (mark,) = styles.Stretched(shape, width=3.0).marks(line, PAGE, 0)
    assert mark.path.area == pytest.approx(128 * 24 * (1 - 0.6 * 0.4), rel=2e-3)


def test_scattered_copies_keep_their_distance_and_size(brush):
    shape = brush('<rect width="10" height="10"/>')
    (line,) = lines(stroke((-0.5, 0.0), (0.5, 0.0), width=4 / 256))
    (mark,) = styles.Scattered(shape, width=2.0, spacing=2.0, jitter=0.0).marks(line, PAGE, 0)
    contours = sorted(c.bounds for c in mark.path.contours)
    assert len(contours) == 8
    assert [c[0] for c in contours] == pytest.approx([64 + 16 * k + 4 for k in range(8)], abs=1e-3)
    assert mark.path.area == pytest.approx(8 * 64, rel=1e-4)
    jittered = [styles.Scattered(shape, jitter=0.5).marks(line, PAGE, seed)[0].path.area for seed in (0, 1)]
    assert jittered[0] != jittered[1]


def test_brushes_come_from_files(tmp_path):
    (tmp_path / "b.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"><circle r="3"/></svg>')
    for make in (styles.stretched, styles.scattered):
        text = styles.styled_svg(stroke((-0.5, 0.0), (0.5, 0.0)), CAMERA, make(tmp_path / "b.svg"))
        assert "<path" in text
    with pytest.raises(FileNotFoundError):
        styles.stretched(tmp_path / "missing.svg")
