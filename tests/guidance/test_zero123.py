"""The priors that know a picture: poses with known values, and predictions against the formulas written out."""

import math
import shutil

import pytest
import safetensors.torch
import torch
from tiny import edit_json, save_stable_diffusion
from tiny_zero123 import POSE, WIDTH, save_projection, save_zero123

import diff3ds as ds
from diff3ds.guidance import formulas
from diff3ds.guidance.networks import zero123
from diff3ds.guidance.networks.stable_zero123 import load_stable_zero123, stable_pose
from diff3ds.guidance.networks.zero123 import ReferencePose, clip_pixels, load_zero123, relative_pose
from diff3ds.guidance.objective import ScoreDistillation
from diff3ds.guidance.recipe import Recipe
from diff3ds.weights.catalog import KNOWN
from diff3ds.weights.weight_options import Source

SIZE = 64
# Predictions are about 1; rounding of float32 grows in the attention of the tiny networks, which is sharpened.
ROUNDING = 1e-4


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return save_zero123(tmp_path_factory.mktemp("zero123") / "tiny")


@pytest.fixture(scope="module")
def picture():
    """A disc of its own colours on white."""
    y, x = torch.meshgrid(*[torch.linspace(-1, 1, SIZE)] * 2, indexing="ij")
    color = torch.stack([0.5 + 0.4 * x, 0.5 - 0.4 * y, 0.2 + 0 * x], -1)
    return torch.where((x.square() + y.square() < 0.6)[..., None], color, 1.0)


def load(folder, picture, reference=None, kind=load_zero123, **settings):
    return kind(picture, reference, Source(str(folder)), **settings)


