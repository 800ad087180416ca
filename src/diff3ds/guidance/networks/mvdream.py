"""MVDream as a prior: Stable Diffusion's UNet that sees four views of an object at once, and their cameras."""

from collections.abc import Sequence
from typing import Any

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.camera import Cameras
from diff3ds.guidance.denoiser import Branch, check_groups
from diff3ds.guidance.device_choice import pick_device, pick_dtype
from diff3ds.guidance.networks import prompts
from diff3ds.guidance.networks.latent import (
    FACTOR,
    Autoencoder,
    LatentDenoiser,
    check_memory,
    load_autoencoder,
    place_autoencoder,
    predict_noise,
    read_schedule,
    vae_dtype,
)
from diff3ds.guidance.networks.multiview_attention import check_joined, join_views
from diff3ds.guidance.recipe import USUAL, Precision, Work
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.weights import convert, single_file
from diff3ds.weights.locate import Checkpoint, find
from diff3ds.weights.read import read_tensors, require_trust
from diff3ds.weights.weight_options import Source

VIEWS = 4
# Where a checkpoint does not say: latents of a side, and channels of an attention head.
LATENT_SIZE, HEAD_CHANNELS = 32, 64
# Added to the length of a camera's position before dividing by it, as in training.
TINY = 1e-8
# From this frame to MVDream's: a quarter turn about z that takes +x to -y.
TO_ITS_FRAME = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
# The negative phrase of MVDream's own text to 3D.
NEGATIVE = (
    "ugly, bad anatomy, blurry, pixelated obscure, unnatural colors, poor lighting, dull, and unclear, cropped, "
    "lowres, low quality, artifacts, duplicate, morbid, mutilated, poorly drawn face, deformed, dehydrated, "
    "bad proportions"
)


def camera_vectors(cameras: Cameras) -> Float[Tensor, "B 16"]:
    """Writes cameras as MVDream is told them: camera to world, row by row, float32.

    Axes of the camera as in OpenGL (x right, y up, looking along -z), world z up, its position brought to the unit
    sphere: neither distance nor field of view is seen. Its azimuth 0, where the camera sees the front of most things
    that it was trained with, is on -y; ours is on +x. So the cameras are turned: what it draws faces +x here.
    """
    to_camera = cameras.world_to_camera.detach().cpu().double()
    to_world = torch.eye(4, dtype=torch.float64).repeat(len(cameras), 1, 1)
    to_world[:, :3, :3] = to_camera[:, :3, :3].mT * torch.tensor([1.0, -1.0, -1.0])
    centers = cameras.centers.detach().cpu().double()
    to_world[:, :3, 3] = centers / (centers.norm(dim=1, keepdim=True) + TINY)
    to_world[:, :3] = torch.tensor(TO_ITS_FRAME, dtype=torch.float64) @ to_world[:, :3]
    return to_world.flatten(1).float()


class MVDream(LatentDenoiser):
    """A `Denoiser` of four consecutive views of an object.

    Attributes:
        schedule, size, group: as in `Denoiser`; group is 4.
        unet: the network.
    """

    group = VIEWS

    def __init__(
        self, unet: Any, autoencoder: Autoencoder, texts: Float[Tensor, "3 L D"], schedule: NoiseSchedule
    ) -> None:
        """Takes the parts; `load_mvdream` has them from a checkpoint.

        Args:
            unet: a diffusers.UNet2DConditionModel with the camera as class embedding; its views get joined.
            texts: encodings of the phrase, the empty phrase, and the negative one.
        """
        join_views(unet, VIEWS)
        super().__init__(autoencoder)
        self.schedule = schedule
        self.unet = unet.eval().requires_grad_(False)
        self._texts: dict[Branch, Tensor] = {
            "conditional": texts[0].to(unet.device),
            "unconditional": texts[1].to(unet.device),
            "negative": texts[2].to(unet.device),
        }

    def predict(
        self,
        noisy: Float[Tensor, "B 4 h w"],
        timesteps: Int[Tensor, " B"],
        cameras: Cameras,
        branches: Sequence[Branch],
    ) -> Float[Tensor, "R B 4 h w"]:
        """The noise as each branch predicts it; see `Denoiser`.

        Raises:
            ValueError: B is no multiple of 4, or timesteps differ within a group.
        """
        check_groups(len(noisy), VIEWS)
        check_joined(self.unet)
        if not bool((timesteps.reshape(-1, VIEWS) == timesteps[::VIEWS, None]).all()):
            raise ValueError(f"the {VIEWS} views of an object must have one timestep, got {timesteps.tolist()}")
        contexts = [self._texts[branch].expand(len(noisy), -1, -1) for branch in branches]
        # The same cameras on every branch: there is no null camera.
        labels = camera_vectors(cameras)
        return predict_noise(self.unet, noisy, timesteps, contexts, self.schedule, "epsilon", labels=labels)


