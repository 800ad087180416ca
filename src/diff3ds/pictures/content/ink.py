"""Ink on paper: a drawing that was photographed or scanned, on paper that is grainy or unevenly lit."""

import numpy as np
from numpy.polynomial.legendre import legvander, legvander2d
from numpy.typing import NDArray

from diff3ds._shapes import Bool, Float

Array = NDArray[np.float64]

# The ink of a drawing is nowhere deeper than this fraction of the picture's side, but for a tenth of it: what is deeper
# is an area. A felt tip of 6 % of the object's size is half as deep.
DEEP = 0.03
# A pixel with this fraction of the darkest ink is a line's.
INKED = 0.5
# Ink that spans less than this fraction of the picture is a speck.
SPECK = 0.03
# Lightness of paper changes slowly, over this fraction of the picture's longer side; grain is smaller than the other.
SLOW, GRAIN = 0.06, 0.002
# What is no page: shades at the border, such as what a scanner sees beside the page, or a finger, darker than this
# fraction of the page. They are wider than lines, touch the border over so much, reach in no farther than this, as
# fractions of the longer side, and end within a few pixels in a step of this fraction of the page. Empirical.
SHADE, WIDER, TOUCHES, REACHES, STEP, EDGE = 0.75, 0.012, 0.05, 0.2, 0.15, 4
# Pixels along a side are enough to see it.
ENOUGH = 1000
# A punched hole is a filled spot no longer than this, whose middle lies no farther from the border, as fractions of the
# longer side, and takes this share of its box: a disc has .79. Empirical.
HOLE, FROM_BORDER, ROUND = 0.06, 0.1, 0.6
# Of a shadow over all of a page: the degree in each direction of the logarithm of its light, the parts along each side
# whose lightest pixels tell it, and how often those that are no paper are left out. Empirical.
DEGREE, PARTS, ROUNDS = 3, 24, 3
# Ink is darker than paper by this fraction at least, and by so many times the grain's median deviation; it takes less
# than these fractions of the picture and of its borders. Empirical.
DARKER, DEVIATIONS, MOST, MOST_AT_BORDERS = 0.12, 6.0, 0.25, 0.1


def ink_on_paper(image: Float[NDArray[np.float32], "H W 3"]) -> Float[NDArray[np.float32], "H W"] | None:
    """Ink in [0, 1] of a picture of a drawing; None if it is no drawing."""
    from scipy.ndimage import gaussian_filter, maximum_filter

    side = max(image.shape[:2])
    beside = beside_page(image)
    gray = _evenly_lit(gaussian_filter(_filled(image.mean(-1).astype(float), beside), max(1.0, GRAIN * side)))
    slow = round(SLOW * side)
    paper = gaussian_filter(maximum_filter(gray, 2 * slow + 1), slow)
    darkness = 1 - gray / np.maximum(paper, 1e-3)
    darkness -= np.median(darkness)
    least = max(DARKER, DEVIATIONS * float(np.median(np.abs(darkness))))
    dark = darkness > least
    inked = _without_holes(without_specks(dark & ~beside))
    borders = np.concatenate([inked[0], inked[-1], inked[:, 0], inked[:, -1]])
    texture = inked.sum() < (dark & ~beside).sum() / 2
    # Where the border of the page is in the picture, a drawing keeps within it.
    most = MOST_AT_BORDERS / 2 if beside.any() else MOST_AT_BORDERS
    if texture or not 0 < inked.mean() < MOST or borders.mean() > most:
        return None
    full = max(2 * least, float(np.quantile(darkness[inked], 0.9)))
    ink = np.clip((darkness - least / 2) / (full - least / 2), 0, 1).astype(np.float32)
    ink[~inked] = 0
    return ink if is_thin(ink) else None


