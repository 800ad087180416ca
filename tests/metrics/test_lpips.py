"""LPIPS: identities, a value computed by hand, traps, gradients, and errors."""

import pytest
import torch
from tiny_networks import features, heads

from diff3ds.metrics.feature_stacks import feature_stack
from diff3ds.metrics.lpips import Lpips
from diff3ds.metrics.vgg_distance import VggDistance

BACKBONES = ("alex", "vgg")


def lpips(backbone, **changes):
    return Lpips(backbone, features(backbone) | changes.pop("features", {}), heads(backbone) | changes.pop("heads", {}))


@pytest.mark.parametrize("backbone", BACKBONES)
def test_identical_images_have_distance_zero_and_others_do_not(backbone, images):
    distance = lpips(backbone)
    assert torch.equal(distance(images, images), torch.zeros(3))
    others = distance(images, images.roll(1, 0))
    assert (others > 0.01).all()
    assert torch.allclose(others, distance(images.roll(1, 0), images))


def functional(tensors, weights, backbone, images):
    """The paper's formula, with F.conv2d and the layers' numbers written out."""
    plan = {
        "alex": ["c0 4 2", "r", "T", "m3", "c3 1 2", "r", "T", "m3", "c6 1 1", "r", "T", "c8 1 1", "r", "T", "c10 1 1",
                 "r", "T"],
        "vgg": ["c0", "r", "c2", "r", "T", "m2", "c5", "r", "c7", "r", "T", "m2", "c10", "r", "c12", "r", "c14", "r",
                "T", "m2", "c17", "r", "c19", "r", "c21", "r", "T", "m2", "c24", "r", "c26", "r", "c28", "r",
                "T"],
    }[backbone]  # fmt: skip
    x = images.permute(0, 3, 1, 2) * 2 - 1
    shift, scale = torch.tensor([-0.030, -0.088, -0.188]), torch.tensor([0.458, 0.448, 0.450])
    x = (x - shift[:, None, None]) / scale[:, None, None]
    seen = []
    for op in plan:
        number, *rest = op[1:].split() or [""]
        if op[0] == "c":
            stride, padding = (int(v) for v in rest) if rest else (1, 1)
            weight, bias = tensors[f"features.{number}.weight"], tensors[f"features.{number}.bias"]
            x = torch.nn.functional.conv2d(x, weight, bias, stride, padding)
        elif op[0] == "r":
            x = torch.relu(x)
        elif op[0] == "m":
            x = torch.nn.functional.max_pool2d(x, int(number), 2)
        else:
            seen.append(x)
    total = 0
    for tap, features_seen in enumerate(seen):
        unit = features_seen / (features_seen.norm(dim=1, keepdim=True) + 1e-10)
        difference = (unit[:1] - unit[1:]) ** 2
        total = total + (difference * weights[f"lin{tap}.model.1.weight"][0]).sum(1).mean()
    return total


@pytest.mark.parametrize("backbone", BACKBONES)
def test_as_the_formula_written_out(backbone, images):
    """Trap: input must be brought to [-1, 1], and each backbone has its own taps."""
    expected = functional(features(backbone), heads(backbone), backbone, images[:2])
    assert torch.allclose(lpips(backbone)(images[:1], images[1:2]), expected, rtol=1e-4)


def test_a_value_computed_by_hand():
    """A net whose first layer copies channel sums: white against black, at one tap only."""
    tensors = {k: torch.zeros_like(v) for k, v in features("vgg").items()}
    # The first layer's channel 0 is the red pixel as scaled, channel 1 is 1 everywhere; the second layer passes both.
    tensors["features.0.weight"][0, 0, 1, 1] = 1
    tensors["features.0.bias"][1] = 1
    for channel in (0, 1):
        tensors["features.2.weight"][channel, channel, 1, 1] = 1
    weights = {k: torch.zeros_like(v) for k, v in heads("vgg").items()}
    weights["lin0.model.1.weight"][0, :2] = torch.tensor([3.0, 5.0])[:, None, None]
    got = Lpips("vgg", tensors, weights)(torch.ones(1, 16, 16, 3), torch.zeros(1, 16, 16, 3))
    # White is (1 + .03) / .458 = 2.2489: the direction (.91371, .40629); black is negative, so 0 after ReLU: (0, 1).
    white = 1.03 / 0.458
    length = (white**2 + 1) ** 0.5
    assert float(got) == pytest.approx(3 * (white / length) ** 2 + 5 * (1 - 1 / length) ** 2, rel=1e-5)


def test_the_sizes_are_the_published_ones():
    """Parameters of torchvision's features, as published: 61.1 M - 58.6 M of AlexNet, 14,714,688 of VGG16."""
    for backbone, count in (("alex", 2_469_696), ("vgg", 14_714_688)):
        stack = feature_stack(backbone, features(backbone), "test")
        assert sum(p.numel() for p in stack.parameters()) == count


