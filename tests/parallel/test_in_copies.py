"""Jobs in copies of the process: their order, the error that is told, and a copy that is killed."""

import os
import signal
import sys
import time

import pytest
import torch

from diff3ds.parallel.in_copies import in_copies
from diff3ds.render.backends import get_num_threads, set_num_threads

linux = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux alone")


@pytest.fixture(autouse=True)
def _three_threads():
    set_num_threads(3)
    yield
    set_num_threads(None)


def test_results_come_in_their_order_and_each_copy_computes_on_one_thread():
    told: list[int] = []
    found = in_copies(lambda job: (torch.arange(job), torch.get_num_threads()), 7, 8, told.append)
    assert [len(values) for values, _ in found] == list(range(7))
    assert {threads for _, threads in found} == {1}
    assert told == [1, 2, 3, 4, 5, 6, 7]
    assert in_copies(lambda job: job, 0, 3) == []


@linux
def test_jobs_are_done_in_as_many_copies_as_are_allowed_which_compute_on_one_thread_each():
    found = in_copies(lambda job: (os.getpid(), get_num_threads()), 6, 2)
    assert len({process for process, _ in found}) == 2
    assert os.getpid() not in {process for process, _ in found}
    assert {threads for _, threads in found} == {1}
    assert in_copies(lambda job: os.getpid(), 2, 1) == [os.getpid()] * 2


def test_the_error_is_that_of_the_first_job_that_fails():
    def job(number: int) -> int:
        if number == 1:
            time.sleep(0.2)
        if number in (1, 3, 5):
            raise ValueError(f"job {number}")
        return number

    with pytest.raises(ValueError, match="job 1"):
        in_copies(job, 7, 3)


@linux
def test_what_a_killed_copy_has_not_said_is_done_by_the_caller():
    caller = os.getpid()

    def job(number: int) -> int:
        if number == 3 and os.getpid() != caller:
            os.kill(os.getpid(), signal.SIGKILL)
        return number

    assert in_copies(job, 9, 3) == list(range(9))


@linux
def test_an_interrupt_ends_the_copies():
    def told(count: int) -> None:
        raise KeyboardInterrupt

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        in_copies(lambda job: time.sleep(60 * (job > 0)), 3, 3, told)
    assert time.monotonic() - began < 30
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


def test_what_cannot_be_pickled_is_done_by_the_caller():
    assert [give() for give in in_copies(lambda job: lambda: job, 4, 2)] == [0, 1, 2, 3]
