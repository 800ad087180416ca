"""What phrases become: directions, perpendicular negatives, tokens."""

import json
import math

import pytest
import tiny
import torch
from needs import needs

from diff3ds.guidance.networks import prompts
from diff3ds.weights.locate import Checkpoint

pytestmark = needs("transformers", "ftfy")


def degrees(*values: float) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


@pytest.fixture
def tokenizer(tmp_path):
    tiny.save_tokenizer(tmp_path / "tokenizer")
    return prompts.load_tokenizer(Checkpoint(tmp_path))


# Directions


def test_directions_around_the_object():
    azimuth = degrees(0, 44.9, -44.9, 45, -45, 90, 135, -135, 135.1, -135.1, 180, -180)
    found = prompts.directions(azimuth, torch.zeros_like(azimuth))
    names = [prompts.DIRECTIONS[i] for i in found.tolist()]
    assert names == ["front"] * 3 + ["side"] * 5 + ["back"] * 4


def test_overhead_overrides_the_others():
    assert prompts.directions(degrees(0, 0, 180), degrees(60, 60.1, 80)).tolist() == [
        prompts.FRONT,
        prompts.OVERHEAD,
        prompts.OVERHEAD,
    ]


def test_phrases_name_their_direction():
    assert prompts.seen_from("a chair") == [
        "a chair, front view",
        "a chair, side view",
        "a chair, back view",
        "a chair, overhead view",
    ]


# Perpendicular negatives. The expected numbers are the published a exp(-b r) + c written out.


def falling(a, b, c, r):
    return a * math.exp(-b * r) + c


def ahead(r):
    """Weights between front (r = 1) and side (r = 0)."""
    return [-falling(4, 0.5, -2.426, r), -falling(4, 0.5, -2.426, 1 - r)]


def behind(r):
    """Weights between side (r = 1) and back (r = 0)."""
    return [-falling(1, 0.5, -0.606, r), -falling(1, 0.5, 0.967, r)]


@pytest.mark.parametrize(
    ("azimuth", "positive", "negative", "weights"),
    [
        (0, [1, 0, 0, 0], ["front", "side"], ahead(1)),
        (30, [2 / 3, 1 / 3, 0, 0], ["front", "side"], ahead(2 / 3)),
        (-30, [2 / 3, 1 / 3, 0, 0], ["front", "side"], ahead(2 / 3)),
        (90, [0, 1, 0, 0], ["side", "front"], behind(1)),
        (135, [0, 0.5, 0.5, 0], ["side", "front"], behind(0.5)),
        (180, [0, 0, 1, 0], ["side", "front"], behind(0)),
    ],
)
def test_perpendicular_negatives(azimuth, positive, negative, weights):
    plan = prompts.turned(degrees(azimuth), degrees(10))
    assert torch.allclose(plan.positive[0], torch.tensor(positive, dtype=torch.float32), atol=1e-6)
    assert [prompts.DIRECTIONS[i] for i in plan.negative[:, 0].tolist()] == negative
    assert torch.allclose(plan.weights[:, 0], torch.tensor(weights), atol=1e-6)


def test_perpendicular_negatives_golden_values():
    """At the front the side is pushed away by 4 - 2.426, the front itself by nothing that counts."""
    assert torch.allclose(prompts.turned(degrees(0), degrees(0)).weights[:, 0], torch.tensor([0.0, -1.574]), atol=2e-4)
    behind = prompts.turned(degrees(180), degrees(0)).weights[:, 0]
    assert torch.allclose(behind, torch.tensor([-0.394, -1.967]), atol=1e-5)


def test_nothing_is_negative_from_overhead():
    plan = prompts.turned(degrees(0, 120), degrees(70, 80))
    assert plan.positive.tolist() == [[0, 0, 0, 1], [0, 0, 0, 1]]
    assert not plan.weights.any()


# Tokens


def test_tokens_are_padded_with_exclamation_marks(tokenizer):
    (row,) = prompts.tokens(tokenizer, ["ab c"]).tolist()
    end = row.index(tokenizer.eos_token_id)
    assert len(row) == 77
    assert row[0] == tokenizer.bos_token_id
    assert end == 4
    assert row[end + 1 :] == [0] * (77 - end - 1)


@pytest.mark.parametrize(
    ("phrase", "words"),
    [
        ("!", ["!</w>"]),
        ("a chair!", ["a</w>", "c", "h", "a", "i", "r</w>", "!</w>"]),
        ("a ! b", ["a</w>", "!</w>", "b</w>"]),
        # One word, which Stable Diffusion's vocabulary has whole.
        ("b!!", ["b</w>", "!", "!</w>"]),
        ("a?!b", ["a</w>", "?", "!</w>", "b</w>"]),
    ],
)
def test_exclamation_marks_in_phrases_are_no_padding(tokenizer, phrase, words):
    """OpenCLIP's tokenizer has no padding to look for: a mark that ends a word is "!</w>", token 256 there."""
    (row,) = prompts.tokens(tokenizer, [phrase]).tolist()
    assert tokenizer.convert_ids_to_tokens(row[1 : row.index(tokenizer.eos_token_id)]) == words


