"""The small prior: a network of this project that fits in the package, in pixel space, for four views at once."""

import json
import math
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds._tensor_files import write_tensors
from diff3ds.camera import Cameras
from diff3ds.guidance import formulas
from diff3ds.guidance.built_in.small_network import SmallNetwork
from diff3ds.guidance.built_in.small_shape import Shape
from diff3ds.guidance.denoiser import Branch, check_groups
from diff3ds.guidance.poses import spherical
from diff3ds.guidance.recipe import TIMESTEPS
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.guidance.upload import uploaded

GROUP = 4
# Of the signal-to-noise ratio of Stable Diffusion's schedule. With all of it, four pictures of 64 x 64 lines show what
# they are at every timestep, and a network learns to heed them alone, not the words. Empirical.
SIGNAL = 0.1
SCHEDULE = NoiseSchedule.scaled_linear().noisier(SIGNAL)
VERSION = 1
# The network that `prior train` makes has 16 MB.
MAX_BYTES = 1 << 28


@dataclass(frozen=True)
class Vocabulary:
    """What a network was told about the objects, and what their images are like.

    Attributes:
        words: names of what an object can be and have, in the order of the network's input.
        mean, spread: of the ink of all training images, which is 1 on a black stroke and 0 on white.
    """

    words: tuple[str, ...]
    mean: float
    spread: float

    def said(self, values: dict[str, float]) -> Float[Tensor, " K"]:
        """The network's input for these words.

        Raises:
            ValueError: a word that it does not have.
        """
        unknown = [word for word in values if word not in self.words]
        if unknown:
            raise ValueError(
                f"the small network was not trained on {', '.join(map(repr, unknown))}: leave --prior small out, for "
                "the exact prior knows all of the library; or train a network on what there is now, diff3ds prior "
                "train -o prior, and give it: --weights prior/small.safetensors"
            )
        return torch.tensor([values.get(word, 0.0) for word in self.words])


def ink(images: Float[Tensor, "B H W 3"]) -> Float[Tensor, "B 1 H W"]:
    """Measures how much stroke is in each pixel, whatever its colour: 1 less the darkest channel."""
    return (1 - images.amin(-1))[:, None]


def angles(cameras: Cameras) -> Float[Tensor, "B 3"]:
    """Azimuth and elevation in radians and distance, float32, on the CPU."""
    azimuth, elevation, distance = spherical(cameras)
    return torch.stack([torch.deg2rad(azimuth), torch.deg2rad(elevation), distance], 1).float()


@dataclass(frozen=True, eq=False)
class View:
    """A picture of the object that is known.

    Attributes:
        ink: of the picture, of the network's size, not standardised.
        camera: one view.
    """

    ink: Float[Tensor, "1 1 H W"]
    camera: Cameras


class SmallDenoiser:
    """The network behind the protocol of all priors. Latents are ink brought to mean 0 and variance 1.

    Attributes:
        schedule: of the noise.
        size: of the images, pixels.
        group: views of an object.
    """

    def __init__(
        self,
        network: SmallNetwork,
        vocabulary: Vocabulary,
        words: Float[Tensor, " K"],
        reference: View | None = None,
        device: torch.device | None = None,
    ) -> None:
        """Takes a network and what it is asked for.

        Args:
            words: `Vocabulary.said`.
            reference: a view of the object.
            device: where it computes; the CPU by default.
        """
        self.device = device or torch.device("cpu")
        self.network = network.to(self.device).eval().requires_grad_(False)
        self.schedule = SCHEDULE
        self.size, self.group = network.shape.size, GROUP
        self._vocabulary = vocabulary
        self._words = words.to(self.device)
        self._reference: tuple[Tensor, Tensor] | None = None
        if reference is not None:
            standard = (reference.ink - vocabulary.mean) / vocabulary.spread
            self._reference = (standard.to(self.device), angles(reference.camera)[None].to(self.device))

    def encode(self, images: Float[Tensor, "B H W 3"], generator: torch.Generator) -> Float[Tensor, "B 1 h w"]:
        """Ink, standardised, with gradients; images of another size are resampled."""
        latents = (ink(images.float()) - self._vocabulary.mean) / self._vocabulary.spread
        if latents.shape[-2:] != (self.size, self.size):
            latents = torch.nn.functional.interpolate(latents, (self.size,) * 2, mode="bilinear", antialias=True)
        return latents.to(self.device)

    def decode(self, latents: Float[Tensor, "B 1 h w"]) -> Float[Tensor, "B H W 3"]:
        """Black on white, on the CPU."""
        held = (latents * self._vocabulary.spread + self._vocabulary.mean).clamp(0, 1)
        return (1 - held).movedim(1, -1).expand(-1, -1, -1, 3).cpu()

    @torch.no_grad()
    def predict(
        self,
        noisy: Float[Tensor, "B 1 h w"],
        timesteps: Int[Tensor, " B"],
        cameras: Cameras,
        branches: Sequence[Branch],
    ) -> Float[Tensor, "R B 1 h w"]:
        """The noise as each branch predicts it; the negative one is the unconditional one.

        Raises:
            ValueError: the number of views is no multiple of the group.
        """
        check_groups(len(noisy), self.group)
        groups = noisy.reshape(-1, self.group, *noisy.shape[-2:])
        poses = uploaded(angles(cameras), noisy.device).reshape(-1, self.group, 3)
        time = uploaded(timesteps[:: self.group], noisy.device) / TIMESTEPS
        kept = self.schedule.alpha_bar(timesteps, noisy)
        known: dict[bool, Tensor] = {}
        for asked in {branch == "conditional" for branch in branches}:
            v = self._v(groups, time, poses, asked).reshape(noisy.shape)
            known[asked] = formulas.epsilon_from_v(v, noisy, kept)
        return torch.stack([known[branch == "conditional"] for branch in branches])

    def _v(
        self, noisy: Float[Tensor, "S V H W"], time: Float[Tensor, " S"], poses: Float[Tensor, "S V 3"], asked: bool
    ) -> Float[Tensor, "S V H W"]:
        count = len(noisy)
        words = (self._words if asked else torch.zeros_like(self._words)).expand(count, -1)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=half_is_fast(self.device)):
            if not asked or self._reference is None:
                found = self.network(noisy, time, poses, words)
            else:
                held, pose = (x.expand(count, *x.shape[1:]) for x in self._reference)
                found = self.network(noisy, time, poses, words, held, pose)
        v: Tensor = found.float()
        return v


