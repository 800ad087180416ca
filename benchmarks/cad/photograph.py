"""Photographs of a part that hangs in a room: printed surfaces, shadows, cluttered walls, blur, exposure and noise."""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.ndimage import convolve, gaussian_filter, map_coordinates

from cad.boundary import Mesh
from cad.raster import AMBIENT, HEAD, LAMPS, SAMPLES, STRENGTHS, Buffer, face_colours, normals_of, rasterise
from cad.views import CENTRE, FOCAL, SIZE, View

# Half the side of the room, units; the part's longest side is 1 and the cameras stay inside.
ROOM = 6.0
# Waves of the prints: those on the part, with their least and greatest length and contrast, and those on the walls.
WAVES, LENGTHS, CONTRAST = 16, (0.1, 0.6), 0.06
WALL_WAVES, WALL_LENGTHS, WALL_CONTRAST, TILE = 24, (0.3, 4.0), 0.15, 1.6
# The lamp that throws shadows stands so far away; a shadow begins so far behind what throws it.
LAMP_DISTANCE, SHADOW_BIAS = 5.0, 0.01
# Of a camera: standard deviation of its blur in pixels, of the part and of the walls, which lie out of focus; one
# picture in so many shaken, over so many pixels; standard deviation of exposure in stops and of noise, of full scale.
BLUR, DEFOCUS, SHAKEN, SHAKE, EXPOSURE, NOISE = (0.4, 1.0), 3.0, 8, 5, 0.15, 0.012
# Rounds of r = r' / (1 + k1 r^2), each of which leaves less than a tenth of the error: |k1| is below .2.
INVERSE = 12


@dataclass(frozen=True)
class Scene:
    """A part in its room: what all of its photographs show alike."""

    mesh: Mesh
    colours: np.ndarray
    prints: tuple[np.ndarray, np.ndarray]
    walls: tuple[np.ndarray, np.ndarray]
    tones: np.ndarray
    lamp: tuple[View, Buffer]


def scene_of(mesh: Mesh, rng: Generator) -> Scene:
    """The part, printed and lit, in a room of its own."""
    colours = face_colours(rng, int(mesh.face.max()) + 1)
    tones = rng.uniform(0.25, 0.8, (256, 1)) + rng.uniform(-0.12, 0.12, (256, 3))
    lamp = _towards(CENTRE, CENTRE + LAMP_DISTANCE * LAMPS[0] / np.linalg.norm(LAMPS[0]))
    prints, walls = _waves(rng, WAVES, LENGTHS), _waves(rng, WALL_WAVES, WALL_LENGTHS)
    return Scene(mesh, colours, prints, walls, tones, (lamp, rasterise(mesh, lamp)))


def photograph(scene: Scene, view: View, rng: Generator, k1: float = 0.0) -> np.ndarray:
    """One photograph (SIZE, SIZE, 3) in 0..1, by a lens with this radial distortion."""
    buffer = rasterise(scene.mesh, view)
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    behind = gaussian_filter(_walls(scene, view.eye, _rays(view, x, y)), (DEFOCUS, DEFOCUS, 0))
    image = behind.repeat(SAMPLES, 0).repeat(SAMPLES, 1)
    row, column = np.nonzero(buffer.triangle >= 0)
    plane = buffer.planes[buffer.triangle[row, column]]
    inverse = (plane * np.column_stack([column + 0.5, row + 0.5, np.ones(len(row))])).sum(1)
    rays = _rays(view, (column + 0.5) / SAMPLES, (row + 0.5) / SAMPLES)
    points = view.eye + rays / inverse[:, None]
    normals, index = normals_of(buffer, scene.mesh, view)
    lambert = np.clip(normals @ LAMPS.T, 0, 1) * STRENGTHS
    lambert[:, 0] *= _lit(scene.lamp, points)
    light = AMBIENT + HEAD * np.clip(normals @ -view.axes[2], 0, 1) + lambert.sum(1)
    printed = 1 + CONTRAST * _pattern(scene.prints, points)
    image[row, column] = light[:, None] * printed[:, None] * scene.colours[buffer.face[index]]
    if k1:
        image = _bent(image, k1)
    picture = image.reshape(SIZE, SAMPLES, SIZE, SAMPLES, 3).mean((1, 3))
    return _taken(picture, rng)


