"""The command line: `diff3ds COMMAND`, each command a function of `diff3ds.tasks` with a dataclass of options.

Options need no torch, which takes seconds; what does the work is imported when they are read and found right.
"""

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

from rich.console import Console

from diff3ds._version import __version__
from diff3ds.command_line.console import PlainConsole, sayer
from diff3ds.command_line.exit_codes import FAULT, STOPPED
from diff3ds.command_line.make import Cameras, Doodle, Image, Mesh, Points, Text, Views
from diff3ds.command_line.many import Batch, Eval, Study
from diff3ds.command_line.read_options import as_typed, read_options
from diff3ds.command_line.set_up import Doctor, Fetch, Prior
from diff3ds.command_line.show import Apply, Export, Render, Studio, View
from diff3ds.tasks.progress import Stopped

_ABOUT = '3D sketches of rational Bézier strokes. "diff3ds --version" says which version this is.'
_TOO_LARGE = "there is not enough memory. Try fewer strokes, a smaller --batch or --size"


def main(arguments: list[str] | None = None) -> None:
    """Entry point of the command `diff3ds`."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments == ["--version"]:
        print(f"diff3ds {__version__}")
        return
    # A recipe has options of its own.
    views = Doodle if any(word.startswith("--recipe") for word in arguments) else Views
    commands = {"text": Text, "image": Image, "views": views, "cameras": Cameras, "mesh": Mesh, "points": Points}
    commands |= {
        "render": Render,
        "export": Export,
        "apply": Apply,
        "view": View,
        "studio": Studio,
        "eval": Eval,
        "batch": Batch,
        "study": Study,
        "prior": Prior,
        "fetch": Fetch,
        "doctor": Doctor,
    }
    command = None
    try:
        command = read_options(commands, arguments, _ABOUT)
        with _plain_warnings():
            command.run()
    except KeyboardInterrupt as stop:
        PlainConsole(stderr=True).print(_stopped(command, stop))
        sys.exit(STOPPED)
    except ValueError as error:
        _fail(as_typed(str(error), commands.get(arguments[0])))
    except BrokenPipeError:
        # Nobody reads the output: there is nobody to tell.
        raise
    except (OSError, ImportError, FloatingPointError) as error:
        _fail(str(error))
    except MemoryError:
        _fail(_TOO_LARGE)
    except RuntimeError as error:
        advice = _memory_advice(error)
        if advice is None:
            raise
        _fail(advice)


def _memory_advice(error: RuntimeError) -> str | None:
    """What to do about an error of torch that says there is not enough memory; None for all others."""
    import torch

    said = str(error)
    if isinstance(error, torch.cuda.OutOfMemoryError):
        return f"{said.partition('. ')[0]}. Try --precision float16, a smaller --batch or --size, or --device cpu"
    # Other devices than CUDA's have no error of their own for it.
    if "can't allocate memory" in said:
        return _TOO_LARGE
    return f"{said}. Try a smaller --batch or --size, or --device cpu" if "out of memory" in said else None


@contextmanager
def _plain_warnings() -> Iterator[None]:
    """Warnings as sentences, without the place in the code that they come from."""
    with warnings.catch_warnings():
        say = sayer(Console(stderr=True))
        warnings.showwarning = lambda message, *_, **__: say(f"warning: {message}")
        yield


def _stopped(command: object, stop: KeyboardInterrupt) -> str:
    """What Ctrl-C has left."""
    if isinstance(command, Fetch | Batch):
        return "stopped; the same command goes on"
    if isinstance(stop, Stopped):
        return "stopped; what was reached is written, --resume goes on"
    return "stopped before there was anything new to keep"


def _fail(message: str) -> NoReturn:
    PlainConsole(stderr=True).print(f"diff3ds: {message}", markup=False, highlight=False, soft_wrap=True)
    sys.exit(FAULT)


if __name__ == "__main__":
    main()
