"""What a refinement finds out about lenses: that their pictures are to be read with other numbers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch

from diff3ds.distortion import Distortion
from diff3ds.transforms import View


@dataclass(frozen=True)
class LensChange:
    """How lenses differ from what is said of them.

    Attributes:
        zoom: the factor of all focal lengths.
        k1: what is to be added to the first coefficient of radial distortion.
    """

    zoom: float = 1.0
    k1: float = 0.0

    def of(self, view: View) -> View:
        """The view with the lens as it is."""
        wider = torch.tensor([self.zoom, self.zoom, 1.0], dtype=torch.float64)  # columns: the principal point stays
        return replace(view, intrinsics=view.intrinsics * wider, distortion=view.distortion.with_more_k1(self.k1))


UNCHANGED = LensChange()


def shared_lens(views: Sequence[View]) -> Distortion | None:
    """The distortion of the one camera that has taken all pictures; None if there are several."""
    first = views[0]
    one = all(
        view.size == first.size
        and view.distortion == first.distortion
        and torch.allclose(view.intrinsics, first.intrinsics, rtol=1e-9, atol=1e-9)
        for view in views
    )
    return first.distortion if one else None
