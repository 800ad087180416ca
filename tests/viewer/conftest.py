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
    # What pages of files keep, and the size of a screen, are nothing for the next test.
    started[0].ask("Storage.clearDataForOrigin", origin="file://", storageTypes="all")
    started[0].ask("Emulation.clearDeviceMetricsOverride")
    started[0].ask("Page.navigate", url="about:blank")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(nextitem: pytest.Item | None) -> Generator[None]:
    """Other tests count the processes that theirs has."""
    yield
    if started and (nextitem is None or Path(__file__).parent not in nextitem.path.parents):
        started.pop().close()


def pytest_sessionfinish() -> None:
    """After an interrupt there is no test whose end would close it."""
    while started:
        started.pop().close()
