"""Stable Diffusion on tiny random checkpoints, against the network called by hand."""

import pytest
import tiny
import torch
from needs import needs

from diff3ds.camera import orbit
from diff3ds.guidance import formulas
from diff3ds.guidance.denoiser import gaussian
from diff3ds.guidance.networks import prompts
from diff3ds.guidance.networks.latent import Autoencoder
from diff3ds.guidance.networks.prompts import BACK, FRONT, SIDE
from diff3ds.guidance.networks.stable_diffusion import StableDiffusion, load_stable_diffusion
from diff3ds.guidance.schedule import NoiseSchedule
from diff3ds.weights.weight_options import Source

pytestmark = needs("diffusers", "ftfy")

CAMERAS = orbit([0.0, 90.0, 180.0], [10.0, 20.0, 30.0], 1.9, size=64)
TIMES = torch.tensor([850, 500, 100])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tiny.save_stable_diffusion(tmp_path_factory.mktemp("sd"))


@pytest.fixture(scope="module")
def prior(folder):
    return load_stable_diffusion("a cat", "a dog", Source(str(folder)), device="cpu")


@pytest.fixture(scope="module")
def unet(folder):
    from diffusers import UNet2DConditionModel

    return UNet2DConditionModel.from_pretrained(folder / "unet")


@pytest.fixture
def noisy(generator):
    return torch.randn(3, 4, 8, 8, generator=generator)


@pytest.fixture(scope="module")
def texts():
    """Stand-ins for the encodings of six phrases, all different."""
    return torch.randn(6, 77, 32, generator=torch.Generator().manual_seed(1))


@pytest.fixture
def by_hand(unet, noisy):
    """ε of the network for one picture at a time."""

    def evaluate(contexts, latents=noisy, times=TIMES):
        with torch.no_grad():
            rows = [
                unet(z[None], t, encoder_hidden_states=c[None]).sample
                for z, t, c in zip(latents, times, contexts, strict=True)
            ]
        return torch.cat(rows)

    return evaluate


@pytest.fixture
def made(unet, texts):
    """A prior from parts."""

    def make(perp_neg=False, prediction="epsilon"):
        schedule = NoiseSchedule.scaled_linear()
        return StableDiffusion(unet, Autoencoder(tiny.make_vae(), 64), texts, schedule, prediction, perp_neg)

    return make


def test_what_a_checkpoint_says_is_read(prior):
    assert prior.size == 64
    assert prior.group == 1
    assert torch.equal(prior.schedule.alpha_bars, NoiseSchedule.scaled_linear().alpha_bars)


def test_a_picture_goes_to_latents_and_back(prior, folder, generator):
    """Through the autoencoder of the checkpoint: in [-1, 1] there, scaled by the number of the published models."""
    from diffusers import AutoencoderKL

    network = AutoencoderKL.from_pretrained(folder / "vae")
    pictures = torch.rand(2, 64, 64, 3, generator=generator)
    latents = prior.encode(pictures, torch.Generator().manual_seed(1))
    with torch.no_grad():
        posterior = network.encode(2 * pictures.permute(0, 3, 1, 2) - 1).latent_dist
        noise = gaussian(posterior.mean, torch.Generator().manual_seed(1))
        assert torch.allclose(latents, 0.18215 * (posterior.mean + posterior.std * noise), atol=1e-5)
        back = network.decode(latents / 0.18215).sample.permute(0, 2, 3, 1) / 2 + 0.5
    assert torch.allclose(prior.decode(latents), back.clamp(0, 1), atol=1e-5)


def test_branches_are_what_the_network_says(made, texts, noisy, by_hand):
    """In the order asked for; each camera has the text of its direction."""
    found = made().predict(noisy, TIMES, CAMERAS, ("negative", "conditional", "unconditional"))
    expected = [by_hand(texts[[5, 5, 5]]), by_hand(texts[[FRONT, SIDE, BACK]]), by_hand(texts[[4, 4, 4]])]
    assert torch.allclose(found, torch.stack(expected), atol=1e-4)
    assert not torch.allclose(found[0], found[1], atol=1e-2)
    assert not torch.allclose(found[0], found[2], atol=1e-2)
    assert not found.requires_grad


def test_the_loaded_texts_are_the_phrases(prior, folder):
    from diff3ds.weights.locate import Checkpoint

    phrases = [*(f"a cat, {d} view" for d in ("front", "side", "back", "overhead")), "", "a dog"]
    assert torch.equal(prior._texts, prompts.encode_phrases(Checkpoint(folder), phrases, 32))