@pytest.mark.parametrize("backbone", BACKBONES)
def test_gradients(backbone, generator):
    distance = lpips(backbone)
    distance.stack.double()
    size = 31 if backbone == "alex" else 16
    a, b = (torch.rand(1, size, size, 3, generator=generator, dtype=torch.float64) for _ in range(2))
    a.requires_grad_()
    (gradient,) = torch.autograd.grad(distance(a, b).sum(), a)
    direction = torch.randn(a.shape, generator=generator, dtype=torch.float64)
    # Small: features near 0 turn quickly.
    step = 1e-8
    difference = distance(a.detach() + step * direction, b) - distance(a.detach() - step * direction, b)
    assert float((gradient * direction).sum()) == pytest.approx(float(difference) / (2 * step), rel=1e-5)


def test_features_that_vanish_have_finite_gradients():
    """The last layer gives nothing at all, where the derivative of a length is infinite; no ReLU stops it there."""
    image = torch.full((1, 3, 16, 16), 0.5, requires_grad=True)
    tensors = {k: torch.full_like(v, float(k.endswith("bias"))) for k, v in features("vgg").items()}
    tensors["features.28.bias"].zero_()
    distance = VggDistance(tensors)
    (gradient,) = torch.autograd.grad(distance(image, torch.zeros_like(image)).sum(), image)
    assert torch.equal(gradient, torch.zeros_like(gradient))


def test_bad_weights_are_named():
    fewer = {k: v for k, v in features("alex").items() if k != "features.3.bias"}
    with pytest.raises(ValueError, match=r"a.safetensors: not the weights of this network: it lacks features.3.bias"):
        Lpips("alex", fewer, heads("alex"), ("a.safetensors", "b"))
    with pytest.raises(ValueError, match=r"it has the unknown features.11.bias"):
        Lpips("alex", features("alex") | {"features.11.bias": torch.zeros(3)}, heads("alex"))
    with pytest.raises(ValueError, match=r"lin1.model.1.weight must have the shape \(1, 192, 1, 1\), got \(1, 128"):
        Lpips("alex", features("alex"), heads("vgg"))
    with pytest.raises(ValueError, match="lacks features"):
        Lpips("vgg", features("alex"), heads("vgg"))


@pytest.mark.usefixtures("unchecked")
def test_bad_images_are_refused(images):
    distance = lpips("alex")
    with pytest.raises(ValueError, match="at least 31x31"):
        distance(images[:, :30], images[:, :30])
    with pytest.raises(ValueError, match="one shape"):
        distance(images, images[:, :40])


# 3Doodle's distance: another thing


@pytest.mark.slow
def test_the_distance_of_3doodle_is_not_lpips(images):
    """No weights of channels, ImageNet's statistics on [0, 1], the last tap before its ReLU."""
    tensors = features("vgg")
    standard = VggDistance(tensors)
    pixels = images.movedim(-1, 1)
    x = (pixels - torch.tensor([0.485, 0.456, 0.406])[:, None, None]) / torch.tensor([0.229, 0.224, 0.225])[
        :, None, None
    ]
    expected = torch.zeros(2)
    taps = {2: "r", 7: "r", 14: "r", 21: "r", 28: ""}
    before = {5, 10, 17, 24}
    for number in (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28):
        x = torch.nn.functional.max_pool2d(x, 2) if number in before else x
        x = torch.nn.functional.conv2d(
            x, tensors[f"features.{number}.weight"], tensors[f"features.{number}.bias"], 1, 1
        )
        tap = torch.relu(x) if taps.get(number) == "r" else x
        if number in taps:
            unit = torch.nn.functional.normalize(tap, dim=1)
            expected += (unit[:2] - unit[1:]).square().sum(1).mean((1, 2))
        x = torch.relu(x)
    assert torch.allclose(standard(pixels[:2], pixels[1:]), expected, rtol=1e-4)
    ratio = standard(pixels[:2], pixels[1:]) / lpips("vgg")(images[:2], images[1:])
    assert ((ratio - 1).abs() > 0.2).all()


@pytest.mark.slow
def test_the_variant_of_3doodle_exchanges_mean_and_deviation(images):
    """Trap: its code divides by the mean and takes the deviation off."""
    tensors = features("vgg")
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    swapped = ((images - std) / mean) * std + mean
    theirs = VggDistance(tensors, "3doodle")(images[:2].movedim(-1, 1), images[1:].movedim(-1, 1))
    ours = VggDistance(tensors, "standard")(swapped[:2].movedim(-1, 1), swapped[1:].movedim(-1, 1))
    assert torch.allclose(theirs, ours, rtol=1e-3)
    assert not torch.allclose(
        theirs, VggDistance(tensors)(images[:2].movedim(-1, 1), images[1:].movedim(-1, 1)), rtol=1e-2
    )
