"""Edge maps as a learned detector draws them: soft lines, uneven, with gaps, specks, noise and a bias of its own."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from cad.lines import SMOOTH, Pieces
from cad.views import SIZE, View


@dataclass(frozen=True)
class Detector:
    """Habits of one detector, the same in all pictures of a part; lengths in pixels.

    shift (2,): added to every position (x, y); outward: outlines against the background lie this much too far outside;
    width: standard deviation of a line's profile before it is cut off at white, `inner` times as much for edges within
    the outline; floor: strength of an inner edge without contrast; uneven: part of the strength that comes and goes;
    faint: strength of smooth edges where they show; gaps, jitter, specks, noise: how much of each; border: strength of
    the frame around the picture.
    """

    shift: np.ndarray
    outward: float
    width: float
    inner: float
    floor: float
    uneven: float
    faint: float
    gaps: float
    jitter: float
    specks: float
    noise: float
    border: float


# Full strength everywhere, nothing shifted, nothing missing, nothing added.
CLEAN = Detector(
    shift=np.zeros(2),
    outward=0.0,
    width=1.0,
    inner=1.0,
    floor=1.0,
    uneven=0.0,
    faint=0.0,
    gaps=0.0,
    jitter=0.0,
    specks=0.0,
    noise=0.0,
    border=0.0,
)


def random_detector(rng: Generator) -> Detector:
    """Habits around those of two detectors on ABC-NEF: shifts up to .4, outward up to .9, lines 2 to 4 wide."""
    angle, far = rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.4)
    return Detector(
        shift=far * np.array([np.cos(angle), np.sin(angle)]),
        outward=rng.uniform(0, 0.9),
        width=rng.uniform(0.75, 1.5),
        inner=rng.uniform(0.75, 1.0),
        floor=rng.uniform(0.3, 0.6),
        uneven=rng.uniform(0.1, 0.3),
        faint=rng.uniform(0.1, 0.35),
        gaps=rng.uniform(0.3, 1.0),
        jitter=rng.uniform(0.05, 0.2),
        specks=rng.uniform(0, 3),
        noise=rng.uniform(0.005, 0.03),
        border=rng.uniform(0.1, 0.3) if rng.random() < 0.3 else 0.0,
    )


def edge_map(rng: Generator, detector: Detector, pieces: Pieces, view: View, color: np.ndarray) -> np.ndarray:
    """The map (SIZE, SIZE) in 0..1 of visible pieces; `color` (SIZE, SIZE, 4) tells contrast and background."""
    ends = np.stack([view.project(pieces.ends[:, k])[0] for k in range(2)], 1)
    along = ends[:, 1] - ends[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    across, middle = np.column_stack([-along[:, 1], along[:, 0]]), ends.mean(1)
    contrast, outer = _surroundings(middle, across, color)
    strength = _strength(rng, detector, pieces, middle, contrast, outer != 0)
    offset = detector.shift + detector.outward * outer[:, None] * across
    offset = offset + detector.jitter * np.column_stack([_field(rng, middle, 12), _field(rng, middle, 12)])
    width = np.where(outer != 0, 1.0, detector.inner) * detector.width
    specks = _specks(rng, detector, middle)
    ends = np.concatenate([ends + offset[:, None], specks])
    strength = np.concatenate([strength, rng.uniform(0.2, 0.6, len(specks))])
    ink = draw(ends, strength, np.concatenate([width, np.full(len(specks), 0.8 * detector.width)]))
    return _noisy(rng, detector, ink)


def _surroundings(middle: np.ndarray, across: np.ndarray, color: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Contrast (n,) between two pixels left and right of each piece, and the side (n,) -1, 0, +1 of the background."""
    sides = []
    for side in (1, -1):
        at = np.clip(np.floor(middle + 2 * side * across).astype(int), 0, SIZE - 1)
        sides.append(color[at[:, 1], at[:, 0]])
    a, b = sides
    contrast = np.abs(a[:, :3] - b[:, :3]).mean(1)
    outer = (b[:, 3] > 0.5).astype(float) - (a[:, 3] > 0.5)
    return np.where(outer != 0, 1.0, contrast), outer


