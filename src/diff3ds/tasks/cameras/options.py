"""Options of `diff3ds cameras`."""

from dataclasses import dataclass
from typing import Literal

from diff3ds._settings import require_finite

# Whether pictures follow on each other, as the frames of a film and of a turntable do.
Order = Literal["auto", "sequence", "any"]
Up = Literal["auto", "keep"]


@dataclass(frozen=True)
class CamerasOptions:
    """Options of `diff3ds cameras`.

    Attributes:
        order: sequence compares each photograph with those that follow it by name, any with all others, which takes
            long for many; auto takes sequence for more than 60 whose names end in numbers.
        size: features are looked for in photographs reduced to this many pixels along the longer side.
        features: of each photograph, at most about so many are compared.
        up: auto turns the world so that z points up, as the photographs were held; keep leaves that of a project.
        scale: with --between, the distance of two cameras in units of yours, such as millimetres.
        between: names of the two photographs.
    """

    order: Order = "auto"
    size: int = 1024
    features: int = 2048
    up: Up = "auto"
    scale: float | None = None
    between: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        require_finite(self)
        for name in ("size", "features", "scale"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ValueError(f"{name} must be positive, got {value}")
        if self.between is not None and self.between[0] == self.between[1]:
            raise ValueError(f"between must name two different photographs, got {self.between[0]!r} twice")
        if (self.scale is None) != (self.between is None):
            raise ValueError("scale and between belong together: the distance, and the two photographs it lies between")
