"""One browser for all tests of pages: it takes two seconds to start."""

from collections.abc import Iterator

import pytest
from viewer_browser import CHROMIUM, Browser


@pytest.fixture(scope="session")
def started_browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("there is no Chromium (Debian: apt-get install chromium)")
    browser = Browser()
    yield browser
    browser.close()


@pytest.fixture
def browser(started_browser) -> Browser:
    """As it is when it starts: the page shows light colours."""
    started_browser.prefer("light")
    return started_browser
