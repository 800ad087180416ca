"""What a run draws: a phrase, or the object in a picture, with the options that only one of the two has."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg

from diff3ds._settings import option_values, require_finite
from diff3ds.pictures.picture_options import PictureOptions


@dataclass(frozen=True)
class Phrase:
    """What to draw, in words.

    Attributes:
        phrase: What to draw, such as "a chair".
        negative: a phrase for what the sketch should not look like; by default MVDream's own, and none for others.
        suffix: appended to the phrase, such as ", 3d asset", with which MVDream was trained on things.
        perp_neg: keep stable-diffusion from drawing the front on every side, for twice the time.
        whole: tell a network a phrase of several things at once, instead of drawing one after the other and placing
            them.
    """

    # The paper's weight of classifier-free guidance for phrases.
    GUIDANCE: ClassVar[float] = 50.0

    phrase: Positional[str]
    negative: str | None = None
    suffix: str = ""
    perp_neg: bool = False
    whole: bool = False

    @property
    def record(self) -> dict[str, object]:
        """The entries of run.json about it, whatever the prior."""
        return {"phrase": self.phrase}


@dataclass(frozen=True)
class Picture:
    """What to draw, as a picture shows it.

    Attributes:
        picture: A photograph or drawing of one object.
        cut: where the object is, and how it is framed.
        view_elevation: from how high the picture was taken, degrees; within the elevations of the cameras, so that
            they come by. The built-in prior finds it by itself.
        reference_loss: weight of the difference between the sketch and the picture, seen from where it was taken,
            beside the prior's loss; by default none, as in the paper, and 3000 with the built-in prior.
        shows: for the built-in prior: what the picture shows, a phrase such as "a chair with armrests"; by default it
            is recognised.
    """

    # The paper's weight of classifier-free guidance for pictures.
    GUIDANCE: ClassVar[float] = 7.5

    picture: Positional[Path]
    cut: Annotated[PictureOptions, arg(name="")] = field(default_factory=PictureOptions)
    view_elevation: float = 0.0
    reference_loss: float | None = None
    shows: str | None = None

    def __post_init__(self) -> None:
        require_finite(self)
        if not -90 < self.view_elevation < 90:
            raise ValueError(f"view_elevation must lie in (-90, 90) degrees, got {self.view_elevation}")
        if self.reference_loss is not None and not self.reference_loss >= 0:
            raise ValueError(f"reference_loss must not be negative, got {self.reference_loss}")

    @property
    def record(self) -> dict[str, object]:
        """The entries of run.json about it, whatever the prior."""
        return {name: str(value) if isinstance(value, Path) else value for name, value in option_values(self).items()}
