"""The names `pydiffvg` and `diffvg` for scripts that import them."""

import sys
from types import ModuleType
from typing import Any

from diff3ds.pydiffvg.scene_classes import FilterType


def install() -> None:
    """From now on `import pydiffvg` finds this package, and `import diffvg` the names of filters."""
    sys.modules["pydiffvg"] = sys.modules[__package__]
    sys.modules["diffvg"] = _Compiled("diffvg", "What scripts take of DiffVG's compiled module.")


class _Compiled(ModuleType):
    """Stands in for DiffVG's compiled module, of which `FilterType` is used by scripts."""

    FilterType = FilterType

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(
            f"module 'diffvg' of diff3ds has no {name!r}: it stands in for DiffVG's compiled code; pydiffvg draws"
        )
