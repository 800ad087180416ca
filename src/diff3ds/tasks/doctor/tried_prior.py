"""A prior that is told of a chair, to be tried: its weights as the commands that draw load them."""

from collections.abc import Callable
from dataclasses import dataclass

from diff3ds._shapes import Float, Tensor
from diff3ds.guidance.denoiser import Denoiser
from diff3ds.guidance.networks.zero123 import ReferencePose
from diff3ds.guidance.recipe import USUAL, Recipe
from diff3ds.library.phrase import parse
from diff3ds.tasks.doctor.trial_options import TrialOptions
from diff3ds.tasks.exact_prior.exemplars import WIDTH
from diff3ds.tasks.small_prior.small_prior import trained
from diff3ds.tasks.text_image.conditioned_prior import Network
from diff3ds.tasks.text_image.prior_options import FOR_PHRASES, FOR_PICTURES
from diff3ds.tasks.text_image.priors import load_for_phrase, load_for_picture, loaded
from diff3ds.tasks.text_image.run_spec import PRESETS, ScoreOptions
from diff3ds.tasks.text_image.subject import Phrase, Picture

THING = "chair"
# What networks that know photographs are told of a drawing.
PHRASE = f"a line drawing of a {THING} on a white background"
# Of their drawings: two to five pixels of 256 to 768, of which a latent holds 8. Those of the small prior are its own.
DRAWN_WIDTH = 0.02
# Pixels of the picture that Zero123 is shown, as its network takes it.
SHOWN_SIZE = 256
# A picture of the thing, of so many pixels, from where.
Shown = Callable[[int, ReferencePose], Float[Tensor, "S S 3"]]


@dataclass(frozen=True, eq=False)
class TriedPrior:
    """A prior that has been told of the thing.

    Attributes:
        name: of it.
        denoiser: what all priors offer.
        network: where its weights came from, and how it computes.
        recipe: of a run, with the preset that the prior has by default.
        steps: of that run.
        sees_poses: whether it is told where its pictures were taken from.
    """

    name: str
    denoiser: Denoiser
    network: Network
    recipe: Recipe
    steps: int
    sees_poses: bool


def load_tried(options: TrialOptions, shown: Shown) -> TriedPrior:
    """Loads a prior, and tells it of the thing, in words or by a picture.

    Raises:
        ValueError: no prior is named; weights of another model; no such device, or too little memory there.
        ImportError, FileNotFoundError: the extra or the weights are not here; says how to get them.
    """
    if options.prior is None:
        raise ValueError("no prior is named that is to be tried: --try small, for example")
    name, given = options.prior, options.of_prior()
    preset, pull = PRESETS["paper"], Picture.GUIDANCE if name in FOR_PICTURES else Phrase.GUIDANCE
    denoiser: Denoiser
    if name in FOR_PHRASES:
        denoiser = known = load_for_phrase(name, Phrase(PHRASE), given, USUAL)
        network = loaded(name, given, known.unet)
    elif name in FOR_PICTURES:
        pose = ReferencePose()
        denoiser = pictured = load_for_picture(name, shown(SHOWN_SIZE, pose), pose, given, USUAL)
        network = loaded(name, given, pictured.unet)
    else:
        small, preset = trained(options.weights, options.device), PRESETS["swift"]
        denoiser = small.asked(parse(f"a {THING}"))
        network = Network({"weights": small.source}, small.device, small.precision)
    recipe = ScoreOptions().recipe(denoiser.group, preset.guidance or pull)
    return TriedPrior(name, denoiser, network, recipe, preset.steps, "stable-diffusion" not in name)


def drawn_width(name: str) -> float:
    """The width of the strokes of the drawings for this prior, as a fraction of the image height."""
    return DRAWN_WIDTH if name in (*FOR_PHRASES, *FOR_PICTURES) else WIDTH
