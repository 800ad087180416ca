"""CLIP-Score and BLIP-Score on tiny models in the hub's layout: cosines, traps, truncation, gradients, errors."""

import json
import shutil

import pytest
import torch
from needs import needs

from diff3ds.metrics.blip import BlipScore
from diff3ds.metrics.clip import ClipScore

pytestmark = needs("transformers", "ftfy")


def pixels_of(images, size):
    """CLIP's preprocessing, by Pillow."""
    import numpy as np
    from PIL import Image

    done = []
    for image in (images * 255).round().to(torch.uint8).numpy():
        scale = size / min(image.shape[:2])
        picture = Image.fromarray(image).resize(
            (int(scale * image.shape[1]), int(scale * image.shape[0])), Image.BICUBIC
        )
        left, top = (picture.width - size) // 2, (picture.height - size) // 2
        done.append(np.asarray(picture.crop((left, top, left + size, top + size))) / 255.0)
    mean, std = [0.48145466, 0.4578275, 0.40821073], [0.26862954, 0.26130258, 0.27577711]
    return torch.tensor((np.stack(done) - mean) / std).movedim(-1, 1).float()


def unit(features):
    return features / features.norm(dim=-1, keepdim=True)


# CLIP


def test_scores_are_cosines_of_the_towers_projections(clip_folder, images):
    """Traps: no factor 100 or 2.5, no clamp at 0, and features that are of length 1."""
    from transformers import CLIPModel

    model = CLIPModel.from_pretrained(clip_folder).eval()
    score = ClipScore(clip_folder)
    tokens = score.tokenizer("a red chair", return_tensors="pt")
    with torch.no_grad():
        seen = unit(model.visual_projection(model.vision_model(pixels_of(images, 32)).pooler_output))
        said = unit(model.text_projection(model.text_model(**tokens).pooler_output))[0]
    cosines = seen @ said
    # A byte's rounding moves a pixel by 1/510, a cosine of this net by less than a hundredth.
    assert torch.allclose(score.text(images, "a red chair"), cosines, atol=0.01)
    assert torch.allclose(score.image(images, images[0]), seen @ seen[0], atol=0.01)
    # The other sign: what is negative must stay so.
    with torch.no_grad():
        score.model.text_projection.weight.neg_()
        assert torch.allclose(score.text(images, "a red chair"), -cosines, atol=0.01)
    assert float(cosines.abs().max()) > 0.05


def test_nothing_depends_on_what_get_image_features_returns(clip_folder, images, monkeypatch):
    """Trap: a tensor in transformers 4, an object in transformers 5. Only the model itself may call it."""
    from transformers import CLIPModel

    score = ClipScore(clip_folder)
    before = score.text(images, "a chair"), score.image(images, images[1])
    running = []

    def guarded(name):
        method = getattr(CLIPModel, name)

        def call(self, *arguments, **options):
            assert name == "forward" or running, f"the result of {name} depends on the version of transformers"
            running.append(name)
            try:
                return method(self, *arguments, **options)
            finally:
                running.pop()

        monkeypatch.setattr(CLIPModel, name, call)

    for name in ("forward", "get_image_features", "get_text_features"):
        guarded(name)
    assert torch.equal(score.text(images, "a chair"), before[0])
    assert torch.equal(score.image(images, images[1]), before[1])
    with pytest.raises(AssertionError, match="depends on the version"):
        score.model.get_image_features(pixel_values=torch.zeros(1, 3, 32, 32))


def test_identical_images_have_cosine_one(clip_folder, images):
    cosines = ClipScore(clip_folder).image(images, images[2])
    assert float(cosines[2]) == pytest.approx(1, abs=1e-6)
    assert (cosines[:2] < 0.999).all()


def test_long_phrases_are_cut_off(clip_folder, images):
    """77 tokens with both ends: of single letters, the first 75 count."""
    score = ClipScore(clip_folder)
    letters = "abcdefghij" * 10
    assert score.most == 77
    first = score.text(images, letters)
    assert torch.equal(first, score.text(images, letters[:75] + "zzzzz"))
    assert not torch.allclose(first, score.text(images, letters[:74] + "zzzzz"))


def test_gradients_reach_the_images(clip_folder, images, generator):
    score = ClipScore(clip_folder)
    score.model.double()
    views = (0.2 + 0.6 * images[:2]).double().requires_grad_()
    for function in (lambda x: score.text(x, "a chair"), lambda x: score.image(x, images[2].double())):
        (gradient,) = torch.autograd.grad(function(views).sum(), views)
        direction = torch.randn(views.shape, generator=generator, dtype=torch.float64)
        step, at = 1e-5, views.detach()
        difference = (function(at + step * direction) - function(at - step * direction)).sum() / (2 * step)
        assert float((gradient * direction).sum()) == pytest.approx(float(difference), rel=1e-4)
    assert not any(p.requires_grad for p in score.model.parameters())


