"""A page's lines against Python's, each by itself: the chords that its scripts draw, by ends and distance."""

import re
from pathlib import Path

import numpy as np
import torch
from scipy.spatial import cKDTree

import diff3ds as ds
from diff3ds.viewer.page import digest

# What a page is made to say here: pixels of the ends of all chords, of its strokes and of the chains of its contours.
TOLD = """
window.lines = () => {
  const axes = axesOf(camera);
  const chains = ({ values, first }) => first.slice(1).map((end, i) => {
    const places = [];
    for (let place = first[i] * CHORD; place < end * CHORD; place += CHORD) {
      for (const at of [place, place + 3]) {
        const { x, y } = projected(camera, axes, size(), [0, 1, 2].map((axis) => values[at + axis]));
        places.push([x, y]);
      }
    }
    return places;
  });
  return { strokes: chains(sketch.chords), contours: surface ? chains(contoursOf(surface, camera, 0, 0)) : [] };
};
"""
# Chords stay within .15 px of a curve, and two samples of it lie this close.
STEP = 0.05
# Pixels that a stroke may be off: its chords stay within .15 of it.
STROKE = 0.2
# And a contour: on the page it has a corner in each face, in Python it is smooth. A tenth of that on fine meshes.
CONTOUR = 1.0
# Pixels between ink and ink where strokes go into a surface at a flat angle, which pixels decide on the page and
# crossings in Python.
FLAT = 8
# Pixels that such ends of wide strokes take up at most, all of a picture's together; 37 were found.
ENDS = 50


def with_lines_told(path: Path) -> str:
    """The address of a saved page that can be asked for its lines."""
    page = path.read_text(encoding="utf-8")
    (script,) = re.findall(r'<script type="module">(.*?)</script>', page, re.DOTALL)
    told = page.replace(script, script + TOLD).replace(digest(script), digest(script + TOLD))
    path.write_text(told, encoding="utf-8")
    return path.as_uri()


def along(ends: np.ndarray) -> np.ndarray:
    """Places on chords, pixels, from the rows of their ends two by two."""
    chords = ends.reshape(-1, 2, ends.shape[-1])[..., :2]
    counts = np.ceil(np.linalg.norm(chords[:, 1] - chords[:, 0], axis=1) / STEP).astype(int) + 1
    places = [a + (b - a) * np.linspace(0, 1, n)[:, None] for (a, b), n in zip(chords, counts, strict=True)]
    return np.concatenate(places)


def in_pixels(sketch: ds.Sketch, camera: ds.Cameras) -> list[np.ndarray]:
    """Chords of each stroke as the camera sees it, their ends two by two; much finer than those of pages."""
    sketch = sketch.to(torch.float64)
    points = ds.bezier.evaluate(sketch.points, sketch.weights, torch.linspace(0, 1, 400, dtype=torch.float64))
    matrix = camera.projection[0]
    pixels, _ = camera.seen(points @ matrix[:, :3].mT + matrix[:, 3])
    owner = torch.arange(len(pixels)) if sketch.chains is None else sketch.chains.stroke
    doubled = pixels[:, torch.arange(399).repeat_interleave(2) + torch.tensor([0, 1]).repeat(399)]
    return [doubled[owner == stroke].flatten(0, 1).numpy() for stroke in range(len(sketch))]


def apart(some: np.ndarray, others: np.ndarray) -> float:
    """How far the farthest of some places is from the nearest of others, pixels."""
    return float(cKDTree(others).query(some)[0].max())


def strokes_off(browser, sketch: ds.Sketch, camera: ds.Cameras) -> list[float]:
    """How far each stroke of a page, or an end of it, is from where it should be, pixels."""
    shown, wanted = browser.value("lines()")["strokes"], in_pixels(sketch, camera)
    assert len(shown) == len(wanted)
    off = []
    for chords, curve in zip(map(np.array, shown), wanted, strict=True):
        ends = [np.linalg.norm(chords[i, :2] - curve[i]) for i in (0, -1)]
        off.append(max(*ends, apart(along(chords), along(curve)), apart(along(curve), along(chords))))
    return off


def contours_off(browser, sketch: ds.Sketch, surface: ds.TriangleMesh, camera: ds.Cameras) -> list[float]:
    """How far each contour of a page is from all of Python's, and each of these from all of the page's, pixels.

    Of those that are in the picture: beyond it neither takes care.
    """
    (lines,) = ds.visible_lines(sketch, camera, surface)
    own = [i for i, kind in enumerate(lines.kinds) if kind == "contour"]
    wanted = [along(curve) for curve in in_pixels(lines.sketch[own], camera)]
    shown = [along(np.array(chain)) for chain in browser.value("lines()")["contours"]]
    if not (shown and wanted):
        return [np.inf] * (len(shown) + len(wanted))
    height, width = camera.size
    off = []
    for each, others in ((shown, np.concatenate(wanted)), (wanted, np.concatenate(shown))):
        inside = [places[((places > 0) & (places < (width, height))).all(1)] for places in each]
        off += [apart(places, others) for places in inside if len(places)]
    return off
