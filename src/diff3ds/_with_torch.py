"""What torch is told of the package's classes: torch.load may make them, and a DataLoader hands them on as lists."""

from dataclasses import fields
from typing import Any, TypeVar

import torch
from torch.utils.data._utils.collate import default_collate_fn_map

Class = TypeVar("Class", bound=type)


def known_to_torch(cls: Class) -> Class:
    """The same frozen dataclass: pickled as a call with its fields, so that what a file holds is checked as it is made.

    `torch.load` makes it also with `weights_only=True`, its default, as soon as the class is imported. The default
    collation of a DataLoader gives lists, which `render_batch` takes: sketches may have any number of strokes, cameras
    any size of images.
    """

    def reduced(self: Any) -> tuple[type, tuple[Any, ...]]:
        return type(self), tuple(getattr(self, field.name) for field in fields(self))

    setattr(cls, "__reduce__", reduced)  # noqa: B010  to mypy an assignment is an error
    torch.serialization.add_safe_globals([cls])
    default_collate_fn_map[cls] = _listed
    return cls


def _listed(batch: list[Any], *, collate_fn_map: object = None) -> list[Any]:
    return list(batch)
