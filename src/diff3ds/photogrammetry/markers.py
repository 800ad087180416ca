"""Corners of printed ArUco markers in the world of the cameras that show them: `--between aruco:7:0 aruco:7:1`."""

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from diff3ds._shapes import Array, Float, Tensor
from diff3ds.formats.orientation import load_of_size
from diff3ds.transforms import View

# The dictionary of the markers: the smallest of OpenCV's, which is read from the smallest prints.
DICTIONARY = "DICT_4X4_50"
PLACE = re.compile(r"aruco:([0-9]{1,2}):([0-3])")
# Views that must show a corner, and how far it may lie from their rays, of the distance to the cameras. [empirical]
LEAST_VIEWS, FARTHEST = 2, 0.01
# [degrees; empirical] Rays that are turned by less, root mean square about their mean, do not say how far their meeting
# is: of two that are twice so much apart, a third of a pixel moves it by some per cent.
LEAST_TURN = 1.0
# Rounds that take a lens's distortion out of a direction: each leaves a small part of what the last left.
ROUNDS = 30


def is_marker(name: str) -> bool:
    """Whether a name is that of a marker's corner: aruco:ID:CORNER, with 0 to 49 and 0 to 3."""
    return PLACE.fullmatch(name) is not None


def require_opencv(between: Sequence[str] | None) -> None:
    """Raises ImportError where these places are corners of markers, and OpenCV is not installed."""
    if any(map(is_marker, between or ())):
        _detector()


def marker_corners(views: Sequence[View], names: Sequence[str]) -> list[Float[Tensor, " 3"]]:
    """Where the corners of markers are: nearest to the rays of all views that show them, less those that miss.

    Args:
        views: of photographs.
        names: as `is_marker` has them; corner 0 is at the top left of the marker as it is printed, the next ones follow
            clockwise.

    Raises:
        ImportError: OpenCV is not installed.
        ValueError: no such marker in two views, or their rays do not meet; a photograph that cannot be read.
    """
    if not names:
        return []
    detector = _detector()
    wanted = [tuple(map(int, match.groups())) for name in names if (match := PLACE.fullmatch(name))]
    rays: list[list[tuple[Array, Array]]] = [[] for _ in wanted]
    for view in views:
        shown = _shown(detector, view)
        for place, (number, corner) in enumerate(wanted):
            if number in shown:
                rays[place].append(_ray(view, shown[number][corner]))
    return [_meeting(name, some) for name, some in zip(names, rays, strict=True)]


def _detector() -> Any:
    try:
        import cv2
    except ImportError as error:
        raise ImportError('markers are found by OpenCV: pip install "diff3ds[markers]"') from error
    settings = cv2.aruco.DetectorParameters()
    # By lines along the sides, which leaves no bias; the other ways see markers a percent or two too small.
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY)), settings)


def _shown(detector: Any, view: View) -> dict[int, Float[Array, "4 2"]]:
    """The corners of the markers in a photograph, pixels, centres of pixels at half integers."""
    image = load_of_size(view.picture, view.size, "the cameras say")[..., :3].mean(-1)
    corners, numbers, _ = detector.detectMarkers((image * 255).round().to(torch.uint8).numpy())
    if numbers is None:
        return {}
    found = [np.asarray(some, np.float64).reshape(4, 2) for some in corners]
    return dict(zip(np.ravel(numbers).tolist(), found, strict=True))


def _ray(view: View, pixel: Float[Array, " 2"]) -> tuple[Float[Array, " 3"], Float[Array, " 3"]]:
    """The centre of a camera, and the unit vector from it towards what a pixel shows."""
    lens = view.intrinsics
    bent = ((torch.from_numpy(pixel) - lens[:2, 2]) / torch.stack([lens[0, 0], lens[1, 1]])).double()
    straight = bent.clone()
    for _ in range(ROUNDS):
        straight = straight + bent - torch.stack(view.distortion.bent(straight[0], straight[1]))
    turn = view.world_to_camera[:3, :3].double().numpy()
    direction = turn.T @ np.array([*straight.tolist(), 1.0])
    return -turn.T @ view.world_to_camera[:3, 3].double().numpy(), direction / np.linalg.norm(direction)


def _meeting(name: str, rays: list[tuple[Array, Array]]) -> Float[Tensor, " 3"]:
    """The point nearest to most of these rays."""
    if len(rays) < LEAST_VIEWS:
        raise ValueError(
            f"between: {name} is seen in {len(rays)} photographs, and {LEAST_VIEWS} are needed: markers are those of "
            f"OpenCV's {DICTIONARY}, printed with a white margin, and flat"
        )
    centers, directions = (np.stack(some) for some in zip(*rays, strict=True))
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    kept = np.ones(len(rays), bool)
    for _ in range(3):
        point = np.linalg.lstsq(across[kept].sum(0), np.einsum("vij,vj->i", across[kept], centers[kept]), rcond=None)[0]
        off = np.linalg.norm(np.einsum("vij,vj->vi", across, point - centers), axis=1)
        off /= np.linalg.norm(point - centers, axis=1)
        # Wrong readings lie far beside.
        kept = off <= max(3 * float(np.median(off)), 1e-9)
    if float(np.median(off)) > FARTHEST:
        raise ValueError(f"between: the photographs see {name} at places that do not fit together: are there two?")
    turned = np.degrees(np.sqrt(max(0.0, np.linalg.eigvalsh(across[kept].mean(0))[0])))
    if not turned >= LEAST_TURN:
        raise ValueError(
            f"between: {name} is seen from one direction only ({turned:.1f} degrees of turn, {LEAST_TURN:g} are "
            "needed): show it in photographs from several sides"
        )
    return torch.from_numpy(np.asarray(point))
