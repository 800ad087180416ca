"""Many cases in one test: each is checked, and all that fail are named together."""

import functools
import inspect
from collections.abc import Iterable

import pytest


def sweep(names: str | tuple[str, ...], cases: Iterable):
    """As `pytest.mark.parametrize`, in one test. For tests of many small cases, which share all their fixtures."""
    several = not isinstance(names, str)
    cases = list(cases)
    assert cases, "a sweep needs cases"

    def decorate(test):
        signature = inspect.signature(test)

        @functools.wraps(test)
        def check(**fixtures):
            failures = []
            for case in cases:
                values = dict(zip(names, case, strict=True)) if several else {names: case}
                try:
                    test(**values, **fixtures)
                except (Exception, pytest.fail.Exception) as failure:
                    failure.add_note(f"case: {values}")
                    failures.append(failure)
            if failures:
                raise BaseExceptionGroup(f"{len(failures)} of {len(cases)} cases fail", failures)

        fixtures = [p for p in signature.parameters.values() if p.name not in (names if several else (names,))]
        check.__signature__ = signature.replace(parameters=fixtures)
        return check

    return decorate