def test_v_prediction_is_the_epsilon_model_in_other_words(tmp_path, folder, noisy):
    """The same weights read as v: ε = √ᾱ v + √(1 - ᾱ) z_t."""
    other = tiny.save_stable_diffusion(tmp_path / "v", "v_prediction")
    branches = ("conditional", "negative")
    plain, velocity = (
        load_stable_diffusion("a cat", source=Source(str(f)), device="cpu").predict(noisy, TIMES, CAMERAS, branches)
        for f in (folder, other)
    )
    kept = NoiseSchedule.scaled_linear().alpha_bar(TIMES, noisy)
    for v, epsilon in zip(plain, velocity, strict=True):
        assert torch.allclose(epsilon, formulas.epsilon_from_v(v, noisy, kept), atol=1e-4)


def test_perpendicular_negatives_see_the_latents_of_their_own_view(made, texts, noisy, by_hand):
    """Each view alone, by hand, gives what all give together."""
    found = made(perp_neg=True).predict(noisy, TIMES, CAMERAS, ("conditional", "negative"))
    plan = prompts.turned(*(torch.tensor(a) for a in ([0.0, 90.0, 180.0], [10.0, 20.0, 30.0])))
    baseline = by_hand(texts[[5, 5, 5]])
    away = torch.stack([by_hand(texts[plan.negative[i]]) for i in range(2)])
    expected = formulas.perp_neg(by_hand(texts[[FRONT, SIDE, BACK]]), baseline, away, plan.weights)
    assert torch.allclose(found[0], expected, atol=1e-4)
    assert torch.allclose(found[1], baseline, atol=1e-4)
    assert not torch.allclose(found[0], made().predict(noisy, TIMES, CAMERAS, ("conditional",))[0], atol=1e-2)


def test_perpendicular_negatives_interpolate_the_text(made, texts, noisy, by_hand):
    found = made(perp_neg=True).predict(noisy[:1], TIMES[:1], orbit([45.0], 10.0), ("conditional",))[0]
    halfway = (texts[FRONT] + texts[SIDE])[None] / 2
    (plain, base, front, side) = (
        by_hand(c, noisy[:1], TIMES[:1]) for c in (halfway, texts[5:], texts[:1], texts[SIDE : SIDE + 1])
    )
    weights = prompts.turned(torch.tensor([45.0]), torch.tensor([10.0])).weights
    assert torch.allclose(found, formulas.perp_neg(plain, base, torch.stack([front, side]), weights), atol=1e-4)


def test_perpendicular_negatives_count_from_where_guidance_starts(made, texts, noisy, by_hand):
    """csd and nfsd start from no phrase at all, though there be a negative one."""
    branches = ("conditional", "unconditional", "negative")
    found = made(perp_neg=True).predict(noisy, TIMES, CAMERAS, branches)
    plan = prompts.turned(*(torch.tensor(a) for a in ([0.0, 90.0, 180.0], [10.0, 20.0, 30.0])))
    start = by_hand(texts[[4, 4, 4]])
    away = torch.stack([by_hand(texts[plan.negative[i]]) for i in range(2)])
    expected = formulas.perp_neg(by_hand(texts[[FRONT, SIDE, BACK]]), start, away, plan.weights)
    assert torch.allclose(found[0], expected, atol=1e-4)
    assert torch.allclose(found[1], start, atol=1e-4)
    assert torch.allclose(found[2], by_hand(texts[[5, 5, 5]]), atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("precision", ["float16", "bfloat16"])
def test_half_precision_says_much_the_same(folder, prior, noisy, precision):
    half = load_stable_diffusion("a cat", "a dog", Source(str(folder)), device="cpu", precision=precision)
    found = half.predict(noisy, TIMES, CAMERAS, ("conditional",))
    expected = prior.predict(noisy, TIMES, CAMERAS, ("conditional",))
    assert found.dtype == torch.float32
    # 8 bits of bfloat16 through a dozen layers.
    assert (found - expected).norm() < 0.05 * expected.norm()
    # Gradients never pass through float16.
    picture = torch.rand(1, 64, 64, 3, requires_grad=True)
    half.encode(picture, torch.Generator().manual_seed(0)).sum().backward()
    assert picture.grad.isfinite().all()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"class_embed_type": "projection"}, "with a camera, not that of Stable Diffusion; is it MVDream"),
        ({"in_channels": 9}, "got 9 channels"),
        ({"_class_name": "MultiViewUNetModel"}, "is it MVDream"),
    ],
)
def test_other_models_are_refused(tmp_path, changes, message):
    folder = tiny.save_stable_diffusion(tmp_path / "other")
    tiny.edit_json(folder / "unet" / "config.json", **changes)
    with pytest.raises(ValueError, match=message):
        load_stable_diffusion("a cat", source=Source(str(folder)), device="cpu")


def test_an_empty_phrase_is_refused_before_any_weights_are_looked_for():
    with pytest.raises(ValueError, match="phrase is empty"):
        load_stable_diffusion(" ")
