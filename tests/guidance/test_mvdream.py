"""MVDream on tiny random checkpoints in every published layout, and what it is told of cameras."""

import json

import pytest
import tiny
import torch
from needs import needs
from safetensors.torch import save_file

from diff3ds.camera import orbit
from diff3ds.guidance.denoiser import Denoiser
from diff3ds.guidance.networks.latent import Autoencoder
from diff3ds.guidance.networks.multiview_attention import JoinedViews, check_joined, join_views
from diff3ds.guidance.networks.mvdream import MVDream, camera_vectors, load_mvdream
from diff3ds.guidance.objective import ScoreDistillation
from diff3ds.guidance.recipe import Recipe
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.weights.weight_options import Source

pytestmark = needs("diffusers", "ftfy")

LAYOUTS = ("stock", "ashawkey", "lzq49")
CAMERAS = orbit([0.0, 90.0, 180.0, 270.0], 15.0, 1.9, size=64)
TIMES = torch.full((4,), 500)
BRANCHES = ("conditional", "unconditional", "negative")


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    root = tmp_path_factory.mktemp("mvdream")
    return {layout: tiny.save_mvdream(root / layout, layout) for layout in LAYOUTS}


@pytest.fixture(scope="module")
def prior(folders):
    return load_mvdream("a cat", source=Source(str(folders["stock"])), device="cpu")


@pytest.fixture
def noisy(generator):
    return torch.randn(4, 4, 8, 8, generator=generator)


# Cameras


@pytest.mark.parametrize(
    ("elevation", "azimuth", "vector"),
    [
        (0, 0, [1, 0, 0, 0, 0, 0, -1, -1, 0, 1, 0, 0, 0, 0, 0, 1]),
        (0, 90, [0, 0, 1, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1]),
        (15, 90, [0, -0.258819, 0.965926, 0.965926, 1, 0, 0, 0, 0, 0.965926, 0.258819, 0.258819, 0, 0, 0, 1]),
        (15, 270, [0, 0.258819, -0.965926, -0.965926, -1, 0, 0, 0, 0, 0.965926, 0.258819, 0.258819, 0, 0, 0, 1]),
    ],
)
def test_cameras_as_mvdream_was_trained_with(elevation, azimuth, vector):
    """Values of its own `get_camera` at the same azimuth, whose 0 is on -y of its world, as the fourth number says."""
    found = camera_vectors(orbit(float(azimuth), float(elevation), 1.9))
    assert torch.allclose(found, torch.tensor([vector], dtype=torch.float32), atol=1e-6)


def test_neither_distance_nor_field_of_view_is_seen():
    near, far = orbit(30.0, 20.0, 1.4, fov=40.0), orbit(30.0, 20.0, 7.0, fov=60.0)
    assert torch.allclose(camera_vectors(near), camera_vectors(far), atol=1e-6)


def test_the_cameras_are_left_alone():
    cameras = orbit([10.0, 100.0], 20.0, 1.9)
    before = cameras.world_to_camera.clone()
    first = camera_vectors(cameras)
    assert torch.equal(cameras.world_to_camera, before)
    assert torch.equal(camera_vectors(cameras), first)


# Layouts


def test_every_layout_says_the_same(folders, prior, noisy):
    expected = prior.predict(noisy, TIMES, CAMERAS, BRANCHES)
    for layout in ("ashawkey", "lzq49"):
        other = load_mvdream("a cat", source=Source(str(folders[layout])), device="cpu")
        assert torch.equal(other.predict(noisy, TIMES, CAMERAS, BRANCHES), expected), layout
        assert other.size == prior.size == 64


@pytest.fixture(scope="module")
def single(tmp_path_factory):
    """The original's single file, as safetensors and as a pickle, and what it was made from."""
    root = tmp_path_factory.mktemp("single")
    unet, vae, tensors = tiny.make_single_mvdream()
    save_file(tensors, root / "sd-v2.1-base-4view.safetensors")
    torch.save(tensors, root / "sd-v2.1-base-4view.pt")
    return root, unet, vae


@pytest.mark.slow
def test_a_single_file_takes_its_words_from_stable_diffusion(single, folders, noisy):
    root, unet, vae = single
    words = Source(str(folders["stock"]))
    file = Source(str(root / "sd-v2.1-base-4view.safetensors"))
    found = load_mvdream("a cat", source=file, text_source=words, device="cpu")
    texts = torch.stack(list(found._texts.values()))
    expected = MVDream(unet, Autoencoder(vae, 256), texts, NoiseSchedule.scaled_linear())
    assert found.size == 256
    assert torch.equal(
        found.predict(noisy, TIMES, CAMERAS, BRANCHES), expected.predict(noisy, TIMES, CAMERAS, BRANCHES)
    )
    picture = torch.rand(1, 64, 64, 3, generator=torch.Generator().manual_seed(0))
    latents = [p.encode(picture, torch.Generator().manual_seed(1)) for p in (found, expected)]
    assert torch.equal(*latents)