def half_is_fast(device: torch.device) -> bool:
    """Whether a device multiplies matrices in bfloat16 by itself; others would emulate it, slowly."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    # A torch built without oneDNN lacks its operations too.
    if device.type != "cpu" or not torch.backends.mkldnn.is_available():  # type: ignore[no-untyped-call]
        return False
    if platform.machine().lower() in ("x86_64", "amd64"):
        # oneDNN takes any AVX-512 for good enough, and emulates there what only later ones have. Torch before 2.6 does
        # not say which has.
        asked = (getattr(torch.cpu, f"_is_{name}_supported", bool) for name in ("avx512_bf16", "amx_tile"))
        return any(is_supported() for is_supported in asked)
    return bool(torch.ops.mkldnn._is_mkldnn_bf16_supported())


def write_network(path: Path, network: SmallNetwork, vocabulary: Vocabulary, about: dict[str, Any]) -> None:
    """Writes weights in half precision, whole or not at all; `about` says how they were made."""
    meta = {"version": VERSION, "shape": asdict(network.shape), "vocabulary": asdict(vocabulary), "about": about}
    tensors = {name: value.half() for name, value in network.state_dict().items()}
    write_tensors(path, tensors, {"diff3ds": json.dumps(meta)})


def read_network(path: Path) -> tuple[SmallNetwork, Vocabulary]:
    """A network that `write_network` wrote.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no such network.
    """
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise FileNotFoundError(f"{path}: no weights of the small prior are there; train some: diff3ds prior train")
    if path.stat().st_size > MAX_BYTES:
        raise ValueError(f"{path}: larger than any network of the small prior ({MAX_BYTES} bytes)")
    try:
        with safe_open(path, "pt") as file:
            meta = json.loads((file.metadata() or {})["diff3ds"])
            tensors = {name: file.get_tensor(name).float() for name in file.keys()}  # noqa: SIM118 (not a dict)
        if meta["version"] != VERSION:
            raise ValueError(f"of version {meta['version']}, where {VERSION} is read")
        said = meta["vocabulary"]
        vocabulary = Vocabulary(tuple(map(str, said["words"])), float(said["mean"]), float(said["spread"]))
        shape = Shape(**{name: int(value) for name, value in meta["shape"].items()})
        if shape.words != len(vocabulary.words) or not (math.isfinite(vocabulary.mean) and vocabulary.spread > 0):
            raise ValueError("its vocabulary does not fit it")
        # Takes no memory before the file's tensors are known to fit.
        with torch.device("meta"):
            network = SmallNetwork(shape)
        network.load_state_dict(tensors, assign=True)
    except (SafetensorError, AttributeError, KeyError, TypeError, ValueError, OverflowError, RuntimeError) as error:
        raise ValueError(f"{path}: not a network of the small prior ({str(error)[:200]})") from error
    return network, vocabulary
