"""What latent diffusion models share: pictures to latents and back, the noise schedule in a file, and ε of a UNet."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, Literal

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.guidance import formulas
from diff3ds.guidance.denoiser import gaussian
from diff3ds.guidance.device_choice import free_memory, require_memory
from diff3ds.guidance.recipe import Work
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.guidance.upload import uploaded
from diff3ds.weights.locate import Checkpoint
from diff3ds.weights.read import load_part

Prediction = Literal["epsilon", "v_prediction"]

# Pixels to a latent along a side, of all autoencoders here.
FACTOR = 8
# Bytes a pixel and image that a backward pass through the encoder of Stable Diffusion keeps in float32, measured; and
# those of a thrifty one, to which comes one block of one image.
KEPT, KEPT_THRIFTY, ONE_BLOCK = 12_200, 900, 6_000
# Bytes a pixel and image of a UNet's forward pass under each condition: 260 to 270 of live tensors in 16 bits, 530 in
# float32, counted at full size, and something for what a GPU's convolutions take.
UNET_PASS = 750
# A pass that trains it, there and back, is under one condition and takes as much as so many: 3.4 to 3.9 counted.
TRAINING = 4
# Weights of Stable Diffusion's autoencoder, which all priors here share.
VAE_WEIGHTS = 83_653_863


class Autoencoder:
    """The autoencoder of a latent diffusion model, with gradients to the pictures that are encoded.

    It computes in float32 or bfloat16: gradients through it would overflow in float16.

    Attributes:
        size: height and width of the pictures that it takes, pixels.
        scale: latents are this times those of the network.
        thrifty: encodes picture by picture and recomputes on the way back, for a quarter more time and a tenth of the
            memory.
    """

    def __init__(self, network: Any, size: int, thrifty: bool = False) -> None:
        """Takes a diffusers.AutoencoderKL.

        Raises:
            ValueError: it is in float16, shifts its latents, or the size is no multiple of 8.
        """
        if network.dtype == torch.float16:
            raise ValueError("the autoencoder must compute in float32 or bfloat16: float16 gradients overflow")
        if size < FACTOR or size % FACTOR:
            raise ValueError(f"size must be a positive multiple of {FACTOR}, got {size}")
        if getattr(network.config, "shift_factor", None):
            raise ValueError("this autoencoder shifts its latents, which the models here do not")
        self.size = size
        self.scale = float(network.config.scaling_factor)
        self.thrifty = thrifty
        self._network = network.eval().requires_grad_(False)
        if thrifty:
            network.enable_gradient_checkpointing()

    def encode(self, images: Float[Tensor, "B H W 3"], generator: torch.Generator) -> Float[Tensor, "B 4 h w"]:
        """Scaled latents of pictures in [0, 1] of any size, drawn from what the encoder gives, float32."""
        posteriors = self._posteriors(images)
        mean = torch.cat([p.mean for p in posteriors]).float()
        deviation = torch.cat([p.std for p in posteriors]).float()
        return self.scale * (mean + deviation * gaussian(mean, generator))

    def mode(self, images: Float[Tensor, "B H W 3"]) -> Float[Tensor, "B 4 h w"]:
        """The most likely latents of pictures in [0, 1], **not** scaled, float32, without gradients.

        What Zero-1-to-3 takes beside the noisy latents.
        """
        with torch.no_grad():
            return torch.cat([p.mode() for p in self._posteriors(images)]).float()

    def decode(self, latents: Float[Tensor, "B 4 h w"]) -> Float[Tensor, "B H W 3"]:
        """Pictures in [0, 1] of scaled latents, on the CPU, without gradients."""
        weight = next(self._network.parameters())
        with torch.no_grad():
            decoded = [self._network.decode(z[None].to(weight) / self.scale).sample for z in latents]
        return (torch.cat(decoded).float().cpu().movedim(1, -1) / 2 + 0.5).clamp(0, 1)

    def _posteriors(self, images: Tensor) -> list[Any]:
        """Distributions of unscaled latents; one, or one an image."""
        weight = next(self._network.parameters())
        pixels = images.movedim(-1, 1)
        if pixels.shape[-2:] != (self.size, self.size):
            # Where the images are: not every GPU has the way back through antialiasing.
            pixels = torch.nn.functional.interpolate(pixels, (self.size, self.size), mode="bilinear", antialias=True)
        pixels = (2 * pixels.to(weight.device, torch.float32) - 1).to(weight.dtype)
        batches = torch.split(pixels, 1) if self.thrifty else [pixels]
        return [self._network.encode(batch).latent_dist for batch in batches]


class LatentDenoiser:
    """What a `Denoiser` of latents has by its autoencoder; `size` is that of the pictures, pixels."""

    def __init__(self, autoencoder: Autoencoder) -> None:
        self.size = autoencoder.size
        self._autoencoder = autoencoder

    def encode(self, images: Float[Tensor, "B H W 3"], generator: torch.Generator) -> Float[Tensor, "B 4 h w"]:
        """Scaled latents of images in [0, 1], with gradients."""
        return self._autoencoder.encode(images, generator)

    def decode(self, latents: Float[Tensor, "B 4 h w"]) -> Float[Tensor, "B H W 3"]:
        """Images in [0, 1], on the CPU."""
        return self._autoencoder.decode(latents)


def load_autoencoder(
    checkpoint: Checkpoint, size: int, dtype: torch.dtype, device: torch.device, work: Work
) -> Autoencoder:
    """The autoencoder of a checkpoint, thrifty if the device's memory is short. Place the UNet before it.

    Args:
        dtype: of the UNet; the autoencoder is in bfloat16 if that is, else in float32.
        work: of a step.

    Raises:
        ValueError: weights that do not fit.
    """
    import diffusers

    return place_autoencoder(
        load_part(diffusers.AutoencoderKL, checkpoint, "vae", vae_dtype(dtype)), size, device, work
    )


def place_autoencoder(network: Any, size: int, device: torch.device, work: Work) -> Autoencoder:
    """An autoencoder brought to a device, as `load_autoencoder`."""
    free, network = free_memory(device), network.to(device)
    wanted = sum(p.numel() for p in network.parameters()) * network.dtype.itemsize + step_memory(
        size, work, network.dtype
    )
    return Autoencoder(network, size, thrifty=free is not None and free < wanted)


def vae_dtype(dtype: torch.dtype) -> torch.dtype:
    """Chooses what an autoencoder computes in beside a UNet of this dtype: never float16."""
    return torch.bfloat16 if dtype == torch.bfloat16 else torch.float32


def step_memory(size: int, work: Work, dtype: torch.dtype, thrifty: bool = False) -> int:
    """Bytes that a step takes beside the weights; an estimate.

    Args:
        size: of the pictures, pixels.
        work: of the step.
        dtype: of the autoencoder.
        thrifty: as in `Autoencoder`.
    """
    kept = KEPT_THRIFTY * work.views + ONE_BLOCK if thrifty else KEPT * work.views
    passes = max(work.conditions, TRAINING if work.trained else 0)
    return int((kept * dtype.itemsize / 4 + UNET_PASS * passes * work.views) * size**2)


def check_memory(
    unet: Iterable[tuple[int, ...]], size: int, work: Work, dtype: torch.dtype, device: torch.device
) -> None:
    """Raises ValueError if a device cannot hold a UNet with weights of these shapes, and a thrifty step."""
    weights = sum(math.prod(shape) for shape in unet) * dtype.itemsize + VAE_WEIGHTS * vae_dtype(dtype).itemsize
    step = step_memory(size, work, vae_dtype(dtype), thrifty=True)
    require_memory(device, weights + step, f"a step of {work.views} pictures of {size} pixels")


def read_schedule(checkpoint: Checkpoint) -> tuple[NoiseSchedule, Prediction]:
    """The noise schedule of a checkpoint, and what its network predicts.

    Read from the file's numbers. The scheduler classes of diffusers would fill in what a file does not say, each with
    values of its own.

    Raises:
        ValueError: a schedule that the models here do not have.
    """
    config = checkpoint.config("scheduler")
    where = checkpoint.path / "scheduler"
    kind, first, last = (config.get(name) for name in ("beta_schedule", "beta_start", "beta_end"))
    if kind != "scaled_linear" or not isinstance(first, float) or not isinstance(last, float):
        raise ValueError(
            f"{where}: expected a scaled_linear schedule from beta_start to beta_end, got {kind}, {first}, {last}"
        )
    if (
        config.get("num_train_timesteps", 1000) != 1000
        or config.get("trained_betas")
        or config.get("rescale_betas_zero_snr")
    ):
        raise ValueError(f"{where}: expected 1000 timesteps, betas that are neither listed nor rescaled")
    # Every scheduler of diffusers means ε where its file is silent.
    prediction: Prediction = config.get("prediction_type", "epsilon")
    if prediction not in ("epsilon", "v_prediction"):
        raise ValueError(f"{where}: prediction_type must be epsilon or v_prediction, got {prediction}")
    return NoiseSchedule.scaled_linear(first, last), prediction


def predict_noise(
    unet: Any,
    noisy: Float[Tensor, "B 4 h w"],
    timesteps: Int[Tensor, " B"],
    contexts: Sequence[Float[Tensor, "B L D"]],
    schedule: NoiseSchedule,
    prediction: Prediction,
    *,
    labels: Float[Tensor, "B E"] | None = None,
    beside: Sequence[Float[Tensor, "B 4 h w"]] = (),
) -> Float[Tensor, "R B 4 h w"]:
    """ε that a UNet predicts under R conditions, in one pass, float32, without gradients to the noisy latents.

    Weights that are trained get theirs, where gradients are on.

    Args:
        contexts: what the attention sees, one a condition.
        labels: class labels, the same under all conditions.
        beside: channels that follow the noisy ones, one a condition.
    """
    weight, rows = unet.conv_in.weight, len(contexts)
    latents = noisy.detach().repeat(rows, 1, 1, 1)
    if beside:
        latents = torch.cat([latents, torch.cat(list(beside)).to(latents)], 1)
    # Labels in another format than the weights are an error there.
    more = {} if labels is None else {"class_labels": uploaded(labels, weight.device).repeat(rows, 1).to(weight)}
    context, times = torch.cat(list(contexts)).to(weight), uploaded(timesteps.repeat(rows), weight.device)
    output = unet(latents.to(weight), times, encoder_hidden_states=context, **more).sample
    kept = schedule.alpha_bar(timesteps, noisy)
    return torch.stack([predicted_noise(part, noisy.detach(), kept, prediction) for part in output.chunk(rows)])


def predicted_noise(
    output: Float[Tensor, "B 4 h w"],
    noisy: Float[Tensor, "B 4 h w"],
    alpha_bar: Float[Tensor, "B 1 1 1"],
    prediction: Prediction,
) -> Float[Tensor, "B 4 h w"]:
    """ε in float32 of what a network put out."""
    if prediction == "epsilon":
        return output.float()
    return formulas.epsilon_from_v(output.float(), noisy.float(), alpha_bar)
