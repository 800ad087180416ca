"""The checker of annotations in tests: beartype with Python's own rule that an int will do for a float (PEP 484)."""

import functools

import beartype

_check = beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))


def checked(function):
    """The function with its annotations checked; the check is made at the first call, as most are never called."""
    made = None

    @functools.wraps(function)
    def checking(*args, **kwargs):
        nonlocal made
        made = made or _check(function)
        return made(*args, **kwargs)

    return checking
