"""From phrases to what a text-conditioned UNet takes, and what a phrase says of an object seen from some direction."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch

from diff3ds._shapes import Float, Int, Tensor
from diff3ds.weights.clip_text import cleaned, clip_tokens
from diff3ds.weights.locate import Checkpoint
from diff3ds.weights.read import load_part

# Tokens that the text encoders here take, with one at each end.
LENGTH = 77
# Stable Diffusion 2 pads with "!". Another pad gives other embeddings, to which the UNet was not trained.
PAD = 0

DIRECTIONS = ("front", "side", "back", "overhead")
FRONT, SIDE, BACK, OVERHEAD = range(4)
# Half the width of "front" and "back", and the elevation above which a view is from overhead, degrees.
HALF_FRONT, HIGH = 45.0, 60.0
# (a, b, c) of the weights -(a exp(-b r) + c) of negative directions: between front and side, either; side, looking
# between side and back; the nearer one there (Armandpour et al. 2023, with the values of threestudio).
FRONT_SIDE, SIDE_BACK, NEAR_BACK = (4.0, 0.5, -2.426), (1.0, 0.5, -0.606), (1.0, 0.5, 0.967)


def seen_from(phrase: str) -> list[str]:
    """The phrase with each of `DIRECTIONS` appended."""
    return [f"{phrase}, {direction} view" for direction in DIRECTIONS]


def directions(azimuth: Float[Tensor, " B"], elevation: Float[Tensor, " B"]) -> Int[Tensor, " B"]:
    """Index in `DIRECTIONS` of where cameras look from.

    Args:
        azimuth: degrees in [-180, 180], 0 in front of the object.
        elevation: degrees.
    """
    found = torch.full(azimuth.shape, SIDE)
    found[azimuth.abs() < HALF_FRONT] = FRONT
    found[azimuth.abs() > 180 - HALF_FRONT] = BACK
    found[elevation > HIGH] = OVERHEAD
    return found


@dataclass(frozen=True, eq=False)
class Turned:
    """What perpendicular negative guidance makes of directions, between which it interpolates.

    Attributes:
        positive: fraction of each of `DIRECTIONS` in the positive text; sums to 1.
        negative: index in `DIRECTIONS` of the two negative texts.
        weights: of those, at most about 0.
    """

    positive: Float[Tensor, "B 4"]
    negative: Int[Tensor, "2 B"]
    weights: Float[Tensor, "2 B"]


def turned(azimuth: Float[Tensor, " B"], elevation: Float[Tensor, " B"]) -> Turned:
    """Texts and weights of perpendicular negative guidance (Armandpour et al. 2023) for cameras, angles in degrees."""
    around = azimuth.abs().float() / 90
    ahead, above = around < 1, elevation > HIGH
    # 1 at the front and at the side behind it, falling to 0 at the next one.
    near = torch.where(ahead, 1 - around, 2 - around)
    positive = torch.zeros(len(azimuth), len(DIRECTIONS))
    rows = torch.arange(len(azimuth))
    first, second = torch.where(ahead, FRONT, SIDE), torch.where(ahead, SIDE, BACK)
    positive[rows, first] = near
    positive[rows, second] = 1 - near
    positive[above] = torch.eye(len(DIRECTIONS))[OVERHEAD]
    negative = torch.where(ahead, torch.tensor([[FRONT], [SIDE]]), torch.tensor([[SIDE], [FRONT]]))
    ahead_weights = torch.stack([_falling(FRONT_SIDE, near), _falling(FRONT_SIDE, 1 - near)])
    behind_weights = torch.stack([_falling(SIDE_BACK, near), _falling(NEAR_BACK, near)])
    weights = -torch.where(ahead, ahead_weights, behind_weights)
    return Turned(positive, negative, torch.where(above, 0.0, weights))


def _falling(values: tuple[float, float, float], fraction: Tensor) -> Tensor:
    a, b, c = values
    return a * torch.exp(-b * fraction) + c


def check_phrase(phrase: str) -> str:
    """The phrase without spaces around it.

    Raises:
        ImportError: ftfy, which cleans phrases, is not installed.
        ValueError: there is nothing else.
    """
    if not cleaned(phrase):
        raise ValueError("the phrase is empty: say what to draw")
    return phrase.strip()


def load_tokenizer(checkpoint: Checkpoint) -> Any:
    """The tokenizer of a checkpoint.

    Raises:
        ValueError: it is not that of Stable Diffusion 2, or cannot be read.
    """
    import transformers

    where = checkpoint.path / "tokenizer"
    try:
        tokenizer = transformers.CLIPTokenizer.from_pretrained(str(where), local_files_only=True)
    except Exception as error:  # whatever a broken file makes the reader stumble over
        raise ValueError(f"{where}: not a tokenizer ({error})") from error
    if tokenizer.pad_token_id != PAD:
        raise ValueError(
            f"{where}: pads with token {tokenizer.pad_token_id} ({tokenizer.pad_token}), not with {PAD} (!): this is "
            "not the tokenizer of Stable Diffusion 2"
        )
    return tokenizer


def tokens(tokenizer: Any, phrases: Sequence[str]) -> Int[Tensor, "P L"]:
    """Padded tokens of phrases.

    Raises:
        ImportError: as `check_phrase`.
        ValueError: one is too long; it says where it would be cut.
    """
    rows = []
    for phrase in phrases:
        row = clip_tokens(tokenizer, phrase, verbose=False).input_ids
        if len(row) > LENGTH:
            kept = tokenizer.decode(row[: LENGTH - 1], skip_special_tokens=True)
            raise ValueError(
                f"a phrase of {len(row)} tokens, {LENGTH} are read: it would end after {kept!r}; shorten it"
            )
        rows.append(row + [tokenizer.pad_token_id] * (LENGTH - len(row)))
    return torch.tensor(rows)


def encode_phrases(checkpoint: Checkpoint, phrases: Sequence[str], width: int) -> Float[Tensor, "P L D"]:
    """Encodes phrases by the text encoder of a checkpoint, float32, on the CPU. It is loaded for this call only.

    Args:
        width: D, as the UNet takes it.

    Raises:
        ValueError: a phrase that is too long, a tokenizer or text encoder of another model.
    """
    import transformers

    read = tokens(load_tokenizer(checkpoint), phrases)
    hidden = checkpoint.config("text_encoder").get("hidden_size")
    if hidden != width:
        raise ValueError(f"{checkpoint.path}: the UNet takes texts of width {width}, the text encoder gives {hidden}")
    encoder = load_part(transformers.CLIPTextModel, checkpoint, "text_encoder", torch.float32)
    with torch.no_grad():
        return torch.as_tensor(encoder(read).last_hidden_state)
