"""Which device and number format a prior gets, and what is said where its memory does not suffice."""

import pytest
import tiny
import torch
from needs import needs

from diff3ds.guidance import device_choice as device
from diff3ds.guidance.networks import latent
from diff3ds.guidance.networks.latent import check_memory
from diff3ds.guidance.networks.stable_diffusion import load_stable_diffusion
from diff3ds.guidance.recipe import Work
from diff3ds.weights.catalog import KNOWN
from diff3ds.weights.weight_options import Source

pytestmark = needs("diffusers")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tiny.save_stable_diffusion(tmp_path_factory.mktemp("sd"))


def test_devices():
    assert device.pick_device("cpu") == torch.device("cpu")
    for name in ("tpu", "cuda:x", "cpu:1"):
        with pytest.raises(ValueError, match=f"no device '{name}' here; there is .*cpu"):
            device.pick_device(name)


@pytest.mark.parametrize(
    ("precision", "kind", "upcast", "dtype"),
    [
        ("auto", "cpu", False, torch.float32),
        ("auto", "cuda", False, torch.float16),
        ("auto", "cuda", True, torch.bfloat16),
        ("float16", "cpu", True, torch.float16),
        ("float32", "cuda", False, torch.float32),
    ],
)
def test_number_formats(precision, kind, upcast, dtype):
    assert device.pick_dtype(precision, torch.device(kind), upcast) == dtype


def test_too_little_memory_is_said_before_any_weights_are_loaded(folder, monkeypatch):
    monkeypatch.setattr(device, "free_memory", lambda device: 100_000_000)
    with pytest.raises(ValueError, match=r"a step of 4 pictures of 64 pixels needs about 0\.4 GB .* 0\.1 GB free"):
        load_stable_diffusion("a cat", source=Source(str(folder)), device="cpu")


def test_memory_at_the_real_size(monkeypatch):
    """867 million weights in 16 bits, and four pictures of 256 pixels, fit a GPU of 6 GB but not one of 2."""
    shapes = [(867_572_164,)]
    monkeypatch.setattr(device, "free_memory", lambda device: 6_000_000_000)
    check_memory(shapes, 256, Work(), torch.float16, torch.device("cpu"))
    monkeypatch.setattr(device, "free_memory", lambda device: 2_000_000_000)
    with pytest.raises(ValueError, match=r"needs about [23]\.\d GB"):
        check_memory(shapes, 256, Work(), torch.float16, torch.device("cpu"))


@pytest.mark.parametrize(
    ("prior", "weights", "size", "dtype"),
    [
        ("stable-diffusion", 865_910_724, 512, torch.float16),
        ("stable-diffusion-768", 865_910_724, 768, torch.bfloat16),
        ("mvdream", 867_572_164, 256, torch.float16),
        ("zero123", 859_532_484, 256, torch.float16),
        ("stable-zero123", 859_532_484, 256, torch.float16),
    ],
)
def test_the_memory_that_is_said_is_the_memory_that_is_asked_for(prior, weights, size, dtype, monkeypatch):
    """With up to a gigabyte for the GPU's own use."""
    asked = []
    monkeypatch.setattr(latent, "require_memory", lambda device, needed, what: asked.append(needed))
    check_memory([(weights,)], size, Work(), dtype, torch.device("cpu"))
    assert 0.4 < KNOWN[prior].memory - asked[0] / 1e9 < 1.1
