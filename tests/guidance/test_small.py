"""The small prior's network and what it is behind: patches, attention, views that see each other, files."""

import json
from dataclasses import asdict

import pytest
import torch
from safetensors.torch import load_file, save_file

import diff3ds as ds
from diff3ds.guidance import formulas
from diff3ds.guidance.built_in.small import (
    SmallDenoiser,
    View,
    Vocabulary,
    angles,
    half_is_fast,
    ink,
    read_network,
    write_network,
)
from diff3ds.guidance.built_in.small_network import Attention, SmallNetwork
from diff3ds.guidance.built_in.small_shape import Shape
from diff3ds.guidance.denoiser import Denoiser

SHAPE = Shape(words=3, size=16, patch=4, channels=4, width=32, depth=2, heads=2)
VOCABULARY = Vocabulary(("mug", "mug: steam", "stretch z"), 0.2, 0.4)


@pytest.fixture
def network() -> SmallNetwork:
    """Random everywhere: a new one predicts zero."""
    torch.manual_seed(0)
    made = SmallNetwork(SHAPE)
    for parameter in made.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    return made


@pytest.fixture
def cameras() -> ds.Cameras:
    return ds.orbit([10.0, 100.0, 190.0, 280.0], 20.0, 1.9, size=16)


def inputs(count: int = 2) -> tuple[torch.Tensor, ...]:
    generator = torch.Generator().manual_seed(1)
    noisy = torch.randn(count, 4, 16, 16, generator=generator)
    poses = torch.randn(count, 4, 3, generator=generator)
    return noisy, torch.rand(count, generator=generator), poses, torch.tensor([[1.0, 0, 0], [1.0, 1, 0.3]])[:count]


def test_a_new_network_predicts_nothing():
    assert torch.equal(SmallNetwork(SHAPE)(*inputs()), torch.zeros(2, 4, 16, 16))


def test_patches_are_squares_and_come_back(network):
    features = torch.arange(2 * 4 * 16 * 16.0).reshape(2, 4, 16, 16)
    patches = network._cut(features)
    assert torch.equal(patches[1, 4 + 3], features[1, :, 4:8, 12:16].flatten())
    assert torch.equal(network._joined(patches[None]), features)


def test_attention_is_that_of_torch_with_unit_queries_and_keys():
    torch.manual_seed(2)
    attention = Attention(32, 2)
    tokens = torch.randn(3, 7, 32)
    q, k, v = (x.reshape(3, 7, 2, 16).transpose(1, 2) for x in attention.into(tokens).chunk(3, -1))
    q, k = (x / x.norm(dim=-1, keepdim=True) for x in (q, k))
    expected = torch.nn.functional.scaled_dot_product_attention(10 * q, k, v, scale=1.0)
    assert torch.allclose(attention(tokens), attention.out(expected.transpose(1, 2).reshape(3, 7, 32)), atol=1e-5)


def test_every_input_matters_and_views_see_each_other(network):
    noisy, time, poses, words = inputs()
    before = network(noisy, time, poses, words)
    other = noisy.clone()
    other[:, 3] += 1
    assert (network(other, time, poses, words)[:, 0] - before[:, 0]).abs().max() > 1e-3
    assert (network(noisy, time + 0.3, poses, words) - before).abs().max() > 1e-3
    moved = poses.clone()
    moved[:, 1, 0] += 0.5
    assert (network(noisy, time, moved, words)[:, 1] - before[:, 1]).abs().max() > 1e-3
    # Objects of a batch do not see each other.
    changed = network(noisy, time, poses, words * torch.tensor([[1.0], [0.0]]))
    assert torch.allclose(changed[0], before[0], atol=1e-6)
    assert (changed[1] - before[1]).abs().max() > 1e-3


def test_a_reference_view_and_its_camera_matter(network):
    noisy, time, poses, words = inputs()
    reference, pose = noisy[:, :1] / 2, poses[:, :1] / 2
    with_it = network(noisy, time, poses, words, reference, pose)
    assert (with_it - network(noisy, time, poses, words)).abs().max() > 1e-3
    assert (with_it - network(noisy, time, poses, words, -reference, pose)).abs().max() > 1e-3
    assert (with_it - network(noisy, time, poses, words, reference, pose + 0.5)).abs().max() > 1e-3


def test_ink_is_what_is_not_white_whatever_its_colour():
    image = torch.tensor([[[[1.0, 1, 1], [0, 0, 0], [1, 0, 0], [0.5, 0.5, 0.5]]]])
    assert torch.equal(ink(image), torch.tensor([[[[0.0, 1, 1, 0.5]]]]))


def test_angles_are_those_of_the_orbit(cameras):
    expected = torch.deg2rad(torch.tensor([10.0, 100.0, -170.0, -80.0]))
    found = angles(cameras)
    assert torch.allclose(found[:, 0], expected, atol=1e-5)
    assert torch.allclose(found[:, 1], torch.deg2rad(torch.full((4,), 20.0)), atol=1e-5)
    assert torch.allclose(found[:, 2], torch.full((4,), 1.9), atol=1e-5)


