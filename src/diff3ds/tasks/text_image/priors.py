"""Which prior a run has: known ones by name, others by what their weights are."""

from collections.abc import Callable
from typing import Any

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.guidance.device_choice import pick_device
from diff3ds.guidance.networks.mvdream import NEGATIVE, VIEWS, MVDream, find_words, load_mvdream
from diff3ds.guidance.networks.prompts import check_phrase
from diff3ds.guidance.networks.stable_diffusion import StableDiffusion, load_stable_diffusion
from diff3ds.guidance.networks.stable_zero123 import load_stable_zero123
from diff3ds.guidance.networks.zero123 import ReferencePose, Zero123, load_zero123
from diff3ds.guidance.recipe import Work
from diff3ds.tasks.text_image.conditioned_prior import Network
from diff3ds.tasks.text_image.prior_options import BUILT_IN, PriorOptions, is_place, require_name
from diff3ds.tasks.text_image.subject import Phrase
from diff3ds.weights import single_file
from diff3ds.weights.catalog import KNOWN
from diff3ds.weights.locate import find, locate
from diff3ds.weights.weight_options import Source

# Channels of the UNet of a prior that takes the picture's latents beside the noisy ones.
PICTURE_CHANNELS = 8
# The names of the best networks in sentences.
CALLED = {"mvdream": "MVDream", "zero123": "Zero123-XL"}


def choose_prior(options: PriorOptions, networks: tuple[str, ...], say: Callable[[str], None]) -> str:
    """The name of the prior that the options name or point at; without either, the best that can work here.

    Args:
        networks: the priors with weights that the command can use, the best first.
        say: told which prior is taken, where none was named, and why.

    Raises:
        ValueError: no such prior, or one of another kind; weights that are none of them.
        FileNotFoundError: weights that are not on this disk.
    """
    if options.prior is None:
        name, reason = best_prior(networks[0], options.device)
        say(f"prior: {reason}")
        return name
    name = kind_of(options) if is_place(options.prior) else options.prior
    require_name(name, (*networks, *BUILT_IN))
    return name


def kind_of(options: PriorOptions) -> str:
    """Which prior weights belong to, by their configuration, or by the names in a single file.

    Stable-Zero123 has the weights' shapes of Zero123, but other poses and another licence: its name must say so.
    """
    source = options.source()
    assert source is not None
    found = locate(source)
    if found is None:
        raise FileNotFoundError(
            f"{source} is not on this disk. Get it: diff3ds fetch PRIOR --weights {source}, where PRIOR is what it is: "
            f"{', '.join(KNOWN)}"
        )
    if found.path.is_file():
        names = single_file.names_in(found.path, found.trust_pickle)
        pictures = any(name.startswith(single_file.PROJECTION) for name in names)
        return _of_pictures(source) if pictures else "mvdream"
    if not (found.path / "unet").is_dir():
        raise FileNotFoundError(f"{source} has no folder unet: weights are read in the layout of diffusers")
    config = found.config("unet")
    if config.get("in_channels") == PICTURE_CHANNELS:
        return _of_pictures(source)
    camera = config.get("_class_name") != "UNet2DConditionModel" or config.get("class_embed_type")
    return "mvdream" if camera or (found.path / "camera_proj").is_dir() else "stable-diffusion"


def _of_pictures(source: Source) -> str:
    return "stable-zero123" if "stable" in str(source).lower() else "zero123"


def has_weights(name: str) -> bool:
    """Whether the known weights of a prior are on this disk and can be loaded."""
    try:
        find(name)
    except (ImportError, FileNotFoundError):
        return False
    return True


def best_prior(name: str, device: str) -> tuple[str, str]:
    """A network where it can work, else the built-in prior, and why it is this one."""
    called = CALLED[name]
    if pick_device(device).type == "cpu":
        return "exemplar", f"the built-in prior, because {called} has no GPU here"
    if not has_weights(name):
        return "exemplar", f"the built-in prior, because {called}'s weights are not here (diff3ds fetch {name})"
    return name, f"{called}, whose weights and a GPU are here"


def load_for_phrase(name: str, subject: Phrase, options: PriorOptions, work: Work) -> MVDream | StableDiffusion:
    """A network that knows phrases.

    Raises:
        ImportError, FileNotFoundError, ValueError: as its loader.
    """
    source, device, precision = options.source(), options.device, options.precision
    phrase, negative = check_phrase(subject.phrase) + subject.suffix, subject.negative
    if name == "mvdream":
        if subject.perp_neg:
            raise ValueError("perp_neg is for stable-diffusion: MVDream knows its cameras")
        if work.views % VIEWS:
            said = f"the views that MVDream sees at once, got {work.views}"
            raise ValueError(f"batch must be a multiple of {VIEWS}, {said}")
        negative = NEGATIVE if negative is None else negative
        return load_mvdream(phrase, negative, source, device=device, precision=precision, work=work)
    return load_stable_diffusion(
        phrase,
        negative or "",
        source,
        prior=name,
        perp_neg=subject.perp_neg,
        device=device,
        precision=precision,
        work=work,
    )


def load_for_picture(
    name: str, picture: Float[Tensor, "S S 3"], pose: ReferencePose, options: PriorOptions, work: Work
) -> Zero123:
    """A network that knows how a picture looks from elsewhere.

    Raises:
        ImportError, FileNotFoundError, ValueError: as its loader.
    """
    load = load_stable_zero123 if name == "stable-zero123" else load_zero123
    picture = picture.to(torch.float32)
    return load(picture, pose, options.source(), device=options.device, precision=options.precision, work=work)


def loaded(name: str, options: PriorOptions, unet: Any) -> Network:
    """The network of a prior: which weights it has, of which a single file lacks the text's, and how it computes."""
    checkpoint = find(name, options.source())
    weights: dict[str, object] = {"weights": checkpoint.origin()}
    if checkpoint.path.is_file() and name == "mvdream":
        weights["text_encoder"] = find_words(checkpoint).origin()
    return Network(weights, torch.device(unet.device), str(unet.dtype).removeprefix("torch."))
