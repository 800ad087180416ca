"""What files of 3D formats are written in: units of length, tolerances, versions. Told without torch."""

import math
from typing import Literal, get_args

Unit = Literal["mm", "cm", "m", "in", "ft"]
# Of AutoCAD, whose files DXF files are.
DxfVersion = Literal["R2010", "R12"]

# Of each unit in millimetres, exactly (the inch since 1959).
MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}


def check_unit(unit: str) -> None:
    """Raises ValueError for what is no unit."""
    if unit not in get_args(Unit):
        raise ValueError(f"unit must be one of {', '.join(get_args(Unit))}, got {unit!r}")


def check_tolerance(tolerance: float | None) -> None:
    """Raises ValueError for what is no length that curves in a file may lie off those of a sketch."""
    if tolerance is not None and not 0 <= tolerance < math.inf:
        raise ValueError(f"tolerance must be at least 0 and finite, got {tolerance}")
