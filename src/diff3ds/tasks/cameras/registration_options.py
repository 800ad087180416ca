"""Options of `diff3ds cameras`."""

from dataclasses import dataclass
from typing import Literal

from diff3ds._settings import require_finite
from diff3ds.photogrammetry.scale_options import check_scale

# Whether pictures follow on each other, as the frames of a film and of a turntable do.
Order = Literal["auto", "sequence", "any"]
Up = Literal["auto", "keep"]


@dataclass(frozen=True)
class RegistrationOptions:
    """Options of `diff3ds cameras`.

    Attributes:
        order: sequence compares each photograph with those that follow it by name, any with all others, which takes
            long for many; auto takes sequence for more than 60 whose names end in numbers.
        size: features are looked for in photographs reduced to this many pixels along the longer side.
        features: of each photograph, at most about so many are compared.
        up: auto turns the world so that z points up, as the photographs were held; keep leaves that of a project.
        scale: with --between, a distance in units of yours, such as millimetres.
        between: what lies so far apart: two cameras by the names of their photographs, two corners of printed ArUco
            markers as aruco:7:0 (marker 7, corner 0 to 3), or, of a project, two points in its world as X,Y,Z.
    """

    order: Order = "auto"
    size: int = 1024
    features: int = 2048
    up: Up = "auto"
    scale: float | None = None
    between: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        require_finite(self)
        for name in ("size", "features"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")
        check_scale(self.scale, self.between)
