"""Entry point of the command `diff3ds`: what holds from the first moment on, before anything large is imported."""

import os
import signal
import sys
from contextlib import suppress

# As shells say that a program ended: by Ctrl-C, and because nobody reads its output.
STOPPED, UNREAD = 128 + 2, 128 + 13


def main() -> None:
    """Runs the command line; ends without a traceback at Ctrl-C, and where nobody reads what it writes."""
    # An exception within an import may be taken for something else, so that there is none: nothing is to be kept yet.
    heeded = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # not in the background, where it is ignored
    if heeded:
        signal.signal(signal.SIGINT, lambda number, frame: os._exit(STOPPED))
    from diff3ds.cli import main as run

    try:
        try:
            if heeded:
                signal.signal(signal.SIGINT, signal.default_int_handler)
            run()
        finally:
            for stream in (sys.stdout, sys.stderr):
                if stream is not None:
                    stream.flush()
    except KeyboardInterrupt:
        _quit(STOPPED)
    except BrokenPipeError:
        _quit(UNREAD)
    except OSError as error:
        # All others of the command are told by itself: this is its output, on a full disk.
        with suppress(OSError):
            sys.stderr.write(f"diff3ds: {error}\n")
            sys.stderr.flush()
        _quit(1)


def _quit(code: int) -> None:
    """Ends at once: on its way out Python would write what is left once more, and complain."""
    os._exit(code)
