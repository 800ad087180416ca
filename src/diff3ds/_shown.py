"""How notebooks show sketches and renderings: by a room above theirs, which the package names when it is imported."""

from collections.abc import Callable
from typing import Any

# Gives the PNG file of a sketch or a rendering.
png_of: Callable[[Any], bytes]
