"""One job in a process of its own: what it says goes to a file, and it ends with the batch that it belongs to."""

import json
import multiprocessing
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from diff3ds.tasks.batch.commands import MODULES, run_command
from diff3ds.tasks.progress import Lines, Progress, Report

# Seconds from being told to stop to the end, whatever is not written by then: a step of a large network takes a minute.
GRACE = 60.0
# Seconds between two reports to who wants to see them.
OFTEN = 0.25
# Variables by which the libraries below numpy and torch are told their threads when they are loaded.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
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
        shown: whether the channel is told how far it is and what it says, as objects with `stage` or `line`, before
            the one with `state`.
    """

    command: str
    options: dict[str, Any]
    base: Path
    out: Path
    log: Path
    threads: int
    gpu: str | None
    shown: bool = False


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
    told = _told(work, channel)
    with suppress(OSError):
        channel.send_bytes(json.dumps(told).encode())


def _told(work: Work, channel: Connection) -> dict[str, Any]:
    """Does the job; says its outcome."""
    say: Callable[[str], None] = print
    report: Report = Lines(say)
    if work.shown:
        shown = _Shown(channel, report, say)
        report, say = shown.report, shown.say
    try:
        if work.gpu is not None:
            # Before CUDA is asked for anything.
            os.environ["CUDA_VISIBLE_DEVICES"] = work.gpu
        import torch

        torch.set_num_threads(work.threads)
        run_command(work.command, work.options, work.base, work.out, report, say)
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


class _Shown:
    """Tells a channel what a job reports and says, beside what is told of it anyway."""

    def __init__(self, channel: Connection, report: Report, say: Callable[[str], None]) -> None:
        self._channel, self._report, self._say = channel, report, say
        self._stage, self._due = "", 0.0

    def report(self, progress: Progress) -> None:
        """Tells where the job is, a few times a second."""
        now = time.monotonic()
        if progress.stage != self._stage or now >= self._due:
            self._stage, self._due = progress.stage, now + OFTEN
            self._tell({name: getattr(progress, name) for name in ("stage", "done", "total", "strokes", "note")})
        self._report(progress)

    def say(self, line: str) -> None:
        """Tells what the job says."""
        self._tell({"line": line})
        self._say(line)

    def _tell(self, what: dict[str, Any]) -> None:
        with suppress(OSError):
            self._channel.send_bytes(json.dumps(what).encode())


def interrupt(process: BaseProcess) -> None:
    """Tells a job's process to stop and keep what it has reached."""
    if process.pid is None:
        return
    if os.name == "nt":
        process.terminate()
    else:
        with suppress(ProcessLookupError):
            os.kill(process.pid, signal.SIGINT)


def kill(process: BaseProcess) -> None:
    """Ends a job's process with all that it has started."""
    if process.pid is None:
        return
    if os.name == "nt":
        process.kill()
    else:
        # One that is not yet the leader of a group is ended by itself.
        for end in (os.killpg, os.kill):
            with suppress(ProcessLookupError, PermissionError):
                end(process.pid, signal.SIGKILL)


def process_context(commands: set[str], threads: int) -> BaseContext:
    """What starts processes: copies of one that has loaded what the commands need, where the system can copy."""
    if os.name == "nt":
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["torch", *(MODULES[command] for command in sorted(commands))])
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ |= {name: str(threads) for name in THREADS}
    try:
        forkserver.ensure_running()
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            os.environ |= {} if value is None else {name: value}
    return context
