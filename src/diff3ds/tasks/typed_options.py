"""Values of options that Python code gives, checked by the type hints from which a command line reads its words."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

from diff3ds._settings import Options, with_options


def filled(who: str, spec: Options, hints: Mapping[str, Any], options: Mapping[str, Any]) -> Options:
    """Options of a command with these by their names, checked by the type hints of all.

    Args:
        who: whose options they are, for messages.
        hints: of all that may be given.

    Raises:
        TypeError: an option that there is not, or a value of another kind.
        ValueError: as the dataclasses of options.
    """
    for name in options:
        if name not in hints:
            raise TypeError(f"{who} has no option {name!r}; it has {', '.join(sorted(hints))}")
    return with_options(spec, **{name: typed(name, value, hints[name]) for name, value in options.items()})


def typed(name: str, value: Any, hint: Any) -> Any:
    """A value as its hint wants it: paths from text, tuples from lists.

    Raises:
        TypeError: it is nothing of the kind.
    """
    try:
        return _as(value, hint)
    except _OtherKindError:
        raise TypeError(f"{name} must be {_named(hint)}, got {value!r}") from None


class _OtherKindError(Exception):
    pass


def _as(value: Any, hint: Any) -> Any:
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return _first(value, inner)
    if origin is Literal:
        right = isinstance(value, str) and value in inner
    elif origin is tuple:
        return _tuple(value, inner)
    elif hint is Path:
        if isinstance(value, str | PathLike):
            return Path(value)
        right = False
    else:
        # True is a number in Python, and a whole number serves as any.
        kinds = (int, float) if hint is float else (hint,)
        right = isinstance(value, kinds) and (hint is bool or not isinstance(value, bool))
    if not right:
        raise _OtherKindError
    return value


def _first(value: Any, hints: tuple[Any, ...]) -> Any:
    for hint in hints:
        try:
            return _as(value, hint)
        except _OtherKindError:
            continue
    raise _OtherKindError


def _tuple(value: Any, hints: tuple[Any, ...]) -> tuple[Any, ...]:
    if not isinstance(value, tuple | list):
        raise _OtherKindError
    each = hints[:1] * len(value) if hints[-1] is Ellipsis else hints
    if len(each) != len(value):
        raise _OtherKindError
    return tuple(_as(item, hint) for item, hint in zip(value, each, strict=True))


def _named(hint: Any) -> str:
    """What a hint wants, in words."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(_named(part) for part in inner)
    if origin is Literal:
        return f"one of {', '.join(inner)}"
    if origin is tuple:
        count = "several of" if inner[-1] is Ellipsis else str(len(inner))
        return f"a tuple ({count}: {_named(inner[0])})"
    words = {int: "a whole number", float: "a number", str: "a text", bool: "True or False", Path: "a path"}
    return words.get(hint, "None" if hint is NoneType else str(hint))