def test_a_single_file_without_words_says_where_they_are(single, tmp_path, monkeypatch):
    from huggingface_hub import constants

    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path))
    with pytest.raises(FileNotFoundError, match=r"sd-v2.1-base-4view.safetensors is a single file, .* fetch stable"):
        load_mvdream("a cat", source=Source(str(single[0] / "sd-v2.1-base-4view.safetensors")), device="cpu")
    # Of what is not read at all, that is said first.
    with pytest.raises(ValueError, match="not safetensors but a pickle"):
        load_mvdream("a cat", source=Source(str(single[0] / "sd-v2.1-base-4view.pt")), device="cpu")


def test_a_pickle_must_be_trusted_by_name(single, folders, noisy):
    root, _, _ = single
    place, words = str(root / "sd-v2.1-base-4view.pt"), Source(str(folders["stock"]))
    with pytest.raises(ValueError, match=r"not safetensors but a pickle, which can run code .* --allow-pickle"):
        load_mvdream("a cat", source=Source(place), text_source=words, device="cpu")
    trusted = load_mvdream("a cat", source=Source(place, trust_pickle=True), text_source=words, device="cpu")
    safe = Source(str(root / "sd-v2.1-base-4view.safetensors"))
    other = load_mvdream("a cat", source=safe, text_source=words, device="cpu")
    assert torch.equal(*(p.predict(noisy, TIMES, CAMERAS, BRANCHES) for p in (trusted, other)))


def test_diffusers_itself_would_load_the_port_as_noise(folders):
    """Why its class is never given a port's configuration: it skips what it does not know."""
    from diffusers import UNet2DConditionModel

    with torch.device("meta"):
        port = UNet2DConditionModel.from_config(json.loads((folders["ashawkey"] / "unet" / "config.json").read_text()))
    assert port.config.cross_attention_dim == 1280
    assert port.config.class_embed_type is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("drop", r"UNet: not the weights of this model: it lacks mid_block\.attentions\.0\.norm\.weight"),
        pytest.param("add", r"it has foreign image_embed\.weight", marks=pytest.mark.slow),
        pytest.param(
            "reshape",
            r"mid_block\.attentions\.0\.norm\.weight must have shape \(128,\), got \(64,\)",
            marks=pytest.mark.slow,
        ),
        ("rename", r"UNet: not the weights of a UNet: there is no conv_in\.weight"),
    ],
)
def test_other_weights_are_refused_by_name(tmp_path, change, message):
    folder = tiny.save_mvdream(tmp_path / "port", "ashawkey")
    file = folder / "unet" / "diffusion_pytorch_model.safetensors"
    from safetensors.torch import load_file

    weights = load_file(file)
    if change == "drop":
        del weights["middle_block.1.norm.weight"]
    if change == "add":
        weights["image_embed.weight"] = torch.zeros(2)
    if change == "reshape":
        weights["middle_block.1.norm.weight"] = torch.zeros(64)
    if change == "rename":
        weights = {f"model.{name}": tensor for name, tensor in weights.items()}
    save_file(weights, file)
    with pytest.raises(ValueError, match=message):
        load_mvdream("a cat", source=Source(str(folder)), device="cpu")


def test_stable_diffusion_is_not_taken_for_mvdream(tmp_path):
    folder = tiny.save_stable_diffusion(tmp_path / "sd")
    with pytest.raises(ValueError, match=r"takes cameras: there is no class_embedding\.linear_1\.weight"):
        load_mvdream("a cat", source=Source(str(folder)), device="cpu")


def test_v_prediction_is_refused(tmp_path):
    folder = tiny.save_mvdream(tmp_path / "v", "stock")
    tiny.edit_json(folder / "scheduler" / "scheduler_config.json", prediction_type="v_prediction")
    with pytest.raises(ValueError, match="MVDream predicts epsilon, this scheduler says v_prediction"):
        load_mvdream("a cat", source=Source(str(folder)), device="cpu")


# Views


def test_every_view_of_an_object_sees_the_others(prior, noisy):
    before = prior.predict(noisy, TIMES, CAMERAS, ("conditional",))[0]
    changed = noisy.clone()
    changed[3] += 1
    after = prior.predict(changed, TIMES, CAMERAS, ("conditional",))[0]
    assert (after[:3] - before[:3]).norm() > 0.02 * before[:3].norm()


def test_objects_do_not_see_each_other(prior, noisy):
    """Four and four consecutive views are two objects, on every branch."""
    both = torch.cat([noisy, noisy.flip(0)])
    times = torch.tensor([500] * 4 + [200] * 4)
    cameras = CAMERAS[[0, 1, 2, 3, 1, 2, 3, 0]]
    together = prior.predict(both, times, cameras, BRANCHES)
    first = prior.predict(both[:4], times[:4], cameras[:4], BRANCHES)
    second = prior.predict(both[4:], times[4:], cameras[4:], BRANCHES)
    assert torch.allclose(together, torch.cat([first, second], 1), atol=1e-4)


