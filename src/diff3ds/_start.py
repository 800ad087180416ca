"""Entry point of the command `diff3ds`: what holds from the first moment on, before anything large is imported."""

import gc
import os
import sys
from contextlib import suppress

from diff3ds.command_line.exit_codes import STOPPED
from diff3ds.command_line.interrupt import importing

# As shells say that a program ended because nobody reads its output.
UNREAD = 128 + 13


def main() -> None:
    """Runs the command line; ends without a traceback at Ctrl-C, and where nobody reads what it writes."""
    with importing():
        from diff3ds.cli import main as run

    try:
        try:
            run()
        finally:
            for stream in (sys.stdout, sys.stderr):
                if stream is not None:
                    stream.flush()
            # On its way out Python looks through all that there is for garbage, with PyTorch for half a second.
            gc.freeze()
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