def test_phrases_are_cleaned_as_clip_cleans_them(tokenizer):
    """Each pair is one phrase to OpenAI's and OpenCLIP's tokenizers."""
    for given, meant in [
        ("a “cat’s” bowl", 'a "cat\'s" bowl'),
        ("salt &amp; pepper", "salt & pepper"),
        ("&amp;quot;cat&amp;quot;", '"cat"'),
        ("a ﬁsh", "a fish"),
        ("Ｃａｔ", "cat"),
        (" a\u00a0 cat \n", "a cat"),
    ]:
        assert torch.equal(prompts.tokens(tokenizer, [given]), prompts.tokens(tokenizer, [meant])), given


def test_a_tokenizer_that_pads_otherwise_is_refused(tmp_path):
    tiny.save_tokenizer(tmp_path / "tokenizer", pad="<|endoftext|>")
    with pytest.raises(
        ValueError, match=r"pads with token \d+ .<.endoftext.>., not with 0 .* not the tokenizer of Stable Diffusion 2"
    ):
        prompts.load_tokenizer(Checkpoint(tmp_path))


def test_a_phrase_that_just_fits_and_one_that_does_not(tokenizer):
    """Every letter is a token here, and one token stands at each end."""
    assert prompts.tokens(tokenizer, ["a" * 75]).shape == (1, 77)
    with pytest.raises(ValueError, match="78 tokens, 77 are read: it would end after '" + "a" * 75 + "'; shorten"):
        prompts.tokens(tokenizer, ["fine", "a" * 75 + "b"])


@pytest.mark.parametrize("phrase", ["", "  \n", "&nbsp;", "&amp;nbsp; "])
def test_an_empty_phrase_is_refused(phrase):
    with pytest.raises(ValueError, match="the phrase is empty"):
        prompts.check_phrase(phrase)


def test_phrases_are_encoded_by_the_last_hidden_layer(tmp_path):
    import transformers

    folder = tiny.save_stable_diffusion(tmp_path / "model")
    phrases = ["a cat", ""]
    found = prompts.encode_phrases(Checkpoint(folder), phrases, 32)
    tokenizer = transformers.CLIPTokenizer.from_pretrained(folder / "tokenizer")
    ids = tokenizer(phrases, padding="max_length", max_length=77, truncation=True, return_tensors="pt").input_ids
    with torch.no_grad():
        expected = transformers.CLIPTextModel.from_pretrained(folder / "text_encoder")(ids).last_hidden_state
    assert found.shape == (2, 77, 32)
    assert torch.equal(found, expected)


def test_a_text_encoder_of_another_model_is_refused(tmp_path):
    folder = tiny.save_stable_diffusion(tmp_path / "model")
    with pytest.raises(ValueError, match="takes texts of width 1024, the text encoder gives 32"):
        prompts.encode_phrases(Checkpoint(folder), ["a"], 1024)


def test_the_files_of_stable_diffusion_2_pad_so_too(tmp_path):
    """Its tokenizer_config.json names another pad than special_tokens_map.json, which is right."""
    tiny.save_tokenizer(tmp_path / "new" / "tokenizer")
    content = json.loads((tmp_path / "new" / "tokenizer" / "tokenizer.json").read_text())
    old = tmp_path / "old" / "tokenizer"
    old.mkdir(parents=True)
    (old / "vocab.json").write_text(json.dumps(content["model"]["vocab"]))
    merges = [" ".join(pair) if isinstance(pair, list) else pair for pair in content["model"]["merges"]]
    (old / "merges.txt").write_text("\n".join(["#version: 0.2", *merges]))
    end = {"content": "<|endoftext|>", "lstrip": False, "normalized": True, "rstrip": False, "single_word": False}
    config = {"bos_token": {**end, "content": "<|startoftext|>"}, "eos_token": end, "unk_token": end}
    config |= {"pad_token": "<|endoftext|>", "model_max_length": 77, "tokenizer_class": "CLIPTokenizer"}
    (old / "tokenizer_config.json").write_text(json.dumps(config))
    special = {
        "bos_token": "<|startoftext|>",
        "eos_token": "<|endoftext|>",
        "unk_token": "<|endoftext|>",
        "pad_token": "!",
    }
    (old / "special_tokens_map.json").write_text(json.dumps(special))
    found, expected = (
        prompts.tokens(prompts.load_tokenizer(Checkpoint(tmp_path / name)), ["poorly drawn face!"])
        for name in ("old", "new")
    )
    assert torch.equal(found, expected)
