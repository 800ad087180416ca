"""Zero-1-to-3 from its original single file: the same as the same weights in the layout of diffusers."""

import sys
import types

import pytest
import torch
from needs import needs
from safetensors.torch import save_file
from tiny import make_single_mvdream
from tiny_zero123 import save_pair

import diff3ds as ds
from diff3ds.guidance.networks.zero123 import ReferencePose, load_zero123
from diff3ds.tasks.text_image.prior_options import PriorOptions
from diff3ds.tasks.text_image.priors import kind_of, loaded
from diff3ds.weights.weight_options import Source

pytestmark = needs("diffusers")

BRANCHES = ("conditional", "unconditional")
CAMERAS = ds.orbit([0.0, 130.0], [10.0, 30.0], [1.9, 2.0])


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    return save_pair(tmp_path_factory.mktemp("averaged"))


@pytest.fixture(scope="module")
def picture():
    return torch.rand(48, 48, 3, generator=torch.Generator().manual_seed(5))


def load(place, picture, trust=True):
    return load_zero123(picture, ReferencePose(5.0), Source(str(place), trust_pickle=trust), device="cpu")


def said(prior, picture):
    """What a prior says of noise, and the latents that it makes of the picture."""
    generator = torch.Generator().manual_seed(1)
    noisy = torch.randn(2, 4, 32, 32, generator=generator)
    found = prior.predict(noisy, torch.tensor([300, 700]), CAMERAS, BRANCHES)
    return found, prior.encode(picture[None], generator), prior.decode(noisy[:1])


@pytest.fixture(scope="module")
def expected(pair, picture):
    return said(load(pair[0], picture), picture)


def save_lightning(path, tensors, monkeypatch):
    """A checkpoint as PyTorch Lightning 1.4 writes it: named by a class beside the weights, and with the optimiser."""
    place = "pytorch_lightning.callbacks.model_checkpoint"
    kind = type("ModelCheckpoint", (), {"__module__": place})
    for name in ("pytorch_lightning", "pytorch_lightning.callbacks", place):
        monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
    sys.modules[place].ModelCheckpoint = kind
    content = {
        "epoch": 3,
        "pytorch-lightning_version": "1.4.2",
        "state_dict": tensors,
        "callbacks": {kind: {"monitor": "val/loss", "best_model_score": torch.tensor(0.5), "dirpath": "x"}},
        "optimizer_states": [{"state": {0: {"step": 5, "exp_avg": torch.zeros(3)}}, "param_groups": [{"lr": 1e-4}]}],
        "lr_schedulers": [{"last_epoch": 5, "lr_lambdas": [{}]}],
    }
    torch.save(content, path)
    monkeypatch.undo()


def test_the_averaged_weights_of_a_training_say_the_same(pair, expected, picture, tmp_path, monkeypatch):
    """The authors sample with averaged weights; those beside them are zeros here, and would say nothing."""
    file = tmp_path / "zero123-xl.ckpt"
    save_lightning(file, pair[1], monkeypatch)
    known = set(torch.serialization.get_safe_globals())
    prior = load(file, picture)
    for found, wanted in zip(said(prior, picture), expected, strict=True):
        torch.testing.assert_close(found, wanted, rtol=1e-5, atol=1e-5)
    assert set(torch.serialization.get_safe_globals()) == known
    assert "pytorch_lightning" not in sys.modules
    options = PriorOptions(prior="zero123", weights=str(file), allow_pickle=True)
    assert loaded("zero123", options, prior.unet).weights["weights"] == str(file.resolve())


@pytest.mark.slow
def test_without_averages_the_weights_themselves_count(picture, tmp_path):
    folder, tensors = save_pair(tmp_path, averaged=False)
    save_file({name: tensor.contiguous() for name, tensor in tensors.items()}, tmp_path / "a.safetensors")
    wanted = said(load(folder, picture), picture)[0]
    found = said(load(tmp_path / "a.safetensors", picture, trust=False), picture)[0]
    torch.testing.assert_close(found, wanted, rtol=1e-5, atol=1e-5)


def test_it_is_read_only_when_trusted(pair, picture, tmp_path):
    torch.save(pair[1], tmp_path / "a.ckpt")
    for read in (
        lambda: load(tmp_path / "a.ckpt", picture, trust=False),
        lambda: kind(tmp_path / "a.ckpt", trust=False),
    ):
        with pytest.raises(ValueError, match=r"a\.ckpt is not safetensors but a pickle.*--allow-pickle"):
            read()


def kind(path, trust=True):
    return kind_of(PriorOptions(prior=str(path), allow_pickle=trust))


@pytest.mark.slow
def test_a_file_says_which_prior_it_is(pair, tmp_path):
    for name, wanted in (("zero123-xl.ckpt", "zero123"), ("stable_zero123.ckpt", "stable-zero123")):
        torch.save(pair[1], tmp_path / name)
        assert kind(tmp_path / name) == wanted
    torch.save(make_single_mvdream()[2], tmp_path / "4view.pt")
    assert kind(tmp_path / "4view.pt") == "mvdream"


def without(tensors, start):
    return {name: tensor for name, tensor in tensors.items() if not name.startswith(start)}


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ("cc_projection.", "not a checkpoint of Zero-1-to-3: there is no cc_projection"),
        pytest.param(
            "model_ema.diffusion_modelout2",
            "averaged UNet: not the weights of this model: it lacks out2bias, out2weight",
            marks=pytest.mark.slow,
        ),
        pytest.param(
            "model.diffusion_model.out.2.",
            "averaged UNet: .* it has foreign out2bias, out2weight",
            marks=pytest.mark.slow,
        ),
        ("cond_stage_model.model.visual.proj", "not CLIP's image tower by OpenAI's names: there is no proj"),
        pytest.param(
            "cond_stage_model.model.visual.ln_pre.bias",
            "image encoder: .* it lacks vision_model.pre_layrnorm.bias",
            marks=pytest.mark.slow,
        ),
        ("first_stage_model.", "not the weights of an autoencoder"),
    ],
)
def test_what_is_missing_is_named(pair, picture, tmp_path, start, message):
    torch.save(without(pair[1], start), tmp_path / "a.ckpt")
    with pytest.raises(ValueError, match=message):
        load(tmp_path / "a.ckpt", picture)
