"""COLMAP's camera models: what their parameters say of intrinsics and lens."""

from collections.abc import Sequence

from diff3ds._shapes import Float, Tensor
from diff3ds.distortion import Distortion
from diff3ds.frames import ADVICE
from diff3ds.photogrammetry.shot import checked, pinhole

# By number, as binary files have them: name, and how many parameters follow (COLMAP's documentation, camera models).
MODELS = {
    0: ("SIMPLE_PINHOLE", 3),
    1: ("PINHOLE", 4),
    2: ("SIMPLE_RADIAL", 4),
    3: ("RADIAL", 5),
    4: ("OPENCV", 8),
    5: ("OPENCV_FISHEYE", 8),
    6: ("FULL_OPENCV", 12),
    7: ("FOV", 5),
    8: ("SIMPLE_RADIAL_FISHEYE", 4),
    9: ("RADIAL_FISHEYE", 5),
    10: ("THIN_PRISM_FISHEYE", 12),
    11: ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    12: ("SIMPLE_DIVISION", 4),
    13: ("DIVISION", 5),
    14: ("SIMPLE_FISHEYE", 3),
    15: ("FISHEYE", 4),
    16: ("EUCM", 6),
    17: ("EQUIRECTANGULAR", 2),
}
COUNTS = dict(MODELS.values())
# Those with one focal length for both axes.
ONE_FOCAL = ("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "SIMPLE_RADIAL_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_FISHEYE")
READ = (*ONE_FOCAL, "PINHOLE", "OPENCV", "FULL_OPENCV", "OPENCV_FISHEYE", "THIN_PRISM_FISHEYE", "FISHEYE")


def camera_of(where: str, model: str, parameters: Sequence[float]) -> tuple[Float[Tensor, "3 3"], Distortion]:
    """Intrinsics and lens.

    Args:
        where: for the error.
        model: its name.
        parameters: in COLMAP's order.

    Raises:
        ValueError: a model that is not known, or of another kind; another number of parameters; numbers that are not
            finite; no focal length.
    """
    if model not in READ:
        raise ValueError(f"{where}: the camera model {model!r:.40} is not one of {', '.join(READ)}; {ADVICE}")
    if len(parameters) != COUNTS[model]:
        raise ValueError(f"{where}: {model} has {COUNTS[model]} parameters, got {len(parameters)}")
    first = 1 if model in ONE_FOCAL else 2
    fx, fy = parameters[0], parameters[first - 1]
    intrinsics = pinhole(where, fx, fy, *parameters[first : first + 2])
    rest = tuple(parameters[first + 2 :])
    fisheye = "FISHEYE" in model
    lens = Distortion(rest, fisheye=fisheye)
    if model in ("OPENCV", "FULL_OPENCV", "THIN_PRISM_FISHEYE"):
        # k1, k2, p1, p2, then k3 and what differs.
        k1, k2, p1, p2, *more = rest
        lens = Distortion((k1, k2, *more[:1]), (p1, p2), tuple(more[1:]))
        if fisheye:
            lens = Distortion((k1, k2, *more[:2]), (p1, p2), prism=(more[2], more[3]), fisheye=True)
    return intrinsics, checked(where, lens)
