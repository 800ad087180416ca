"""The colours of a picture, given to the strokes that lie on its lines."""

from dataclasses import dataclass, replace

import numpy as np
import torch

from diff3ds._shapes import Float
from diff3ds.recognition.side_seen import PlacedLines, projected
from diff3ds.sketch import Sketch

# A colour is one where its channels differ by this; a picture has colours if so much of its lines has one. Empirical.
CHROMA, COLORED = 0.2, 0.05
# What is lighter than this, by the luma of ITU-R BT.601, is hard to see on white: it is made that dark. Empirical.
LIGHTEST, LUMA = 0.75, (0.299, 0.587, 0.114)


@dataclass(frozen=True, eq=False)
class PictureColors:
    """The colours along the lines of a picture where a camera sees them.

    Attributes:
        placed: lines that have colours.
    """

    placed: PlacedLines

    @classmethod
    def of(cls, placed: PlacedLines) -> "PictureColors | None":
        """Those of a picture; None if it is black and white, or gray."""
        chroma = np.ptp(placed.lines.colors, axis=1)
        return cls(placed) if (chroma > CHROMA).mean() > COLORED else None

    def __call__(self, sketch: Sketch) -> Sketch:
        """Every stroke in the colour of the lines that the camera sees it on: the one nearest to their median."""
        from scipy.spatial import cKDTree

        camera = self.placed.camera
        seen = (projected(sketch.segments().detach(), camera)[0] / camera.size[0]).double().numpy()
        _, nearest = cKDTree(self.placed.points).query(seen)
        along = self.placed.lines.colors[nearest]
        stroke = sketch.chains.stroke.numpy() if sketch.chains else np.arange(len(sketch))
        colors = np.stack([_middle(along[stroke == i].reshape(-1, 3)) for i in range(len(sketch))])
        # Lightness goes, the hue stays.
        colors *= np.minimum(1, LIGHTEST / np.maximum(colors @ np.array(LUMA), 1e-6))[:, None]
        return replace(sketch, color=torch.from_numpy(colors).to(sketch.color))


def _middle(colors: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, " 3"]:
    """One of the colours, not a mixture: the nearest to their median."""
    one: Float[np.ndarray, " 3"] = colors[np.abs(colors - np.median(colors, axis=0)).sum(1).argmin()]
    return one