def test_every_branch_knows_the_cameras(prior, noisy):
    turned = CAMERAS[[1, 2, 3, 0]]
    found, other = (prior.predict(noisy, TIMES, cameras, BRANCHES) for cameras in (CAMERAS, turned))
    for branch in range(3):
        assert (found[branch] - other[branch]).norm() > 1e-3 * found[branch].norm()


def test_the_network_by_hand(prior, folders, noisy):
    """One branch, joined by attention written out over all tokens of four views."""
    from diffusers import UNet2DConditionModel

    unet = UNet2DConditionModel.from_pretrained(folders["stock"] / "unet")

    def joined(attn, hidden_states, encoder_hidden_states=None, attention_mask=None, temb=None):
        if encoder_hidden_states is not None:
            source, groups = encoder_hidden_states, list(range(4))
            views = [(hidden_states[v], source[v]) for v in groups]
        else:
            everything = hidden_states.flatten(0, 1)
            views = [(hidden_states[v], everything) for v in range(4)]
        rows = []
        for own, seen in views:
            query, key, value = attn.to_q(own), attn.to_k(seen), attn.to_v(seen)
            heads = []
            for q, k, v in zip(*(t.chunk(attn.heads, -1) for t in (query, key, value)), strict=True):
                heads.append((q @ k.T / q.shape[-1] ** 0.5).softmax(-1) @ v)
            rows.append(attn.to_out[0](torch.cat(heads, -1)))
        return torch.stack(rows)

    unet.set_attn_processor(joined)
    text = prior._texts["conditional"].expand(4, -1, -1)
    with torch.no_grad():
        by_hand = unet(noisy, 500, encoder_hidden_states=text, class_labels=camera_vectors(CAMERAS)).sample
    found = prior.predict(noisy, TIMES, CAMERAS, ("conditional",))[0]
    assert torch.allclose(found, by_hand, atol=1e-4)


def test_only_self_attention_is_joined():
    unet = tiny.make_mvdream_unet()
    join_views(unet, 4)
    joined = {name for name, processor in unet.attn_processors.items() if isinstance(processor, JoinedViews)}
    assert joined == {name for name in unet.attn_processors if name.endswith("attn1.processor")}
    assert len(joined) == len(unet.attn_processors) / 2 == 16
    # Processors that were modules would appear among the weights.
    assert len(unet.state_dict()) == 690


def test_a_replaced_attention_is_noticed(folders, noisy):
    from diffusers.models.attention_processor import AttnProcessor2_0

    prior = load_mvdream("a cat", source=Source(str(folders["stock"])), device="cpu")
    prior.unet.set_attn_processor(AttnProcessor2_0())
    with pytest.raises(RuntimeError, match="its views no longer see each other"):
        prior.predict(noisy, TIMES, CAMERAS, ("conditional",))
    with pytest.raises(RuntimeError, match="no longer see"):
        check_joined(tiny.make_mvdream_unet())


@pytest.mark.parametrize("count", [1, 3, 6])
def test_views_come_in_fours(prior, count):
    noisy, cameras = torch.zeros(count, 4, 8, 8), orbit([10.0 * i for i in range(count)], 15.0, 1.9)
    with pytest.raises(ValueError, match=f"give a multiple of 4, got {count}"):
        prior.predict(noisy, torch.full((count,), 500), cameras, ("conditional",))


def test_the_views_of_an_object_have_one_timestep(prior, noisy):
    with pytest.raises(ValueError, match="must have one timestep"):
        prior.predict(noisy, torch.tensor([500, 500, 500, 499]), CAMERAS, ("conditional",))


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["float16", "bfloat16"])
def test_half_precision_says_much_the_same(folders, prior, noisy, precision):
    """Camera vectors must come in the UNet's number format."""
    half = load_mvdream("a cat", source=Source(str(folders["stock"])), device="cpu", precision=precision)
    found, expected = (p.predict(noisy, TIMES, CAMERAS, ("conditional",)) for p in (half, prior))
    assert found.dtype == torch.float32
    # 8 bits of bfloat16 through two dozen layers.
    assert (found - expected).norm() < 0.1 * expected.norm()


def test_a_step_of_distillation_moves_the_pictures(prior, generator):
    denoiser: Denoiser = prior

    class Rendering:
        color = torch.rand(4, 32, 32, 3, generator=generator).requires_grad_()

    losses = []
    for _ in range(2):
        Rendering.color.grad = None
        loss = ScoreDistillation(denoiser, Recipe(), steps=10, seed=3)(Rendering(), CAMERAS, 0)
        loss.backward()
        losses.append((loss.detach(), Rendering.color.grad.clone()))
    assert Rendering.color.grad.isfinite().all()
    assert Rendering.color.grad.abs().sum() > 0
    assert torch.equal(losses[0][0], losses[1][0])
    assert torch.equal(losses[0][1], losses[1][1])
