"""The scale of a world as a user gives it: a distance, and what it lies between."""


def check_scale(scale: float | None, between: tuple[str, str] | None) -> None:
    """Sees that both are given, or neither, and that they can be a distance.

    Raises:
        ValueError: they cannot.
    """
    if scale is not None and not scale > 0:
        raise ValueError(f"scale must be positive, got {scale}")
    if between is not None and between[0] == between[1]:
        raise ValueError(f"between must name two different places, got {between[0]!r} twice")
    if (scale is None) != (between is None):
        raise ValueError("scale and between belong together: the distance, and the two places it lies between")
