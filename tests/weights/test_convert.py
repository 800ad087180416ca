"""Names and shapes of checkpoints: a round trip through the original's names, and the converters of diffusers."""

import pytest
import tiny
import torch
from needs import needs

from diff3ds.weights import convert

pytestmark = needs("diffusers")


@pytest.fixture(scope="module")
def full_size():
    """MVDream's UNet at its real size, without memory."""
    from diffusers import UNet2DConditionModel

    with torch.device("meta"):
        return UNet2DConditionModel(
            sample_size=32,
            block_out_channels=(320, 640, 1280, 1280),
            layers_per_block=2,
            cross_attention_dim=1024,
            attention_head_dim=[5, 10, 20, 20],
            use_linear_projection=True,
            class_embed_type="projection",
            projection_class_embeddings_input_dim=16,
        )


def test_all_690_names_of_mvdream(full_size):
    names = set(full_size.state_dict())
    assert len(names) == 690
    assert sum(p.numel() for p in full_size.parameters()) == 867_572_164
    original = {tiny.ldm_unet_name(name) for name in names}
    assert len(original) == 690
    assert not original & names
    assert {convert.unet_name(name) for name in original} == names


@pytest.mark.parametrize(
    ("original", "name"),
    [
        ("camera_embed.0.weight", "class_embedding.linear_1.weight"),
        ("time_embed.2.bias", "time_embedding.linear_2.bias"),
        ("input_blocks.0.0.weight", "conv_in.weight"),
        ("input_blocks.3.0.op.weight", "down_blocks.0.downsamplers.0.conv.weight"),
        ("input_blocks.4.0.skip_connection.weight", "down_blocks.1.resnets.0.conv_shortcut.weight"),
        (
            "input_blocks.8.1.transformer_blocks.0.attn1.to_q.weight",
            "down_blocks.2.attentions.1.transformer_blocks.0.attn1.to_q.weight",
        ),
        ("input_blocks.11.0.emb_layers.1.bias", "down_blocks.3.resnets.1.time_emb_proj.bias"),
        ("middle_block.1.proj_in.weight", "mid_block.attentions.0.proj_in.weight"),
        ("middle_block.2.out_layers.3.weight", "mid_block.resnets.1.conv2.weight"),
        ("output_blocks.2.1.conv.weight", "up_blocks.0.upsamplers.0.conv.weight"),
        ("output_blocks.5.2.conv.weight", "up_blocks.1.upsamplers.0.conv.weight"),
        ("output_blocks.11.1.norm.weight", "up_blocks.3.attentions.2.norm.weight"),
        ("out.2.bias", "conv_out.bias"),
    ],
)
def test_names(original, name):
    assert convert.unet_name(original) == name


def test_a_unet_keeps_its_weights_and_its_configuration():
    unet = tiny.make_mvdream_unet()
    weights = unet.state_dict()
    original = {tiny.ldm_unet_name(name): tensor for name, tensor in weights.items()}
    found = convert.to_diffusers(original)
    assert found.keys() == weights.keys()
    assert all(found[name] is weights[name] for name in weights)
    assert convert.to_diffusers(weights) is weights
    for key, value in convert.unet_config(found).items():
        said = unet.config[key]
        assert (list(said) if isinstance(said, tuple | list) else said) == value, key


def test_an_autoencoder_is_read_as_diffusers_reads_it():
    from diffusers.loaders.single_file_utils import convert_ldm_vae_checkpoint

    _, vae, tensors = tiny.make_single_mvdream()
    theirs = convert_ldm_vae_checkpoint(dict(tensors), dict(vae.config))
    original = {
        n.removeprefix("first_stage_model."): t for n, t in tensors.items() if n.startswith("first_stage_model")
    }
    ours = convert.vae_to_diffusers(original)
    weights = vae.state_dict()
    assert ours.keys() == theirs.keys() == weights.keys()
    assert all(torch.equal(ours[name], theirs[name]) for name in ours)
    assert all(torch.equal(ours[name], weights[name]) for name in ours)
    for key, value in convert.vae_config(ours).items():
        said = vae.config[key]
        assert (list(said) if isinstance(said, tuple | list) else said) == value, key


def test_a_unet_is_read_as_diffusers_reads_it():
    """Its reader knows no cameras, so both go without."""
    from diffusers.loaders.single_file_utils import convert_ldm_unet_checkpoint

    unet, _, tensors = tiny.make_single_mvdream()
    plain = {name: tensor for name, tensor in tensors.items() if "camera_embed" not in name}
    config = {"layers_per_block": 2, "class_embed_type": None}
    theirs = convert_ldm_unet_checkpoint(dict(plain), config)
    prefix = "model.diffusion_model."
    ours = convert.to_diffusers({n.removeprefix(prefix): t for n, t in plain.items() if n.startswith(prefix)})
    assert ours.keys() == theirs.keys() == {n for n in unet.state_dict() if not n.startswith("class_embedding")}
    assert all(torch.equal(ours[name], theirs[name]) for name in ours)


def test_weights_without_a_camera_have_no_classes():
    weights = {n: t for n, t in tiny.make_mvdream_unet().state_dict().items() if "class_embedding" not in n}
    found = convert.unet_config(weights)
    assert found["in_channels"] == 4
    assert not any("class" in key for key in found)


def test_what_are_no_weights_is_refused():
    weights = {n: t for n, t in tiny.make_mvdream_unet().state_dict().items() if not n.startswith("conv_in")}
    with pytest.raises(ValueError, match=r"not the weights of a UNet: there is no conv_in\.weight"):
        convert.unet_config(weights)
    with pytest.raises(ValueError, match="not the weights of an autoencoder"):
        convert.vae_config(weights)
