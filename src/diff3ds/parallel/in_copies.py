"""Jobs that do not wait for each other, in copies of this process: Python computes in one thread at a time."""

import multiprocessing
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from typing import Any, TypeVar

import torch

from diff3ds.parallel.side_by_side import side_by_side
from diff3ds.render.backends import get_num_threads, torch_on_one_thread

Result = TypeVar("Result")


def in_copies(
    do: Callable[[int], Result], count: int, most: int, told: Callable[[int], None] = lambda done: None
) -> list[Result]:
    """What `do` gives for 0, 1, ..., in this order, and the error of the first job that fails; as `side_by_side`.

    A copy (`fork`) has all that its parent has, so that nothing is handed to it; what it changes, such as what is kept
    for later, it changes for itself. Copies are made on Linux alone, in the main thread, and where CUDA has not begun,
    which no copy can go on with; elsewhere there are threads, and the same results.

    Args:
        do: one job; it draws no random numbers, and what it gives can be pickled.
        count: of the jobs.
        most: copies at most, if that is less than `get_num_threads`.
        told: told how many jobs are done.
    """
    copies = min(get_num_threads(), most, count)
    can = sys.platform == "linux" and threading.current_thread() is threading.main_thread()
    if copies <= 1 or not can or torch.cuda.is_initialized():  # type: ignore[no-untyped-call]
        return side_by_side(do, count, most, told)
    found: dict[int, tuple[Any, Exception | None]] = {}
    children: dict[Connection, int] = {}
    # The first job that fails, as far as is known; those before it may fail too.
    failed = count
    try:
        for first in range(copies):
            channel, child = _copy(do, range(first, count, copies))
            children[channel] = child
        # Until all is known before the first failure.
        while children and len(found) < count and not (failed < count and all(job in found for job in range(failed))):
            ready = wait(list(children))
            for channel in [one for one in children if one in ready]:
                try:
                    job, *outcome = pickle.loads(channel.recv_bytes())
                except (EOFError, OSError):
                    os.waitpid(children.pop(channel), 0)
                    continue
                result, error = outcome
                found[job] = result, error
                failed = failed if error is None else min(failed, job)
                told(len(found))
    finally:
        for channel, child in children.items():
            channel.close()
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
    results = []
    for job in range(count):
        # What a copy could not say, such as one that was killed, this process does itself.
        result, error = found[job] if job in found else (do(job), None)
        if error is not None:
            raise error
        results.append(result)
    return results


def _copy(do: Callable[[int], Result], jobs: range) -> tuple[Connection, int]:
    """Starts a copy of this process that does some jobs until one fails; what tells what they give, and its number."""
    receive, send = multiprocessing.Pipe(duplex=False)
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        # Of threads of the libraries below, which no copy has: they compute without them then.
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child:
        send.close()
        return receive, child
    try:
        # Ctrl-C is for the parent, which ends its copies.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        receive.close()
        with torch_on_one_thread(1):
            for job in jobs:
                try:
                    told: tuple[int, Any, Exception | None] = job, do(job), None
                except Exception as error:
                    told = job, None, error
                send.send_bytes(pickle.dumps(told))
                if told[2] is not None:
                    break
    finally:
        os._exit(0)
