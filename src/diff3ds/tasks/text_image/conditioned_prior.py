"""A prior that has been told what to draw: what `diff3ds text` and `diff3ds image` each make of theirs."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import torch

from diff3ds.guidance.denoiser import Denoiser
from diff3ds.recognition.picture_colors import PictureColors
from diff3ds.sketch import DEFAULT_WIDTH
from diff3ds.tasks.exact_prior.exemplars import WIDTH, Color, Exemplars
from diff3ds.tasks.exact_prior.sketch_folder import SketchFolder, identity_of
from diff3ds.tasks.small_prior.small_prior import Trained
from diff3ds.tasks.text_image.redraw import Redrawing
from diff3ds.tasks.text_image.reference_view import Reference
from diff3ds.tasks.text_image.run_spec import AnyRun, PresetName


@dataclass(frozen=True)
class Network:
    """The network of a prior.

    Attributes:
        weights: where they came from, for run.json.
        device: on which it computes.
        precision: in which it computes: float16, bfloat16, float32.
    """

    weights: Mapping[str, object]
    device: torch.device
    precision: str

    @property
    def record(self) -> dict[str, object]:
        """The entries of run.json about it."""
        return {**self.weights, "device": str(self.device), "precision": self.precision}


@dataclass(frozen=True, eq=False)
class BuiltIn:
    """How the priors that are built in draw.

    They know small pictures with thick strokes; the results have thin ones.

    Attributes:
        start_color: of the strokes at the start, which is what the prior was shown, straight RGB; None is black.
        color: of the results, straight RGB; None is black.
        redrawing: what the result is drawn again with; None for a network, which has no members.
        picture: the colours of the picture that the results get instead; None if there are none.
    """

    start_color: Color | None
    color: Color | None
    redrawing: Redrawing | None = None
    picture: PictureColors | None = None


@dataclass(frozen=True, eq=False)
class ConditionedPrior:
    """A prior that has been told what to draw.

    Attributes:
        name: of the prior.
        denoiser: what all priors offer.
        told: what it was told beside the subject, for run.json; a resumed run must have the same.
        network: of the prior; a resumed run must have the same weights and precision, on any device. None: it has none.
        reference: the picture of the subject, which the sketch must match as well, or None.
        built_in: how a prior that is built in draws; None for all others.
    """

    name: str
    denoiser: Denoiser
    told: Mapping[str, object] = field(default_factory=dict)
    network: Network | None = None
    reference: Reference | None = None
    built_in: BuiltIn | None = None

    def redrawing(self, spec: AnyRun) -> Redrawing | None:
        """What the result is drawn again with, where the run leaves that to the command."""
        return self.built_in.redrawing if self.built_in and spec.redraws else None

    def preset(self, spec: AnyRun) -> PresetName:
        """The preset of a run whose options name none."""
        if self.redrawing(spec):
            return "brief"
        return "swift" if self.built_in else "paper"

    @property
    def width(self) -> float:
        """The width of strokes at the start where the options have none, as a fraction of the image height."""
        return WIDTH if self.built_in else DEFAULT_WIDTH

    @classmethod
    def of_exemplars(
        cls,
        known: Exemplars,
        folder: SketchFolder | None,
        spec: AnyRun,
        told: Mapping[str, object] | None = None,
        reference: Reference | None = None,
        picture: PictureColors | None = None,
    ) -> "ConditionedPrior":
        """The exact prior of a library: the built-in one, or that in a folder."""
        built_in = BuiltIn(known.color, known.color, Redrawing(known.meant, known.faces), picture)
        denoiser = known.prior(spec.width(WIDTH))
        return cls("exemplar", denoiser, {**(told or {}), **identity_of(folder)}, None, reference, built_in)

    @classmethod
    def of_small(
        cls,
        small: Trained,
        denoiser: Denoiser,
        color: Color | None,
        told: Mapping[str, object] | None = None,
        reference: Reference | None = None,
        picture: PictureColors | None = None,
    ) -> "ConditionedPrior":
        """The small network, which was shown black strokes only."""
        network = Network({"weights_sha256": small.digest}, small.device, small.precision)
        return cls("small", denoiser, told or {}, network, reference, BuiltIn(None, color, None, picture))