def _bent(image: np.ndarray, k1: float) -> np.ndarray:
    """What the lens makes of a straight picture; beyond its border lies more of the same."""
    side = len(image)
    y, x = (np.mgrid[:side, :side] + 0.5) / SAMPLES - SIZE / 2
    shown = np.hypot(x, y) / FOCAL
    straight = shown.copy()
    for _ in range(INVERSE):
        straight = shown / (1 + k1 * straight**2)
    places = [SAMPLES * (axis / (1 + k1 * straight**2) + SIZE / 2) - 0.5 for axis in (y, x)]
    return np.stack([map_coordinates(image[..., c], places, order=1, mode="nearest") for c in range(3)], -1)


def _rays(view: View, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The directions, 1 deep, in which the camera sees pixels."""
    local = np.stack([(x - SIZE / 2) / FOCAL, (y - SIZE / 2) / FOCAL, np.ones_like(x)], -1)
    return local @ view.axes


def _walls(scene: Scene, eye: np.ndarray, rays: np.ndarray) -> np.ndarray:
    """What the walls look like along these rays: tiles of many tones under a soft pattern."""
    with np.errstate(divide="ignore"):
        along = (np.sign(rays) * ROOM - (eye - CENTRE)) / rays
    hit = eye - CENTRE + rays * along.min(-1, keepdims=True)
    tile = np.floor(hit / TILE + 0.5).astype(int)
    tone = scene.tones[(tile @ np.array([7, 31, 101])) % len(scene.tones)]
    return np.clip(tone * (1 + WALL_CONTRAST * _pattern(scene.walls, hit)[..., None]), 0, 1)


def _waves(rng: Generator, count: int, lengths: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Plane waves in random directions: their wave vectors (3, count) and phases."""
    direction = rng.normal(size=(count, 3))
    length = np.exp(rng.uniform(*np.log(lengths), count))
    vectors = 2 * np.pi * direction / np.linalg.norm(direction, axis=1, keepdims=True) / length[:, None]
    return vectors.T, rng.uniform(0, 2 * np.pi, count)


def _pattern(waves: tuple[np.ndarray, np.ndarray], points: np.ndarray) -> np.ndarray:
    """The sum of the waves at points, with variance 1."""
    total = np.zeros(points.shape[:-1], np.float32)
    for vector, phase in zip(waves[0].T, waves[1], strict=True):
        total += np.sin((points @ vector + phase).astype(np.float32))
    return total * np.sqrt(2 / len(waves[1]))


def _lit(lamp: tuple[View, Buffer], points: np.ndarray) -> np.ndarray:
    """Whether the lamp shines on points: nothing that it sees lies before them."""
    view, buffer = lamp
    pixels, depth = view.project(points)
    place = np.clip(np.floor(pixels * SAMPLES).astype(int), 0, SIZE * SAMPLES - 1)
    triangle = buffer.triangle[place[:, 1], place[:, 0]]
    at = np.column_stack([place + 0.5, np.ones(len(points))])
    first = (buffer.planes[triangle] * at).sum(1)
    return (triangle < 0) | (1 / np.maximum(first, 1e-9) > depth - SHADOW_BIAS)


def _towards(target: np.ndarray, eye: np.ndarray) -> View:
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return View(eye, np.array([right, np.cross(forward, right), forward]))


def _taken(picture: np.ndarray, rng: Generator) -> np.ndarray:
    """The picture as a hand-held camera takes it."""
    picture = gaussian_filter(picture, (*[rng.uniform(*BLUR)] * 2, 0))
    angle, shaken = rng.uniform(0, np.pi), rng.integers(SHAKEN) == 0
    if shaken:
        picture = convolve(picture, _streak(angle)[..., None])
    picture = picture * 2 ** rng.normal(0, EXPOSURE)
    return np.clip(picture + rng.normal(0, NOISE, picture.shape), 0, 1)


def _streak(angle: float) -> np.ndarray:
    """The kernel of a shake over SHAKE pixels in this direction."""
    kernel = np.zeros((SHAKE, SHAKE))
    for t in np.linspace(-0.5, 0.5, 8 * SHAKE):
        at = (SHAKE - 1) * (0.5 + t * np.array([np.sin(angle), np.cos(angle)]))
        low = np.minimum(np.floor(at).astype(int), SHAKE - 2)
        part = at - low
        kernel[low[0] : low[0] + 2, low[1] : low[1] + 2] += np.outer([1 - part[0], part[0]], [1 - part[1], part[1]])
    return kernel / kernel.sum()