def some_noise(count, generator):
    return torch.randn(count, 4, SIZE // 8, SIZE // 8, generator=generator)


# Poses.


@pytest.mark.parametrize(
    ("reference", "camera", "pose", "last"),
    [
        ((0, 0, 2.0), (30, 90, 1.8), [-0.523599, 1.0, 0.0, -0.2], 1.570796),
        ((20, 0, 2.0), (0, -135, 2.0), [0.349066, -0.707107, -0.707107, 0.0], 1.22173),
        ((0, 30, 1.9), (0, 30, 1.9), [0.0, 0.0, 1.0, 0.0], 1.570796),
    ],
)
def test_golden_poses(reference, camera, pose, last):
    reference = ReferencePose(*reference)
    elevation, azimuth, distance = camera
    found = relative_pose(ds.orbit(azimuth, elevation, distance), reference)
    torch.testing.assert_close(found, torch.tensor([pose]), rtol=0, atol=2e-6)
    # Stable-Zero123 drops the distance.
    found = stable_pose(ds.orbit(azimuth, elevation, reference.distance), reference)
    torch.testing.assert_close(found, torch.tensor([[*pose[:3], last]]), rtol=0, atol=2e-6)


def test_cameras_above_the_reference_have_a_smaller_polar_angle():
    poses = relative_pose(ds.orbit(0.0, [-20.0, 10.0, 40.0]), ReferencePose(elevation=10))
    torch.testing.assert_close(poses[:, 0], torch.tensor([30.0, 0.0, -30.0]).deg2rad(), rtol=0, atol=2e-6)


def test_stable_zero123_needs_one_distance(folder, picture):
    prior = load(folder, picture, kind=load_stable_zero123)
    noisy = torch.zeros(2, 4, SIZE // 8, SIZE // 8)
    with pytest.raises(ValueError, match=r"at the distance of the reference, 2, got 1\.8 to 2: set both ends"):
        prior.predict(noisy, torch.tensor([5, 5]), ds.orbit([0.0, 90.0], 0.0, [1.8, 2.0]), ["conditional"])
    prior.predict(noisy, torch.tensor([5, 5]), ds.orbit([0.0, 90.0], 0.0, 2.0), ["conditional"])


@pytest.mark.parametrize("pose", [{"elevation": 90}, {"elevation": math.nan}, {"azimuth": math.inf}, {"distance": 0}])
def test_impossible_references(pose):
    with pytest.raises(ValueError, match=f"reference {next(iter(pose))} must"):
        ReferencePose(**pose)


# Predictions.


def written_out(folder, picture, noisy, timestep, pose, shown):
    """One image, one branch, by the libraries alone: what the prior does, sentence by sentence."""
    from diffusers import AutoencoderKL, UNet2DConditionModel
    from transformers import CLIPVisionModelWithProjection

    signed = (2 * picture - 1).permute(2, 0, 1)[None]
    # The picture's latents: the mode, not multiplied with the factor of the noisy ones.
    vae = AutoencoderKL.from_pretrained(folder / "vae")
    concat = vae.encode(signed).latent_dist.mode()
    # Its embedding: resized in [-1, 1], then brought to CLIP's range; not normalised.
    clip = CLIPVisionModelWithProjection.from_pretrained(folder / "image_encoder")
    small = torch.nn.functional.interpolate(signed, (32, 32), mode="bicubic", align_corners=True, antialias=False)
    mean = torch.tensor([0.48145466, 0.4578275, 0.40821073])[None, :, None, None]
    std = torch.tensor([0.26862954, 0.26130258, 0.27577711])[None, :, None, None]
    embedding = clip(((small + 1) / 2 - mean) / std).image_embeds
    (layer,) = folder.glob("c*_projection/*.safetensors")
    tensors = safetensors.torch.load_file(layer)
    (weight,) = (t for name, t in tensors.items() if name.endswith("weight"))
    (bias,) = (t for name, t in tensors.items() if name.endswith("bias"))
    token = torch.cat([embedding[0], torch.tensor(pose)]) @ weight.T + bias
    if not shown:
        token, concat = torch.zeros_like(token), torch.zeros_like(concat)
    unet = UNet2DConditionModel.from_pretrained(folder / "unet")
    return unet(torch.cat([noisy[None], concat], 1), timestep, encoder_hidden_states=token[None, None]).sample[0]


@pytest.mark.parametrize("shown", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", [load_zero123, load_stable_zero123])
def test_predictions_are_the_formulas_written_out(folder, picture, generator, kind, shown):
    reference = ReferencePose(elevation=20, azimuth=-30, distance=1.9)
    prior = load(folder, picture, reference, kind)
    distances = [1.9, 1.8] if kind is load_zero123 else 1.9
    cameras = ds.orbit([60.0, 150.0], [30.0, 0.0], distances)
    last = [0.0, -0.1] if kind is load_zero123 else [math.radians(70)] * 2
    poses = [[math.radians(-10), 1.0, 0.0, last[0]], [math.radians(20), 0.0, -1.0, last[1]]]
    noisy, timesteps = some_noise(2, generator), torch.tensor([700, 150])
    (found,) = prior.predict(noisy, timesteps, cameras, ["conditional" if shown else "unconditional"])
    with torch.no_grad():
        expected = [
            written_out(folder, picture, z, t, p, shown) for z, t, p in zip(noisy, timesteps, poses, strict=True)
        ]
    torch.testing.assert_close(found, torch.stack(expected), rtol=0, atol=ROUNDING)


def test_every_branch_gets_its_own_prediction_in_any_order(folder, picture, generator):
    prior = load(folder, picture)
    noisy, timesteps, cameras = some_noise(2, generator), torch.tensor([500, 20]), ds.orbit([10.0, 200.0], 15.0, 1.9)
    (shown,), (hidden,) = (prior.predict(noisy, timesteps, cameras, [b]) for b in ("conditional", "unconditional"))
    assert (shown - hidden).abs().mean() > 0.05 * hidden.abs().mean()
    for branches in (["conditional", "negative"], ["unconditional", "conditional", "negative"], ["negative"]):
        found = prior.predict(noisy, timesteps, cameras, branches)
        expected = torch.stack([shown if branch == "conditional" else hidden for branch in branches])
        torch.testing.assert_close(found, expected, rtol=0, atol=ROUNDING)


def test_views_are_looked_at_one_by_one_and_each_at_its_timestep(folder, picture, generator):
    prior = load(folder, picture)
    noisy, timesteps = some_noise(3, generator), torch.tensor([900, 400, 30])
    cameras = ds.orbit([0.0, 100.0, 250.0], [0.0, 20.0, 30.0], [1.8, 1.9, 2.0])
    (together,) = prior.predict(noisy, timesteps, cameras, ["conditional"])
    for i in range(3):
        (alone,) = prior.predict(noisy[i : i + 1], timesteps[i : i + 1], cameras[i], ["conditional"])
        torch.testing.assert_close(together[i], alone[0], rtol=0, atol=ROUNDING)
    assert prior.group == 1


def test_only_stable_zero123_knows_the_elevation_of_the_reference(folder, picture, generator):
    """A camera at the reference's own place: all else is equal."""
    noisy, timesteps = some_noise(1, generator), torch.tensor([500])
    for kind, same in ((load_zero123, True), (load_stable_zero123, False)):
        found = [
            load(folder, picture, ReferencePose(elevation=e), kind).predict(
                noisy, timesteps, ds.orbit(0.0, e, 2.0), ["conditional"]
            )
            for e in (0.0, 25.0)
        ]
        assert torch.allclose(*found, rtol=0, atol=ROUNDING) == same


def test_clip_sees_every_other_pixel():
    """From 2 n - 1 to n pixels, corners aligned, without antialiasing: bicubic weights are then 0 and 1."""
    picture = torch.rand(63, 63, 3, generator=torch.Generator().manual_seed(1))
    found = clip_pixels(picture, 32)[0].permute(1, 2, 0)
    mean, std = torch.tensor([0.48145466, 0.4578275, 0.40821073]), torch.tensor([0.26862954, 0.26130258, 0.27577711])
    torch.testing.assert_close(found, (picture[::2, ::2] - mean) / std, rtol=0, atol=1e-5)


def test_v_prediction_becomes_noise(folder, picture, generator, tmp_path):
    other = save_zero123(tmp_path / "v", prediction="v_prediction")
    noisy, timesteps, cameras = some_noise(2, generator), torch.tensor([800, 60]), ds.orbit([0.0, 90.0], 10.0, 2.0)
    prior = load(folder, picture)
    (raw,) = prior.predict(noisy, timesteps, cameras, ["conditional"])
    (found,) = load(other, picture).predict(noisy, timesteps, cameras, ["conditional"])
    expected = formulas.epsilon_from_v(raw, noisy, prior.schedule.alpha_bar(timesteps, noisy))
    torch.testing.assert_close(found, expected, rtol=0, atol=ROUNDING)


def test_pictures_of_other_sizes_and_half_precision(folder, picture, generator):
    """Reduced by halves, a picture twice as large is the same; float16 has 11 bits."""
    noisy, timesteps, cameras = some_noise(1, generator), torch.tensor([400]), ds.orbit(40.0, 10.0, 2.0)
    larger = picture.repeat_interleave(2, 0).repeat_interleave(2, 1)
    expected, found, rough = (
        load(folder, p, precision=precision).predict(noisy, timesteps, cameras, ["conditional"])
        for p, precision in ((picture, "float32"), (larger, "float32"), (picture, "float16"))
    )
    torch.testing.assert_close(found, expected, rtol=0, atol=ROUNDING)
    assert rough.dtype == torch.float32
    assert 0 < (rough - expected).norm() < 0.05 * expected.norm()


def test_distillation_moves_pixels(folder, picture, generator):
    """The objective's gradient reaches the rendering; two images, each with its timestep."""

    class Rendering:
        color = torch.rand(2, 48, 48, 3, generator=generator, requires_grad=True)

    prior = load(folder, picture)
    objective = ScoreDistillation(prior, Recipe("sds", guidance=7.5), steps=10)
    objective(Rendering, ds.orbit([20.0, 170.0], 15.0, 1.9), 5).backward()
    assert Rendering.color.grad.isfinite().all()
    assert Rendering.color.grad.abs().amax((1, 2, 3)).min() > 0
    assert prior.decode(objective.latest).shape == (2, SIZE, SIZE, 3)


def test_everything_is_on_the_device(folder, picture, monkeypatch):
    """Without a GPU: torch's device of shapes without numbers, which mixes with the CPU no better than a GPU does."""
    monkeypatch.setattr(zero123, "pick_device", lambda name: torch.device("meta"))
    prior = load(folder, picture, precision="float16")
    images = torch.zeros(2, SIZE, SIZE, 3, requires_grad=True)
    latents = prior.encode(images, torch.Generator())
    cameras = ds.orbit([0.0, 90.0], 0.0, 2.0)
    found = prior.predict(latents.detach(), torch.tensor([5, 600]), cameras, ["conditional", "negative"])
    assert (found.device.type, found.dtype, found.shape) == ("meta", torch.float32, (2, *latents.shape))


# Layouts and errors.


@pytest.mark.parametrize(
    ("projection", "name", "variant"),
    [
        ("clip_camera_projection", "proj", None),
        pytest.param("clip_camera_projection", "proj", "fp16", marks=pytest.mark.slow),
        ("cc_projection", "projection", None),
        pytest.param("cc_projection", "cc_projection", None, marks=pytest.mark.slow),
    ],
)
def test_every_port_gives_the_same(tmp_path, folder, picture, generator, projection, name, variant):
    other = save_zero123(tmp_path / "port", projection, name, variant=variant)
    noisy, timesteps, cameras = some_noise(1, generator), torch.tensor([300]), ds.orbit(70.0, 20.0, 1.8)
    expected, found = (load(f, picture).predict(noisy, timesteps, cameras, ["conditional"]) for f in (folder, other))
    torch.testing.assert_close(found, expected, rtol=0, atol=ROUNDING)


@pytest.fixture
def copy(tmp_path, folder):
    return shutil.copytree(folder, tmp_path / "copy")


def replaced_projection(copy, tensors):
    path = copy / "clip_camera_projection" / "diffusion_pytorch_model.safetensors"
    path.unlink()
    safetensors.torch.save_file(tensors, path)


@pytest.mark.parametrize(
    "tensors",
    [
        {"proj.weight": torch.zeros(WIDTH, WIDTH + POSE)},
        {"linear.weight": torch.zeros(WIDTH, WIDTH + POSE), "linear.bias": torch.zeros(WIDTH)},
        {"proj.weight": torch.zeros(WIDTH, 28), "proj.bias": torch.zeros(WIDTH), "more": torch.zeros(1)},
        {"proj.weight": torch.zeros(WIDTH, 28), "proj.bias": torch.zeros(WIDTH + 1)},
    ],
)
def test_foreign_projections(copy, picture, tensors):
    replaced_projection(copy, tensors)
    with pytest.raises(ValueError, match="expected the weight and bias of one linear layer, proj or projection"):
        load(copy, picture)


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        ((WIDTH, WIDTH + POSE + 1), "takes 29 numbers, but the image encoder gives 24, and a pose has 4"),
        ((WIDTH + 8, WIDTH + POSE), "gives tokens of 32 numbers, the UNet takes 24"),
    ],
)
def test_parts_of_different_models(copy, picture, shape, message):
    shutil.rmtree(copy / "clip_camera_projection")
    save_projection(copy / "clip_camera_projection", "proj", torch.zeros(shape), torch.zeros(shape[0]))
    with pytest.raises(ValueError, match=f"{message}: parts of different models"):
        load(copy, picture)


def test_a_prior_for_phrases_is_none_for_pictures(tmp_path, copy, picture):
    """Its folder lacks parts; its UNet takes 4 channels."""
    other = save_stable_diffusion(tmp_path / "sd")
    with pytest.raises(FileNotFoundError, match=r"lacks image_encoder/, clip_camera_projection/ or cc_projection/"):
        load(other, picture)
    shutil.rmtree(copy / "unet")
    shutil.copytree(other / "unet", copy / "unet")
    with pytest.raises(ValueError, match=r"takes 8 channels \(noise and picture\), this one 4: other weights"):
        load(copy, picture)


def test_pickles_are_not_looked_at(copy, picture):
    for path in copy.glob("*_projection/*.safetensors"):
        path.rename(path.with_suffix(".bin"))
    with pytest.raises(FileNotFoundError, match=r"diffusion_pytorch_model.safetensors \(only a pickle\)"):
        load(copy, picture)


@pytest.mark.parametrize("size", [None, 0, "32"])
def test_unets_without_a_size(copy, picture, size):
    edit_json(copy / "unet" / "config.json", sample_size=size)
    with pytest.raises(ValueError, match="sample_size of the UNet must be the side of its latents, got"):
        load(copy, picture)


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("shape", [(64, 48, 3), (64, 64, 4), (1, 64, 64, 3)])
def test_pictures_that_are_not_square(folder, shape):
    with pytest.raises(ValueError, match=r"picture must have shape \(S, S, 3\), got"):
        load(folder, torch.ones(shape))


def test_no_weights(picture, monkeypatch, tmp_path):
    from huggingface_hub import constants

    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path))
    with pytest.raises(FileNotFoundError, match=r"no weights for stable-zero123:(.|\n)*diff3ds fetch stable-zero123"):
        load_stable_zero123(picture)


def test_stable_zero123_says_what_its_licence_forbids():
    """Copies are tagged MIT; that is not theirs to give."""
    assert "non-commercial" in KNOWN["stable-zero123"].licence
    assert "non-commercial research only" in KNOWN["stable-zero123"].warning
    assert not KNOWN["zero123"].warning