def beside_page(image: Float[NDArray[np.float32], "H W 3"]) -> Bool[NDArray[np.bool_], "H W"]:
    """Finds what lies beside a page, or on its edge: dark bands and corners of a scan, a finger."""
    times = -(-max(image.shape[:2]) // ENOUGH)
    found = _beside_page(image[::times, ::times])
    whole: Bool[NDArray[np.bool_], "H W"] = found.repeat(times, 0).repeat(times, 1)[: image.shape[0], : image.shape[1]]
    return whole


def _beside_page(image: Float[NDArray[np.float32], "H W 3"]) -> Bool[NDArray[np.bool_], "H W"]:
    from scipy.ndimage import distance_transform_edt, gaussian_filter, label, maximum

    height, width = image.shape[:2]
    side = max(height, width)
    gray = _evenly_lit(gaussian_filter(image.mean(-1).astype(float), max(1.0, GRAIN * side)))
    page = float(np.quantile(gray, 0.8))
    radius = max(2, round(WIDER * side))
    # Opened by a disc: what is narrower goes. Beyond the border all is dark, so that the narrowest band is wide.
    dark = np.pad(gray < SHADE * page, radius + 1, constant_values=True)
    wide = distance_transform_edt(~(distance_transform_edt(dark) > radius)) <= radius
    names, count = label(wide[radius + 1 : -radius - 1, radius + 1 : -radius - 1])
    rows, columns = np.arange(height)[:, None], np.arange(width)
    inward = np.minimum(np.minimum(rows, height - 1 - rows), np.minimum(columns, width - 1 - columns))
    touches = np.bincount(names[inward == 0], minlength=count + 1)
    reaches = maximum(inward, names, np.arange(count + 1))
    found = np.zeros((height, width), bool)
    for name in np.flatnonzero((touches >= TOUCHES * side) & (reaches <= REACHES * side)):
        away = distance_transform_edt(names != name)
        if name and _step_out_of(gray, away) > STEP * page:
            found |= away <= EDGE
    return found


def _step_out_of(gray: Float[Array, "H W"], away: Float[Array, "H W"]) -> float:
    """How much lighter it is outside of a shade than within it, by its edge, from how far from it each pixel is."""
    from scipy.ndimage import distance_transform_edt

    outside = (away > EDGE) & (away <= 2 * EDGE)
    # The border of the picture is no edge of a shade.
    deep = distance_transform_edt(np.pad(away == 0, 1, mode="edge"))[1:-1, 1:-1]
    within = (away == 0) & (deep <= EDGE)
    return float(np.median(gray[outside]) - np.median(gray[within])) if outside.any() and within.any() else 0.0


def _evenly_lit(gray: Float[Array, "H W"]) -> Float[Array, "H W"]:
    """A page without the shadow that falls on all of it: a polynomial through the lightest of each part of it."""
    rows, columns = (np.linspace(0, side, min(PARTS, side) + 1).astype(int)[:-1] for side in gray.shape)
    lightest = np.maximum.reduceat(np.maximum.reduceat(gray, rows, 0), columns, 1).clip(1e-3)
    places = [np.linspace(-1, 1, side) for side in lightest.shape]
    down, across = np.meshgrid(*places, indexing="ij")
    terms = legvander2d(down, across, [DEGREE, DEGREE]).reshape(lightest.size, -1)
    wanted, kept = np.log(lightest).ravel(), np.ones(lightest.size, bool)
    for _ in range(ROUNDS):
        amounts = np.linalg.lstsq(terms[kept], wanted[kept], rcond=None)[0]
        # Where ink, or a thing, takes all of a part, it says nothing of the page.
        kept = wanted > terms @ amounts - DARKER / 2
    light = [legvander(np.linspace(-1, 1, side), DEGREE) for side in gray.shape]
    even: Float[Array, "H W"] = gray / np.exp(light[0] @ amounts.reshape(DEGREE + 1, DEGREE + 1) @ light[1].T)
    return even


def _filled(gray: Float[Array, "H W"], gone: Bool[NDArray[np.bool_], "H W"]) -> Float[Array, "H W"]:
    """A picture with the nearest of what is left where something has gone."""
    from scipy.ndimage import distance_transform_edt

    if not gone.any() or gone.all():
        return gray
    row, column = distance_transform_edt(gone, return_distances=False, return_indices=True)
    filled: Float[Array, "H W"] = gray[row, column]
    return filled


def without_specks(drawn: Bool[NDArray[np.bool_], "H W"]) -> Bool[NDArray[np.bool_], "H W"]:
    """Keeps what hangs together over more than specks do."""
    from scipy.ndimage import find_objects, label

    names, _ = label(drawn, np.ones((3, 3)))
    spans = np.array([0, *(max(a.stop - a.start, b.stop - b.start) for a, b in find_objects(names))])
    kept: NDArray[np.bool_] = spans[names] > SPECK * max(drawn.shape)
    return kept


def _without_holes(drawn: Bool[NDArray[np.bool_], "H W"]) -> Bool[NDArray[np.bool_], "H W"]:
    """What is drawn without the holes that are punched in a page along its edge."""
    from scipy.ndimage import find_objects, label

    names, _ = label(drawn, np.ones((3, 3)))
    kept = drawn.copy()
    for name, box in enumerate(find_objects(names), 1):
        spans = [part.stop - part.start for part in box]
        middles = [(part.start + part.stop) / 2 for part in box]
        near = min(min(m, side - m) for m, side in zip(middles, drawn.shape, strict=True))
        if max(spans) <= HOLE * max(drawn.shape) and near <= FROM_BORDER * max(drawn.shape):
            spot = names[box] == name
            kept[box] &= ~spot if spot.mean() > ROUND else True
    return kept


def is_thin(ink: Float[NDArray[np.float32], "H W"]) -> bool:
    """Whether ink is lines, not areas."""
    depth = depth_in(ink)
    return bool(np.quantile(depth[depth > 0], 0.9) < DEEP * max(ink.shape))


def depth_in(ink: Float[NDArray[np.float32], "H W"]) -> Float[Array, "H W"]:
    """Measures how deep each pixel lies in the ink, pixels."""
    from scipy.ndimage import distance_transform_edt

    return np.asarray(distance_transform_edt(ink > INKED * ink.max()))
