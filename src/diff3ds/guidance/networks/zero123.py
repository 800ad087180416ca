"""Zero-1-to-3 and Zero123-XL: what an object looks like from other sides, given one picture of it (Liu et al. 2023)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance.denoiser import Branch
from diff3ds.guidance.device_choice import pick_device, pick_dtype
from diff3ds.guidance.networks.latent import (
    FACTOR,
    Autoencoder,
    LatentDenoiser,
    Prediction,
    check_memory,
    place_autoencoder,
    predict_noise,
    vae_dtype,
)
from diff3ds.guidance.networks.zero123_parts import Projection, read_parts
from diff3ds.guidance.poses import spherical
from diff3ds.guidance.recipe import USUAL, Precision, Work
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.guidance.upload import uploaded
from diff3ds.weights.locate import Checkpoint, find
from diff3ds.weights.weight_options import Source

# Mean and standard deviation of the pictures that CLIP was trained with.
CLIP_MEAN = (0.48145466, 0.4578275, 0.40821073)
CLIP_STD = (0.26862954, 0.26130258, 0.27577711)


@dataclass(frozen=True)
class ReferencePose:
    """Where the camera of the reference picture stands, as in `orbit`.

    Attributes:
        elevation: degrees above the horizon, in (-90, 90).
        azimuth: degrees, counter-clockwise seen from +z.
        distance: from the object's middle. The paper's cameras stand at 1.8 to 2.0.
    """

    elevation: float = 0.0
    azimuth: float = 0.0
    distance: float = 2.0

    def __post_init__(self) -> None:
        if not -90 < self.elevation < 90:
            raise ValueError(f"reference elevation must lie in (-90, 90) degrees, got {self.elevation}")
        if not abs(self.azimuth) < float("inf"):
            raise ValueError(f"reference azimuth must be finite, got {self.azimuth}")
        if not 0 < self.distance < float("inf"):
            raise ValueError(f"reference distance must be positive, got {self.distance}")


# From cameras and the reference's to (B, 4).
RelativePose = Callable[[Cameras, ReferencePose], Float[Tensor, "B 4"]]


def relative_pose(cameras: Cameras, reference: ReferencePose) -> Float[Tensor, "B 4"]:
    """(Δ polar angle, sin Δ azimuth, cos Δ azimuth, Δ distance) of cameras from the reference, radians, on the CPU.

    The polar angle counts from the top: a camera above the reference has a negative one.
    """
    azimuth, elevation, distance = spherical(cameras)
    turned = torch.deg2rad(azimuth - reference.azimuth)
    down = torch.deg2rad(reference.elevation - elevation)
    return torch.stack([down, turned.sin(), turned.cos(), distance - reference.distance], 1).float()


@dataclass(frozen=True, eq=False)
class Condition:
    """What the UNet is told of the reference picture.

    Attributes:
        embedding: CLIP's, not normalised, float32.
        concat: the most likely latents of the picture, **not** scaled as noisy latents are, float32.
        reference: the picture's pose.
    """

    embedding: Float[Tensor, " E"]
    concat: Float[Tensor, "1 4 h w"]
    reference: ReferencePose


class Zero123(LatentDenoiser):
    """A `Denoiser` that knows one picture of the object. The negative branch is the unconditional one.

    Attributes:
        schedule: of the noise.
        size: of the images, pixels.
        group: 1, every view is looked at by itself.
    """

    group = 1

    def __init__(
        self,
        unet: Any,
        autoencoder: Autoencoder,
        projection: Projection,
        condition: Condition,
        schedule: NoiseSchedule,
        *,
        prediction: Prediction = "epsilon",
        pose: RelativePose = relative_pose,
    ) -> None:
        """Takes a diffusers.UNet2DConditionModel with 8 channels, and what goes with it, all on one device."""
        super().__init__(autoencoder)
        self.schedule = schedule
        self.unet = unet
        self._projection = projection
        self._condition = condition
        self._prediction = prediction
        self._pose = pose

    def predict(
        self,
        noisy: Float[Tensor, "B 4 h w"],
        timesteps: Int[Tensor, " B"],
        cameras: Cameras,
        branches: Sequence[Branch],
    ) -> Float[Tensor, "R B 4 h w"]:
        """The noise of every branch; without the picture, token and latents of the picture are zeros.

        Raises:
            ValueError: cameras where this prior knows nothing.
        """
        poses = uploaded(self._pose(cameras, self._condition.reference), noisy.device)
        tokens = self._projection.tokens(self._condition.embedding, poses)
        concat = self._condition.concat.expand(len(noisy), -1, -1, -1)
        # Whether the picture is shown; each kind once.
        kinds = list(dict.fromkeys(branch == "conditional" for branch in branches))
        contexts, beside = ([kind * shown for kind in kinds] for shown in (tokens, concat))
        found = predict_noise(self.unet, noisy, timesteps, contexts, self.schedule, self._prediction, beside=beside)
        return torch.stack([found[kinds.index(branch == "conditional")] for branch in branches])


def load_zero123(
    picture: Float[Tensor, "S S 3"],
    reference: ReferencePose | None = None,
    source: Source | None = None,
    *,
    device: str = "auto",
    precision: Precision = "auto",
    work: Work = USUAL,
) -> Zero123:
    """Zero123-XL, or the weights that are named, with a reference picture.

    Args:
        picture: of the object, square, over white, in [0, 1].
        reference: where its camera stands; default `ReferencePose()`.
        source: of the weights: a folder in the layout of diffusers, or the original checkpoint, a single file; default
            the first known ones on this disk.
        device: see `pick_device`.
        precision: see `pick_dtype`.
        work: of a step, for the memory that it takes.

    Raises:
        ImportError: the extra is not installed.
        FileNotFoundError: no weights; it says how to get them.
        ValueError: a picture that is not square, weights of another model, a pickle that is not trusted, no such
            device, too little memory.
    """
    return assemble(find("zero123", source), picture, reference or ReferencePose(), device, precision, work)


def assemble(
    checkpoint: Checkpoint,
    picture: Float[Tensor, "S S 3"],
    reference: ReferencePose,
    device: str,
    precision: Precision,
    work: Work,
    pose: RelativePose = relative_pose,
) -> Zero123:
    """The prior of a checkpoint and a picture; for arguments and errors see `load_zero123`."""
    if picture.ndim != 3 or picture.shape[0] != picture.shape[1] or picture.shape[2] != 3:
        raise ValueError(f"picture must have shape (S, S, 3), got {tuple(picture.shape)}")
    parts = read_parts(checkpoint)
    there, size = pick_device(device), FACTOR * int(parts.config["sample_size"])
    picture = resized(picture, size)
    dtype = pick_dtype(precision, there, bool(parts.config.get("upcast_attention")))
    # Nothing is the negative of a picture.
    work = replace(work, conditions=min(work.conditions, 2))
    check_memory(parts.shapes, size, work, dtype, there)
    # The encoder runs once, on the CPU, and is freed.
    embedding = embed(parts.encoder(), picture)
    unet = parts.unet(dtype).to(there)
    autoencoder = place_autoencoder(parts.vae(vae_dtype(dtype)), size, there, work)
    return Zero123(
        unet,
        autoencoder,
        Projection(parts.projection.weight.to(there), parts.projection.bias.to(there)),
        Condition(embedding.to(there), autoencoder.mode(picture[None]), reference),
        parts.schedule,
        prediction=parts.prediction,
        pose=pose,
    )


def embed(encoder: Any, picture: Float[Tensor, "S S 3"]) -> Float[Tensor, " E"]:
    """CLIP's embedding of a picture, not normalised, by its image encoder."""
    with torch.no_grad():
        embedding = encoder(pixel_values=clip_pixels(picture, encoder.config.image_size)).image_embeds[0]
    assert isinstance(embedding, Tensor)
    return embedding


def clip_pixels(picture: Float[Tensor, "S S 3"], size: int) -> Float[Tensor, "1 3 s s"]:
    """A picture as the CLIP of Zero-1-to-3 was shown it: bicubic with the corners aligned and no antialiasing."""
    pixels = picture.movedim(-1, 0)[None].float().cpu()
    pixels = torch.nn.functional.interpolate(pixels, (size, size), mode="bicubic", align_corners=True)
    mean, std = (pixels.new_tensor(values)[:, None, None] for values in (CLIP_MEAN, CLIP_STD))
    return (pixels - mean) / std


def resized(picture: Float[Tensor, "S S 3"], size: int) -> Float[Tensor, "s s 3"]:
    """A picture of another size, by means of its pixels; one of this size stays as it is."""
    channels = picture.movedim(-1, 0)[None].float()
    return torch.nn.functional.interpolate(channels, (size, size), mode="area")[0].movedim(0, -1)
