"""The small prior for a phrase or a picture: its weights, and what it is asked for."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance import small
from diff3ds.guidance.device import pick_device
from diff3ds.guidance.small import SmallDenoiser, View, ink, read_network
from diff3ds.library.phrase import Request, parse
from diff3ds.tasks.folder_phrase import Name, asked_of
from diff3ds.tasks.prior_data import AXES, said, words
from diff3ds.tasks.priors import PriorOptions

# Where the weights lie in a package that has them.
SHIPPED = Path(small.__file__).with_name("small.safetensors")


@dataclass(frozen=True, eq=False)
class Asked:
    """The network, asked for something.

    Attributes:
        denoiser: behind the protocol of all priors.
        identity: which weights, for run.json; a resumed run must have the same.
    """

    denoiser: SmallDenoiser
    identity: dict[str, object]


def asked_for(phrase: str, options: PriorOptions) -> Request:
    """What a phrase asks of the network: by the library's grammar, or that of the folder that it was trained on.

    Raises:
        FileNotFoundError, ValueError: as `ask`; the phrase is not understood.
    """
    path = _weights(options)
    known = read_network(path)[1].words
    if known == words():
        return parse(phrase)
    kinds: dict[str, list[str]] = {word: [] for word in known if ": " not in word and word not in AXES}
    for noun, _, rest in (word.partition(": ") for word in known if ": " in word):
        kinds[noun].append(rest)
    return asked_of([Name(noun, tuple(rest), noun) for noun, rest in kinds.items()], phrase, str(path))


def _weights(options: PriorOptions) -> Path:
    return Path(options.weights).expanduser() if options.weights else SHIPPED


def ask(
    request: Request, options: PriorOptions, seen: Float[Tensor, "1 S S 3"] | None = None, camera: Cameras | None = None
) -> Asked:
    """The small prior, for one thing.

    Args:
        request: its category, attributes and proportions; the colour is the strokes' business.
        options: weights, if they are not those of the package, and where it computes.
        seen: a picture of the thing in the strokes of the built-in priors, black on white, of the network's size.
        camera: from where it was seen.

    Raises:
        FileNotFoundError: there are no weights.
        ValueError: they are no weights of a small prior, or the request is for what it was not trained on.
    """
    path = _weights(options)
    network, vocabulary = read_network(path)
    given = vocabulary.said(said(request))
    view = None if seen is None or camera is None else View(ink(seen), camera)
    denoiser = SmallDenoiser(network, vocabulary, given, view, pick_device(options.device))
    return Asked(denoiser, {"weights_sha256": hashlib.sha256(path.read_bytes()).hexdigest()})
