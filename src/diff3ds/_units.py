"""Units of length that files of 3D formats are written in."""

from typing import Literal, get_args

Unit = Literal["mm", "cm", "m", "in", "ft"]

# Of each unit in millimetres, exactly (the inch since 1959).
MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}


def check_unit(unit: str) -> None:
    """Raises ValueError for what is no unit."""
    if unit not in get_args(Unit):
        raise ValueError(f"unit must be one of {', '.join(get_args(Unit))}, got {unit!r}")