def load_mvdream(
    phrase: str,
    negative: str = NEGATIVE,
    source: Source | None = None,
    *,
    text_source: Source | None = None,
    device: str = "auto",
    precision: Precision = "auto",
    work: Work = USUAL,
) -> MVDream:
    """MVDream for a phrase.

    Args:
        negative: what not to draw; the baseline of guidance.
        source: of the weights: the port of ashawkey or lzq49, one with the names of diffusers throughout, or the
            original sd-v2.1-base-4view as a single file; None looks for those known.
        text_source: as in `find_words`.
        device: as in `pick_device`.
        precision: of the UNet, as in `pick_dtype`.
        work: of a step, for the memory that it takes.

    Raises:
        ImportError: the extra is not installed.
        FileNotFoundError: weights are missing; it says which, and how to get them.
        ValueError: an empty or too long phrase, weights of another model, a pickle that is not trusted, too little
            memory.
    """
    phrases = [prompts.check_phrase(phrase), "", negative]
    checkpoint, place = find("mvdream", source), pick_device(device)
    dtype = pick_dtype(precision, place)
    single = checkpoint.path.is_file()
    if single:
        require_trust(checkpoint.path, checkpoint.trust_pickle)
    words = find_words(checkpoint, text_source)
    schedule = NoiseSchedule.scaled_linear()
    if not single:
        schedule, prediction = read_schedule(checkpoint)
        if prediction != "epsilon":
            raise ValueError(f"{checkpoint.path}: MVDream predicts epsilon, this scheduler says {prediction}")
    tensors, config, rest = _read_single(checkpoint) if single else _read_folder(checkpoint)
    size = FACTOR * int(config["sample_size"])
    check_memory((tuple(t.shape) for t in tensors.values()), size, work, dtype, place)
    texts = prompts.encode_phrases(words, phrases, int(config["cross_attention_dim"]))
    unet = single_file.build("UNet2DConditionModel", config, tensors, dtype, f"{checkpoint.path}: UNet").to(place)
    if single:
        network = single_file.build_vae(rest, vae_dtype(dtype), str(checkpoint.path))
        return MVDream(unet, place_autoencoder(network, size, place, work), texts, schedule)
    return MVDream(unet, load_autoencoder(checkpoint, size, dtype, place, work), texts, schedule)


def find_words(checkpoint: Checkpoint, source: Source | None = None) -> Checkpoint:
    """Finds the text encoder and tokenizer of a checkpoint: in it, but a single file has them in another form.

    Args:
        source: for a single file; any Stable Diffusion 2.1, whose they are. None looks for those known.

    Raises:
        FileNotFoundError: there is none for a single file; it says how to get it.
    """
    if checkpoint.path.is_dir():
        return checkpoint
    try:
        return find("stable-diffusion", source, ("text_encoder", "tokenizer"))
    except FileNotFoundError as error:
        raise FileNotFoundError(
            f"{checkpoint.path} is a single file, which has the text encoder in another form. It is that of Stable "
            f"Diffusion 2.1, which is not in {source or 'the cache of the hub'}: diff3ds fetch stable-diffusion, then "
            "the same command"
        ) from error


def _read_folder(checkpoint: Checkpoint) -> tuple[dict[str, Tensor], dict[str, Any], dict[str, Tensor]]:
    """A UNet's weights, named as in diffusers, and its configuration, from any port; and nothing more.

    The class of diffusers is never given a port's own configuration: it would skip what it does not know, and keep
    random weights.
    """
    said = checkpoint.config("unet")
    tensors = convert.to_diffusers(read_tensors(checkpoint.file("unet")))
    if (checkpoint.path / "camera_proj").is_dir():
        camera = read_tensors(checkpoint.file("camera_proj"))
        tensors |= {f"class_embedding.{name}": tensor for name, tensor in camera.items()}
    config = _config(tensors, said.get("num_head_channels", HEAD_CHANNELS), f"{checkpoint.path}: UNet")
    if "attention_head_dim" in said:
        config["attention_head_dim"] = said["attention_head_dim"]
    return tensors, config | {"sample_size": said.get("sample_size", said.get("image_size", LATENT_SIZE))}, {}


def _read_single(checkpoint: Checkpoint) -> tuple[dict[str, Tensor], dict[str, Any], dict[str, Tensor]]:
    """A UNet's weights, named as in diffusers, its configuration, and all weights of the file as they are."""
    what = f"{checkpoint.path}: UNet"
    found = read_tensors(checkpoint.path, checkpoint.trust_pickle)
    tensors = single_file.unet_weights(found, str(checkpoint.path))
    return tensors, _config(tensors, HEAD_CHANNELS, what) | {"sample_size": LATENT_SIZE}, found


def _config(tensors: dict[str, Tensor], head_channels: int, what: str) -> dict[str, Any]:
    try:
        config = convert.unet_config(tensors)
    except ValueError as error:
        raise ValueError(f"{what}: {error}") from error
    if "class_embed_type" not in config:
        raise ValueError(
            f"{what}: not the weights of a UNet that takes cameras: there is no class_embedding.linear_1.weight"
        )
    # diffusers calls the number of heads so.
    heads = [max(1, channels // head_channels) for channels in config["block_out_channels"]]
    return config | {"attention_head_dim": heads}
