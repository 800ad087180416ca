"""The network that names what lines show, and from where it is seen: a small convolutional one, with its weights."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import torch
from torch import nn

from diff3ds._shapes import Float, Tensor
from diff3ds._tensor_files import write_tensors
from diff3ds.recognition.picture_lines import Lines

# The picture that the network sees: pixels; the longer side of the thing and the width of lines as fractions of it.
SIZE, THING, LINE = 64, 54 / 64, 2 / 64
# Azimuths and elevations that it tells apart, degrees.
AZIMUTHS, ELEVATIONS = tuple(15.0 * i for i in range(24)), (0.0, 15.0, 30.0)
# Channels of the layers; features before the heads.
CHANNELS, FEATURES = (24, 48, 96, 128, 192), 256
# Degrees by which a drawing is turned: what the network makes of its kind is averaged over all. Chosen on drawings that
# had no part in training, of which it takes a tenth more so, where as much of what is nothing is taken.
TURNS = (0.0, 5.0, -5.0, 8.0, -8.0)
WEIGHTS = Path(__file__).with_name("drawings.safetensors")
# Kept in the file: a condition of the licence.
SOURCE = "Trained on drawings of Quick, Draw! by Google (CC BY 4.0), simplified, and on the library of diff3ds."


class DrawingNetwork(nn.Module):
    """Five layers of convolutions and three heads: what it is, azimuth, elevation."""

    def __init__(self, classes: int) -> None:
        """Makes one that is not trained.

        Args:
            classes: that it tells apart: kinds first, then things that are none of them.
        """
        super().__init__()
        layers: list[nn.Module] = []
        before = 1
        for i, channels in enumerate(CHANNELS):
            # The first halves the picture with its stride, the others but the last with maxima.
            size, stride = (5, 2) if i == 0 else (3, 1)
            layers += [
                nn.Conv2d(before, channels, size, stride, size // 2, bias=False),
                nn.BatchNorm2d(channels),
                nn.ReLU(),
            ]
            if 0 < i < len(CHANNELS) - 1:
                layers.append(nn.MaxPool2d(2))
            before = channels
        side = SIZE // 2 ** (len(CHANNELS) - 1)
        self.layers = nn.Sequential(*layers, nn.Flatten())
        self.features = nn.Sequential(
            nn.Dropout(0.4), nn.Linear(before * side * side, FEATURES), nn.ReLU(), nn.Dropout(0.2)
        )
        self.kind = nn.Linear(FEATURES, classes)
        self.azimuth = nn.Linear(FEATURES, len(AZIMUTHS))
        self.elevation = nn.Linear(FEATURES, len(ELEVATIONS))

    def forward(self, pictures: Float[Tensor, "B 1 S S"]) -> tuple[Tensor, Tensor, Tensor]:
        """Logits of the classes, of azimuths, and of elevations."""
        found = self.features(self.layers(pictures))
        return self.kind(found), self.azimuth(found), self.elevation(found)


@dataclass(frozen=True, eq=False)
class Opinion:
    """What a network makes of a picture.

    Attributes:
        kinds: probabilities of its kinds and, last, of none of them.
        azimuths, elevations: logarithms of the probabilities of `AZIMUTHS` and `ELEVATIONS`.
    """

    kinds: Float[Tensor, " K"]
    azimuths: Float[Tensor, " A"]
    elevations: Float[Tensor, " E"]


@dataclass(frozen=True, eq=False)
class Trained:
    """A network that was trained.

    Attributes:
        network: its weights.
        kinds: names of the categories that it knows, in the order of its answers.
        temperature: what logits are divided by, so that it is right as often as it is sure.
        threshold: the least probability of a kind that is taken.
    """

    network: DrawingNetwork
    kinds: tuple[str, ...]
    temperature: float
    threshold: float

    def opinion(self, lines: Lines) -> Opinion:
        """What it makes of lines: turned a little too for their kind, as they are for the side that is seen."""
        pictures = np.stack([lines.turned(degrees).ink(SIZE, LINE, THING) for degrees in TURNS])
        kinds, azimuths, elevations = self.logits(torch.from_numpy(pictures)[:, None])
        likely = (kinds / self.temperature).softmax(1).mean(0)
        return Opinion(likely, azimuths.log_softmax(1)[0], elevations.log_softmax(1)[0])

    @torch.no_grad()
    def logits(self, pictures: Float[Tensor, "B 1 S S"]) -> tuple[Tensor, Tensor, Tensor]:
        """Logits of the kinds and of none of them, of azimuths, and of elevations.

        Those of the kinds are means over the pictures and their mirror images.
        """
        classes, azimuths, elevations = self.network(pictures)
        mirrored = self.network(pictures.flip(-1))[0]
        return (self._kinds(classes) + self._kinds(mirrored)) / 2, azimuths, elevations

    def _kinds(self, classes: Float[Tensor, "B C"]) -> Float[Tensor, "B K"]:
        """Logarithms of the probabilities of the kinds and, last, of all other classes together."""
        likely = classes.log_softmax(1)
        count = len(self.kinds)
        return torch.cat([likely[:, :count], likely[:, count:].logsumexp(1, keepdim=True)], 1)


def write_network(path: Path, trained: Trained, about: Mapping[str, object]) -> None:
    """Writes a network in half precision; `about` says how it was made."""
    known = {"kinds": trained.kinds, "temperature": trained.temperature, "threshold": trained.threshold}
    state = trained.network.state_dict()
    tensors = {name: value.half() if value.is_floating_point() else value for name, value in state.items()}
    write_tensors(path, tensors, {"diff3ds": json.dumps({**known, **about}), "source": SOURCE})


def read_network(path: Path) -> Trained:
    """Reads a network that `write_network` wrote."""
    from safetensors import safe_open

    with safe_open(path, "pt") as file:
        said = json.loads(file.metadata()["diff3ds"])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 (not a dict)
    network = DrawingNetwork(len(tensors["kind.bias"]))
    network.load_state_dict(tensors)
    return Trained(network.eval(), tuple(said["kinds"]), said["temperature"], said["threshold"])


@cache
def trained() -> Trained:
    """The network of the package."""
    return read_network(WEIGHTS)
