"""One job in a process of its own: what it says goes to a file, and it ends with the batch that it belongs to."""

import json
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from diff3ds.tasks.batch.commands import run_command
from diff3ds.tasks.progress import Lines

# Seconds from being told to stop to the end, whatever is not written by then: a step of a large network takes a minute.
GRACE = 60.0
# What another try would meet as well: the input is at fault.
FINAL = (ValueError, TypeError, ImportError, FileNotFoundError, NotADirectoryError, IsADirectoryError)


@dataclass(frozen=True)
class Work:
    """What a process is to do.

    Attributes:
        command, options, base: as in `Job`.
        out: folder of the run.
        log: file for what it says.
        threads: that it may use.
        gpu: the only one that it sees, "" for none, or None for what there is.
    """

    command: str
    options: dict[str, Any]
    base: Path
    out: Path
    log: Path
    threads: int
    gpu: str | None


def run_job(work: Work, channel: Connection) -> None:
    """Does a job once the channel says so, and tells there how it went; ends when the channel's other end does."""
    if hasattr(os, "setsid"):
        # Ctrl-C on the terminal is for the batch, which tells its jobs; and what a job starts can be ended with it.
        os.setsid()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        channel.recv_bytes()
    except EOFError:
        return
    _log_to(work.log)
    threading.Thread(target=_end_with, args=(channel,), daemon=True).start()
    told = _told(work)
    with suppress(OSError):
        channel.send_bytes(json.dumps(told).encode())


def _told(work: Work) -> dict[str, Any]:
    """Does the job; says its outcome."""
    say: Callable[[str], None] = print
    try:
        if work.gpu is not None:
            # Before CUDA is asked for anything.
            os.environ["CUDA_VISIBLE_DEVICES"] = work.gpu
        import torch

        torch.set_num_threads(work.threads)
        run_command(work.command, work.options, work.base, work.out, Lines(say), say)
    except KeyboardInterrupt:
        return {"state": "stopped"}
    except FINAL as error:
        say(f"{type(error).__name__}: {error}")
        return {"state": "failed", "message": str(error), "final": True}
    except Exception as error:
        traceback.print_exc()
        return {"state": "failed", "message": str(error) or type(error).__name__}
    return {"state": "done"}


def _log_to(path: Path) -> None:
    """All that this process and its children write goes to a file."""
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    for descriptor in (1, 2):
        os.dup2(file, descriptor)
    os.close(file)
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.close(null)
    sys.stdout = sys.stderr = os.fdopen(1, "w", buffering=1, encoding="utf-8", errors="replace", closefd=False)


def _end_with(channel: Connection) -> None:
    """Stops this process when its batch is gone: as by Ctrl-C, which keeps what is reached, and then in any case."""
    with suppress(EOFError, OSError):
        channel.recv_bytes()
    signal.raise_signal(signal.SIGINT) if os.name == "nt" else os.kill(os.getpid(), signal.SIGINT)
    time.sleep(GRACE)
    os._exit(1)