def test_predictions_are_the_networks_v_as_noise(network, cameras):
    denoiser = SmallDenoiser(network, VOCABULARY, VOCABULARY.said({"mug": 1.0, "stretch z": 0.3}))
    assert isinstance(denoiser, Denoiser)
    images = torch.rand(4, 16, 16, 1, generator=torch.Generator().manual_seed(3)).expand(-1, -1, -1, 3)
    latents = denoiser.encode(images, torch.Generator())
    assert torch.allclose(denoiser.decode(latents), images, atol=1e-6)
    timesteps = torch.full((4,), 600)
    conditional, negative = denoiser.predict(latents, timesteps, cameras, ("conditional", "negative"))
    kept = denoiser.schedule.alpha_bars[600]
    # bfloat16 has 8 bits: the network's own rounding.
    for found, words in ((conditional, torch.tensor([[1.0, 0, 0.3]])), (negative, torch.zeros(1, 3))):
        v = network(latents.reshape(1, 4, 16, 16), torch.tensor([0.6]), angles(cameras)[None], words)[0]
        expected = formulas.epsilon_from_v(v[:, None], latents, kept.expand(4, 1, 1, 1))
        assert (found - expected).abs().max() < 0.05 * expected.abs().max()
    with pytest.raises(ValueError, match="multiple of 4"):
        denoiser.predict(latents[:3], timesteps[:3], cameras[torch.arange(3)], ("conditional",))


def test_a_reference_belongs_to_the_conditional_branch_alone(network, cameras):
    words = VOCABULARY.said({"mug": 1.0})
    view = View(torch.rand(1, 1, 16, 16, generator=torch.Generator().manual_seed(4)), ds.orbit(30, 10, 1.9, size=16))
    latents = torch.randn(4, 1, 16, 16, generator=torch.Generator().manual_seed(5))
    asked = (latents, torch.full((4,), 500), cameras, ("conditional", "unconditional"))
    without = SmallDenoiser(network, VOCABULARY, words).predict(*asked)
    known = SmallDenoiser(network, VOCABULARY, words, view).predict(*asked)
    assert torch.equal(known[1], without[1])
    assert (known[0] - without[0]).abs().max() > 1e-3


def test_gradients_pass_through_the_encoder(network):
    denoiser = SmallDenoiser(network, VOCABULARY, torch.zeros(3))
    images = torch.rand(4, 16, 16, 3, generator=torch.Generator().manual_seed(6), dtype=torch.float32).requires_grad_()
    denoiser.encode(images, torch.Generator()).sum().backward()
    # One channel of each pixel is the darkest.
    assert torch.allclose(images.grad.sum(-1), torch.full((4, 16, 16), -1 / 0.4))


def test_networks_come_back_from_their_files(network, tmp_path):
    path = tmp_path / "small.safetensors"
    write_network(path, network, VOCABULARY, {"steps": 7})
    found, vocabulary = read_network(path)
    assert vocabulary == VOCABULARY
    assert found.shape == SHAPE
    for name, value in network.state_dict().items():
        assert torch.equal(found.state_dict()[name], value.half().float()), name


def test_files_that_are_no_networks_are_refused(network, tmp_path):
    path = tmp_path / "small.safetensors"
    with pytest.raises(FileNotFoundError, match="prior train"):
        read_network(path)
    path.write_bytes(b"not a network")
    with pytest.raises(ValueError, match="not a network of the small prior"):
        read_network(path)
    save_file({"x": torch.zeros(1)}, path)
    with pytest.raises(ValueError, match="not a network of the small prior"):
        read_network(path)


@pytest.mark.parametrize(
    "wrong",
    [
        {"version": 2},
        {"shape": {"words": 10**9}},
        {"shape": []},
        {"vocabulary": {"words": ["mug"], "mean": 0, "spread": 1}},
        {"vocabulary": asdict(VOCABULARY) | {"mean": float("nan")}},
        {"vocabulary": asdict(VOCABULARY) | {"spread": 0}},
    ],
)
def test_damaged_descriptions_are_refused(network, tmp_path, wrong):
    path = tmp_path / "small.safetensors"
    write_network(path, network, VOCABULARY, {})
    meta = {"version": 1, "shape": asdict(SHAPE), "vocabulary": asdict(VOCABULARY)}
    tensors = load_file(path)
    save_file(tensors, path, {"diff3ds": json.dumps(meta)})
    read_network(path)
    save_file(tensors, path, {"diff3ds": json.dumps(meta | wrong)})
    with pytest.raises(ValueError, match="not a network of the small prior"):
        read_network(path)


def test_without_onednn_a_cpu_computes_in_float32(monkeypatch):
    monkeypatch.setattr(torch.backends.mkldnn, "is_available", lambda: False)
    monkeypatch.delattr(torch.ops.mkldnn, "_is_mkldnn_bf16_supported")
    assert half_is_fast(torch.device("cpu")) is False


def test_a_torch_that_does_not_know_the_processor_computes_in_float32(monkeypatch):
    """Torch 2.4 and 2.5 lack these; the names are of torch itself."""
    for name in ("_is_avx512_bf16_supported", "_is_amx_tile_supported"):
        monkeypatch.delattr(torch.cpu, name)
    monkeypatch.setattr("platform.machine", lambda: "x86_64")
    assert half_is_fast(torch.device("cpu")) is False


def test_unknown_words_are_refused():
    with pytest.raises(ValueError, match="not trained on 'sofa'"):
        VOCABULARY.said({"sofa": 1.0})
    with pytest.raises(ValueError, match="multiple of patch"):
        Shape(3, size=20, patch=8)
