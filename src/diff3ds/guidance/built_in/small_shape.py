"""How large the network of the small prior is."""

from dataclasses import dataclass

# Of words, pixels, blocks: far more than a small network has; a damaged file may say anything.
MOST = 4096


@dataclass(frozen=True)
class Shape:
    """How large a network is.

    Attributes:
        words: of the vocabulary.
        size: of the images, pixels.
        patch: side of a patch, pixels.
        channels: of the convolutions.
        width: of a token.
        depth: blocks.
        heads: of attention.
    """

    words: int
    size: int = 64
    patch: int = 8
    channels: int = 16
    width: int = 256
    depth: int = 8
    heads: int = 4

    def __post_init__(self) -> None:
        for name in ("words", "size", "patch", "channels", "width", "depth", "heads"):
            if not 1 <= getattr(self, name) <= MOST:
                raise ValueError(f"{name} must lie in 1 to {MOST}, got {getattr(self, name)}")
        if self.size % self.patch or self.width % self.heads:
            raise ValueError(
                f"a picture's size must be a multiple of patch, got {self.size} and {self.patch}, and width of the "
                f"number of heads, got {self.width} and {self.heads}"
            )
