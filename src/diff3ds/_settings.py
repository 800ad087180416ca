"""Options as dataclasses, and checks of them that need no torch: the command line makes them before torch is loaded.

Options may lie in groups, which are dataclasses too; each has one name, whatever its group.
"""

import dataclasses
import math
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

# Images beyond this side, pixels, are taken for a mistake.
MAX_SIZE = 65536

Options = TypeVar("Options")


def option_values(options: Any) -> dict[str, Any]:
    """The values of all options by name, those of groups among them."""
    found: dict[str, Any] = {}
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        found |= option_values(value) if dataclasses.is_dataclass(value) else {field.name: value}
    return found


def option_hints(kind: Any) -> dict[str, Any]:
    """The type hints of all options by name, those of groups among them, in a dataclass that may be generic."""
    base = get_origin(kind) or kind
    given = dict(zip(getattr(base, "__parameters__", ()), get_args(kind), strict=True))
    hints = get_type_hints(base)
    found: dict[str, Any] = {}
    for field in dataclasses.fields(base):
        hint = given.get(hints[field.name], hints[field.name])
        group = dataclasses.is_dataclass(get_origin(hint) or hint)
        found |= option_hints(hint) if group else {field.name: hint}
    return found


def with_options(options: Options, **values: Any) -> Options:
    """The same options, but for these, whatever their groups.

    Raises:
        TypeError: there is no option of that name.
        ValueError: as the dataclasses.
    """
    for name in values.keys() - option_values(options).keys():
        raise TypeError(f"{type(options).__name__} has no option {name!r}")
    changes: dict[str, Any] = {}
    for field in dataclasses.fields(options):  # type: ignore[arg-type] # a dataclass
        value = getattr(options, field.name)
        if not dataclasses.is_dataclass(value):
            changes |= {field.name: values[field.name]} if field.name in values else {}
        elif inner := {name: values[name] for name in values.keys() & option_values(value).keys()}:
            changes[field.name] = with_options(value, **inner)
    return dataclasses.replace(options, **changes)  # type: ignore[type-var]


def require_finite(options: Any) -> None:
    """Raises ValueError that names the first field of a dataclass with a number that is not finite."""
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        numbers = value if isinstance(value, tuple) else (value,)
        if any(isinstance(number, float) and not math.isfinite(number) for number in numbers):
            got = " ".join(map(str, numbers))
            raise ValueError(f"{field.name} must be finite, got {got}")


def check_seed(seed: int) -> None:
    """Raises ValueError for what torch's generators do not take."""
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < 1 << 63:
        raise ValueError(f"seed must be a whole number from 0 to 2^63 - 1, got {seed!r}")


def check_level(detail: float, most: int | None) -> None:
    """Raises ValueError for a detail that is not from 0 to 1, or less than one stroke."""
    if not (isinstance(detail, int | float) and 0 <= detail <= 1):
        raise ValueError(f"detail must be from 0 (one stroke) to 1 (all strokes), got {detail!r}")
    if most is not None and not (isinstance(most, int) and most >= 1):
        raise ValueError(f"strokes must be a whole number, at least 1, got {most!r}")
