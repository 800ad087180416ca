"""The image tower of CLIP's ResNets against a forward pass written out, and the size of the published one."""

import pytest
import torch
from tiny_networks import TINY_RESNET, resnet, resnet_shapes
from torch.nn import functional as F

from diff3ds.metrics.clip_resnet import ClipResnet, clip_resnet


def forward(tensors, pixels):
    """From the paper and the names of the weights alone: an image to its embedding."""
    get = {name.removeprefix("visual."): value for name, value in tensors.items()}

    def norm(x, name):
        mean, var, weight, bias = (
            get[f"{name}.{n}"][:, None, None] for n in ("running_mean", "running_var", "weight", "bias")
        )
        return (x - mean) / (var + 1e-5).sqrt() * weight + bias

    mean = torch.tensor([0.48145466, 0.4578275, 0.40821073])[:, None, None]
    std = torch.tensor([0.26862954, 0.26130258, 0.27577711])[:, None, None]
    x = (pixels - mean) / std
    for i, stride in ((1, 2), (2, 1), (3, 1)):
        x = F.relu(norm(F.conv2d(x, get[f"conv{i}.weight"], stride=stride, padding=1), f"bn{i}"))
    x = F.avg_pool2d(x, 2)
    for stage in (1, 2, 3, 4):
        block = 0
        while f"layer{stage}.{block}.conv1.weight" in get:
            at = f"layer{stage}.{block}"
            stride = 2 if stage > 1 and block == 0 else 1
            y = F.relu(norm(F.conv2d(x, get[f"{at}.conv1.weight"]), f"{at}.bn1"))
            y = F.relu(norm(F.conv2d(y, get[f"{at}.conv2.weight"], padding=1), f"{at}.bn2"))
            y = F.avg_pool2d(y, stride) if stride > 1 else y
            y = norm(F.conv2d(y, get[f"{at}.conv3.weight"]), f"{at}.bn3")
            if block == 0:
                x = F.avg_pool2d(x, stride) if stride > 1 else x
                x = norm(F.conv2d(x, get[f"{at}.downsample.0.weight"]), f"{at}.downsample.1")
            x = F.relu(x + y)
            block += 1
    # Tokens first, then views, as torch's attention has them; 64 channels a head.
    tokens = x.flatten(2).permute(2, 0, 1)
    tokens = torch.cat([tokens.mean(0, keepdim=True), tokens]) + get["attnpool.positional_embedding"][:, None]
    channels = tokens.shape[2]
    attended, _ = F.multi_head_attention_forward(
        tokens[:1],
        tokens,
        tokens,
        channels,
        channels // 64,
        None,
        torch.cat([get[f"attnpool.{p}_proj.bias"] for p in "qkv"]),
        None,
        None,
        False,
        0.0,
        get["attnpool.c_proj.weight"],
        get["attnpool.c_proj.bias"],
        use_separate_proj_weight=True,
        training=False,
        need_weights=False,
        q_proj_weight=get["attnpool.q_proj.weight"],
        k_proj_weight=get["attnpool.k_proj.weight"],
        v_proj_weight=get["attnpool.v_proj.weight"],
    )
    return attended[0]


def test_as_the_forward_pass_written_out(generator):
    tensors = resnet()
    tower = clip_resnet(tensors, "test")
    assert tower.size == 64
    pixels = torch.rand(3, 3, 64, 64, generator=generator)
    got = tower(pixels)
    expected = forward(tensors, pixels)
    assert got.shape == (3, TINY_RESNET[-1])
    assert torch.allclose(got, expected, rtol=1e-4, atol=1e-4 * float(expected.abs().max()))
    # Three different images: what the tower makes of them differs.
    assert float((got[0] - got[1]).norm() / got[0].norm()) > 1e-3


def test_the_full_tower_has_the_published_weights():
    """RN101: 224 pixels, stages of 3, 4, 23 and 3 blocks, embeddings of 512; OpenCLIP counts 56.26 million."""
    with torch.device("meta"):
        tower = ClipResnet(64, (3, 4, 23, 3), 7, 512)
    assert tower.size == 224
    expected = {f"visual.{name}": tuple(value.shape) for name, value in tower.state_dict().items()}
    assert expected == resnet_shapes(64, (3, 4, 23, 3), 7, 512)
    assert sum(p.numel() for p in tower.parameters()) / 1e6 == pytest.approx(56.26, abs=0.005)


def test_half_precision_and_missing_counters(generator):
    """OpenAI's files have 16 bits; conversions may lack the counters of batches."""
    fewer = {k: v.half() for k, v in resnet().items() if not k.endswith("num_batches_tracked")}
    pixels = torch.rand(1, 3, 64, 64, generator=generator)
    got = clip_resnet(fewer, "test")(pixels)
    assert got.dtype == torch.float32
    assert torch.allclose(got, clip_resnet(resnet(), "test")(pixels), rtol=0.05, atol=0.02 * float(got.abs().max()))


def test_gradients(generator):
    tower = clip_resnet(resnet(), "test").double()
    pixels = torch.rand(1, 3, 64, 64, generator=generator, dtype=torch.float64, requires_grad=True)
    (gradient,) = torch.autograd.grad(tower(pixels).sum(), pixels)
    direction = torch.randn(pixels.shape, generator=generator, dtype=torch.float64)
    step, at = 1e-6, pixels.detach()
    difference = (tower(at + step * direction) - tower(at - step * direction)).sum() / (2 * step)
    assert float((gradient * direction).sum()) == pytest.approx(float(difference), rel=1e-4)


def test_other_weights_are_refused():
    with pytest.raises(ValueError, match=r"x.safetensors: not CLIP's ResNet by OpenAI's names"):
        clip_resnet({"vision_model.x": torch.zeros(1)}, "x.safetensors")
    fewer = {k: v for k, v in resnet().items() if k != "visual.layer2.1.bn2.running_var"}
    with pytest.raises(ValueError, match=r"it lacks visual.layer2.1.bn2.running_var"):
        clip_resnet(fewer, "x")
    with pytest.raises(ValueError, match=r"it has the unknown visual.proj"):
        clip_resnet(resnet() | {"visual.proj": torch.zeros(2)}, "x")
    with pytest.raises(ValueError, match="must have 64x64 pixels, got"):
        clip_resnet(resnet(), "x")(torch.zeros(1, 3, 32, 32))