def test_phrases_are_cleaned_as_clip_cleans_them(clip_folder, images):
    score = ClipScore(clip_folder)
    expected = score.text(images, 'a "cat\'s" bowl & fish')
    assert torch.equal(score.text(images, "A “cat’s”  bowl &amp; ﬁsh"), expected)


@pytest.mark.parametrize("phrase", ["  ", "&nbsp;"])
def test_an_empty_phrase_is_refused(clip_folder, images, phrase):
    with pytest.raises(ValueError, match="the phrase is empty"):
        ClipScore(clip_folder).text(images, phrase)


# BLIP


def test_blip_is_the_cosine_of_contrast(blip_folder, images):
    """Trap: use_itm_head defaults to True, which gives the logits of a match instead."""
    from transformers import BlipForImageTextRetrieval

    model = BlipForImageTextRetrieval.from_pretrained(blip_folder).eval()
    score = BlipScore(blip_folder)
    assert score.label == "blip-tiny"
    tokens = score.tokenizer("a chair", return_tensors="pt")
    with torch.no_grad():
        seen = unit(model.vision_proj(model.vision_model(pixel_values=pixels_of(images, 32)).last_hidden_state[:, 0]))
        text = model.text_encoder(input_ids=tokens["input_ids"], attention_mask=tokens["attention_mask"])
        said = unit(model.text_proj(text.last_hidden_state[:, 0]))[0]
    got = score.text(images, "a chair")
    assert torch.allclose(got, seen @ said, atol=0.01)
    assert float(got.abs().max()) > 0.05
    with torch.no_grad():
        for parameter in score.model.itm_head.parameters():
            parameter.fill_(9.0)
    assert torch.equal(score.text(images, "a chair"), got)


def test_blip_cuts_phrases_off_at_35_tokens(blip_folder, images):
    score = BlipScore(blip_folder)
    first = score.text(images, "a " * 33 + "b b b")
    assert torch.equal(first, score.text(images, "a " * 33 + "c"))
    assert not torch.allclose(first, score.text(images, "a " * 32 + "c c"))


# Folders that are no models


def copied(folder, to):
    shutil.copytree(folder, to)
    return to


def test_what_is_missing_is_said(clip_folder, blip_folder, tmp_path):
    with pytest.raises(FileNotFoundError, match="no such folder; one with a clip model"):
        ClipScore(tmp_path / "nowhere")
    with pytest.raises(FileNotFoundError, match=r"no config.json"):
        ClipScore(tmp_path)
    with pytest.raises(ValueError, match=r"a clip model is needed here, but config.json says model_type 'blip'"):
        ClipScore(blip_folder)
    with pytest.raises(ValueError, match="a blip model is needed here"):
        BlipScore(clip_folder)
    no_weights = copied(clip_folder, tmp_path / "pickled")
    (no_weights / "model.safetensors").rename(no_weights / "pytorch_model.bin")
    with pytest.raises(FileNotFoundError, match=r"no model.safetensors .* pickles \(.bin\) are not read"):
        ClipScore(no_weights)
    no_tokenizer = copied(clip_folder, tmp_path / "mute")
    (no_tokenizer / "tokenizer.json").unlink()
    with pytest.raises(FileNotFoundError, match="the tokenizer is missing"):
        ClipScore(no_tokenizer)


def test_weights_that_are_missing_are_not_made_up(clip_folder, tmp_path):
    from safetensors.torch import load_file, save_file

    folder = copied(clip_folder, tmp_path / "fewer")
    tensors = load_file(folder / "model.safetensors")
    del tensors["visual_projection.weight"]
    save_file(tensors, folder / "model.safetensors", {"format": "pt"})
    with pytest.raises(ValueError, match=r"1 weights are missing, the first is visual_projection.weight"):
        ClipScore(folder)


def test_weights_of_another_size_are_refused(clip_folder, tmp_path):
    folder = copied(clip_folder, tmp_path / "other")
    config = json.loads((folder / "config.json").read_text())
    config["projection_dim"] = 24
    (folder / "config.json").write_text(json.dumps(config))
    with pytest.raises(ValueError, match=r"the weights are not those of its config.json"):
        ClipScore(folder)
