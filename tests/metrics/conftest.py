"""Tiny networks that several tests share."""

import pytest
import torch
from tiny_networks import save_blip, save_clip


@pytest.fixture(scope="session")
def clip_folder(tmp_path_factory):
    pytest.importorskip("transformers")
    return save_clip(tmp_path_factory.mktemp("clip") / "clip-tiny")


@pytest.fixture(scope="session")
def blip_folder(tmp_path_factory):
    pytest.importorskip("transformers")
    return save_blip(tmp_path_factory.mktemp("blip") / "blip-tiny")


@pytest.fixture
def images(generator):
    """Three images with structure at all scales."""
    noise = torch.rand(3, 3, 6, 8, generator=generator)
    smooth = torch.nn.functional.interpolate(noise, (60, 80), mode="bicubic", antialias=True)
    return (smooth + 0.1 * torch.randn(3, 3, 60, 80, generator=generator)).clamp(0, 1).movedim(1, -1)
