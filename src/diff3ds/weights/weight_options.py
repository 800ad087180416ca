"""What a user says of weights: where they are, and what is to be fetched."""

import re
from dataclasses import dataclass
from pathlib import Path

HUB_NAME = re.compile(r"[\w.-]+/[\w.-]+")


@dataclass(frozen=True)
class Source:
    """Where a user says that weights are.

    Attributes:
        place: a folder, a single file, or a repository of the hub, owner/name.
        revision: commit, tag or branch of a repository; None is "main".
        variant: of the UNet's file, such as "fp16" in `diffusion_pytorch_model.fp16.safetensors`, and of other parts
            where they have it; None takes what there is.
        trust_pickle: allows a single file that is a pickle, which can run code of whoever made it (--allow-pickle).
    """

    place: str
    revision: str | None = None
    variant: str | None = None
    trust_pickle: bool = False

    @classmethod
    def parse(cls, text: str, variant: str | None = None, trust_pickle: bool = False) -> "Source":
        """A source from a path or "owner/name" or "owner/name@revision"; a path that exists is a path.

        Raises:
            ValueError: it is none of these.
        """
        name, _, revision = text.partition("@")
        if text and Path(text).expanduser().exists():
            return cls(text, None, variant, trust_pickle)
        if not HUB_NAME.fullmatch(name):
            raise ValueError(f"weights must be a folder or file that exists or owner/name[@revision], got {text!r}")
        return cls(name, revision or None, variant, trust_pickle)

    def __str__(self) -> str:
        return f"{self.place}@{self.revision}" if self.revision else self.place


@dataclass(frozen=True)
class FetchOptions:
    """Options of `diff3ds fetch`.

    Attributes:
        weights: a repository of the hub, owner/name or owner/name@revision, instead of those that are known.
        variant: of a prior's files, such as fp16; by default half precision where it is published.
    """

    weights: str | None = None
    variant: str | None = None
