"""While something large is imported: Ctrl-C ends the program at once, and nothing looks for garbage."""

import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from diff3ds.command_line.exit_codes import STOPPED


@contextmanager
def importing() -> Iterator[None]:
    """Within this block Ctrl-C ends the program; an exception within an import may be taken for something else.

    Nothing is to be kept yet. Where Ctrl-C is ignored, as in the background, or somebody else's, it stays so. What is
    imported stays: looking through it for garbage, then and later on, takes a third of the time that the import does.
    """
    with _without_collection(), _ended_at_once():
        yield


@contextmanager
def _without_collection() -> Iterator[None]:
    enabled, modules = gc.isenabled(), len(sys.modules)
    gc.disable()
    try:
        yield
    finally:
        if len(sys.modules) > modules:
            gc.freeze()
        if enabled:
            gc.enable()


@contextmanager
def _ended_at_once() -> Iterator[None]:
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, lambda number, frame: os._exit(STOPPED))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
