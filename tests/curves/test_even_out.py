"""Flags along chains: against the rule done one run at a time, in closed form, and as the viewer's page has it."""

import itertools
import json
from importlib.resources import files

import numpy as np
import pytest
from viewer_browser import CHROMIUM, Browser

from diff3ds.curves.even_out import evened


def one_by_one(flags, length, least, closed):
    """The rule as it is said: the shortest run of a chain, of equals the first, becomes one with its neighbours."""
    flags = list(flags)
    while True:
        runs = [list(group) for _, group in itertools.groupby(range(len(flags)), key=lambda i: flags[i])]
        if closed and len(runs) > 1 and flags[0] == flags[-1]:
            runs[0] += runs.pop()
        totals = [sum(length[i] for i in run) for run in runs]
        if len(runs) < 2 or min(totals) >= least:
            return flags
        for i in runs[totals.index(min(totals))]:
            flags[i] = not flags[i]


def cases(count, seed=0):
    draw = np.random.default_rng(seed)
    for _ in range(count):
        steps = int(draw.integers(0, 14))
        yield draw.random(steps) < draw.choice([0.2, 0.5]), draw.integers(1, 4, steps), draw.random() < 0.5


def test_many_chains_at_once_are_evened_as_one_run_after_the_other():
    chains = list(cases(300))
    counts = [len(flags) for flags, _, _ in chains]
    flags, length = (np.concatenate([case[k] for case in chains]) for k in (0, 1))
    closed = np.repeat([case[2] for case in chains], counts)
    found = evened(flags, length.astype(float), 4, np.repeat(np.arange(len(chains)), counts), closed)
    expected = [flag for flags, length, closed in chains for flag in one_by_one(flags, length, 4, closed)]
    assert found.tolist() == expected


def test_short_runs_go_and_long_ones_stay():
    flags = np.array([1, 1, 1, 0, 1, 1, 0, 0, 0, 1], bool)
    chain = np.zeros(10, np.int64)
    assert evened(flags, np.ones(10), 2, chain).tolist() == [True] * 6 + [False] * 4
    # Round a closed chain the last goes on in the first.
    assert evened(flags, np.ones(10), 2, chain, np.ones(10, bool)).tolist() == [True] * 6 + [False] * 3 + [True]
    length = np.ones(10)
    length[[0, -1]] = np.inf
    assert evened(flags, length, 2, chain).tolist() == [True] * 6 + [False] * 3 + [True]
    # Two chains know nothing of each other.
    assert evened(np.array([1, 0], bool), np.ones(2), 2, np.array([0, 1])).tolist() == [True, False]
    assert evened(flags[:0], np.ones(0), 2, chain[:0]).tolist() == []


@pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium (Debian: apt-get install chromium)")
@pytest.mark.xdist_group("browser")
def test_the_page_has_the_same_rule():
    script = files("diff3ds.viewer").joinpath("surface/contours.js").read_text(encoding="utf-8")
    chains = [(flags.tolist(), bool(closed)) for flags, _, closed in cases(300, 1)]
    browser = Browser()
    try:
        asked = f"{script}\nJSON.stringify({json.dumps(chains)}.map(([flags, closed]) => evened(flags, closed, 3)))"
        found = json.loads(browser.value(asked))
    finally:
        browser.close()
    assert found == [one_by_one(flags, [1] * len(flags), 3, closed) for flags, closed in chains]
