"""Ctrl-C while something large is imported: the program ends at once."""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from diff3ds.command_line.exit_codes import STOPPED


@contextmanager
def importing() -> Iterator[None]:
    """Within this block Ctrl-C ends the program; an exception within an import may be taken for something else.

    Nothing is to be kept yet. Where Ctrl-C is ignored, as in the background, or somebody else's, it stays so.
    """
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, lambda number, frame: os._exit(STOPPED))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
