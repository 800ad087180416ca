"""The small prior for a phrase or a picture: its weights, and what it is asked for."""

import hashlib
import importlib.util
from dataclasses import dataclass
from pathlib import Path

import torch

from diff3ds._shapes import Float, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance.built_in import small
from diff3ds.guidance.built_in.small import SmallDenoiser, View, Vocabulary, half_is_fast, ink, read_network
from diff3ds.guidance.built_in.small_network import SmallNetwork
from diff3ds.guidance.device_choice import pick_device
from diff3ds.library.phrase import Request, parse
from diff3ds.tasks.exact_prior.folder_phrase import Name, asked_of
from diff3ds.tasks.small_prior.prior_data import AXES, said, words

# The network's file in a checkout, and the package that carries it elsewhere (networks/pyproject.toml): it is three
# times as large as all else.
BESIDE, CARRIER = Path(small.__file__).with_name("small.safetensors"), "diff3ds_networks"
NOT_HERE = 'pip install "diff3ds[networks]", or train one: diff3ds prior train, then --weights FILE'


@dataclass(frozen=True, eq=False)
class Trained:
    """A network that was trained, and where it computes.

    Attributes:
        network: its weights.
        vocabulary: what it can be asked for.
        device: of the computation.
        source: the file it came from, for messages.
        digest: SHA-256 of that file.
    """

    network: SmallNetwork
    vocabulary: Vocabulary
    device: torch.device
    source: str
    digest: str

    @property
    def precision(self) -> str:
        """The precision in which it computes there."""
        return "bfloat16" if half_is_fast(self.device) else "float32"

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of the kinds of things that it was trained on."""
        return tuple(word for word in self.vocabulary.words if ": " not in word and word not in AXES)

    @property
    def is_of_the_library(self) -> bool:
        """Whether it was trained on the built-in library, as large as that was then, and not on a folder."""
        return {*self.vocabulary.words} <= {*words()}

    def understood(self, phrase: str) -> Request:
        """Reads a phrase by the library's grammar, or by that of the folder that the network was trained on.

        Raises:
            ValueError: the phrase is not understood.
        """
        if self.is_of_the_library:
            return parse(phrase)
        kinds: dict[str, list[str]] = {kind: [] for kind in self.kinds}
        for noun, _, rest in (word.partition(": ") for word in self.vocabulary.words if ": " in word):
            kinds.setdefault(noun, []).append(rest)
        return asked_of([Name(noun, tuple(rest), noun) for noun, rest in kinds.items()], phrase, self.source)

    def told(self, request: Request) -> Float[Tensor, " K"]:
        """What the network is told of one thing.

        Raises:
            ValueError: it was not trained on that.
        """
        return self.vocabulary.said(said(request))

    def asked(
        self, request: Request, seen: Float[Tensor, "1 S S 3"] | None = None, camera: Cameras | None = None
    ) -> SmallDenoiser:
        """The prior for one thing.

        Args:
            request: its category, attributes and proportions; the colour is the strokes' business.
            seen: a picture of the thing in the strokes of the built-in priors, black on white, of the network's size.
            camera: from where it was seen.

        Raises:
            ValueError: the request is for what it was not trained on.
        """
        view = None if seen is None or camera is None else View(ink(seen), camera)
        return SmallDenoiser(self.network, self.vocabulary, self.told(request), view, self.device)


def own_network() -> Path | None:
    """The file of the project's own network: a checkout has it, else the extra `networks`."""
    carrier = importlib.util.find_spec(CARRIER)
    folders = carrier.submodule_search_locations if carrier else None
    files = [BESIDE, *(Path(folder) / BESIDE.name for folder in folders or ())]
    return next((file for file in files if file.is_file()), None)


def trained(weights: str | None = None, device: str = "auto") -> Trained:
    """The network in a file, by default the project's own.

    Raises:
        FileNotFoundError: there are no weights.
        ValueError: they are no weights of a small prior; no such device.
    """
    path = Path(weights).expanduser() if weights else own_network()
    if path is None:
        raise FileNotFoundError(
            f"the small network is not installed: {NOT_HERE}. The exact prior needs no network: leave --prior small out"
        )
    network, vocabulary = read_network(path)
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return Trained(network, vocabulary, pick_device(device), str(path), digest)
