"""One browser for all tests of pages: it takes two seconds to start. It ends before tests of anything else begin."""

from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from viewer_browser import CHROMIUM, Browser

started: list[Browser] = []


@pytest.fixture
def browser() -> Iterator[Browser]:
    """As it is when it starts: pages have light colours. Afterwards it shows none, which would go on drawing."""
    if CHROMIUM is None:
        pytest.skip("there is no Chromium (Debian: apt-get install chromium)")
    if not started:
        started.append(Browser())
    started[0].prefer("light")
    yield started[0]
    started[0].ask("Page.navigate", url="about:blank")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(nextitem: pytest.Item | None) -> Generator[None]:
    """Other tests count the processes that theirs has."""
    yield
    if started and (nextitem is None or Path(__file__).parent not in nextitem.path.parents):
        started.pop().close()