def _strength(
    rng: Generator, detector: Detector, pieces: Pieces, middle: np.ndarray, contrast: np.ndarray, outer: np.ndarray
) -> np.ndarray:
    """Strength (n,) in 0..1: by contrast, with slow changes, and gaps where the contrast is low."""
    # Above a contrast of .15 an inner edge is as strong as an outline; below .04 pieces of it go missing (empirical).
    strength = detector.floor + (1 - detector.floor) * np.clip(contrast / 0.15, 0, 1)
    strength = strength * (1 - detector.uneven * np.clip(0.5 + 0.5 * _field(rng, middle, 25), 0, 1))
    # Each edge has its own luck in each view, so that two lines side by side do not break off together.
    luck = np.append(rng.normal(size=pieces.edge.max(initial=0) + 1), 0.0)[pieces.edge]
    present = np.clip(contrast / 0.04 + 1.6 - detector.gaps * (1 + np.abs(luck) + _field(rng, middle, 15)), 0, 1)
    faint = np.where(luck > 0.7, detector.faint, 0.0)
    strength = strength * np.where(outer, 1.0, present)
    return np.where(pieces.kind == SMOOTH, faint, strength)


def _field(rng: Generator, points: np.ndarray, scale: float) -> np.ndarray:
    """A smooth random function of the position: standard deviation 1, correlated over about `scale` pixels."""
    waves = rng.normal(size=(12, 2)) / scale
    phases = rng.uniform(0, 2 * np.pi, 12)
    return np.sqrt(2 / 12) * np.cos(points @ waves.T + phases).sum(1)


def _specks(rng: Generator, detector: Detector, middle: np.ndarray) -> np.ndarray:
    """Ends (n, 2, 2) of short lines that are no edges, within the object's bounding box."""
    count = rng.poisson(detector.specks)
    start = rng.uniform(middle.min(0), middle.max(0), (count, 2))
    angle, length = rng.uniform(0, 2 * np.pi, count), rng.uniform(4, 15, count)
    return np.stack([start, start + length[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])], 1)


def draw(ends: np.ndarray, strength: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Picture (SIZE, SIZE) of segments (n, 2, 2): strength times a Gaussian profile cut off at white; the maximum.

    A line of width w is at least half as strong as its middle over 2.7 w pixels.
    """
    reach = np.ceil(3.2 * width + np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / 2).astype(int)
    picture = np.zeros(SIZE * SIZE)
    for size in np.unique(reach):
        chosen = (reach == size) & (strength > 0)
        a, b = ends[chosen, :1], ends[chosen, 1:]
        window = np.stack(np.meshgrid(*[np.arange(-size, size + 1)] * 2), -1).reshape(1, -1, 2)
        pixel = np.floor((a + b) / 2).astype(int) + window
        to, along = pixel + 0.5 - a, b - a
        t = np.clip((to * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-12), 0, 1)
        square = ((to - t[..., None] * along) ** 2).sum(-1) / width[chosen, None] ** 2
        value = strength[chosen, None] * np.minimum(1, 1.25 * np.exp(-square / 2))
        inside = ((pixel >= 0) & (pixel < SIZE)).all(-1) & (value > 1e-3)
        np.maximum.at(picture, pixel[inside] @ np.array([1, SIZE]), value[inside])
    return picture.reshape(SIZE, SIZE)


def _noisy(rng: Generator, detector: Detector, ink: np.ndarray) -> np.ndarray:
    """Pixel noise, stronger on the lines than on the black, and a faint frame along the picture's border."""
    if detector.border:
        frame = np.ones_like(ink, bool)
        frame[1:-1, 1:-1] = False
        ink = np.where(frame, np.maximum(ink, detector.border * rng.uniform(0.3, 1, ink.shape)), ink)
    noise = detector.noise * rng.normal(size=ink.shape)
    return np.clip(ink + noise * (0.3 + 2 * ink), 0, 1)
