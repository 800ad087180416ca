"""Jobs on several threads: their order, the error that is told, what is left out after it, and torch's threads."""

import threading
import time

import pytest
import torch

from diff3ds.parallel.side_by_side import side_by_side
from diff3ds.render.backends import set_num_threads


@pytest.fixture(autouse=True)
def _three_threads():
    torch_threads = torch.get_num_threads()
    torch.set_num_threads(2)
    set_num_threads(3)
    yield
    set_num_threads(None)
    torch.set_num_threads(torch_threads)


def test_jobs_run_at_once_and_results_come_in_their_order():
    meeting, told = threading.Barrier(3, timeout=60), []

    def job(number: int) -> tuple[int, int]:
        meeting.wait()
        return number, torch.get_num_threads()

    assert side_by_side(job, 6, 8, told.append) == [(number, 1) for number in range(6)]
    assert told == [1, 2, 3, 4, 5, 6]


def test_no_more_threads_than_are_allowed_and_at_least_the_callers():
    for most in (-1, 0, 1):
        assert side_by_side(lambda job: threading.get_ident(), 2, most) == [threading.get_ident()] * 2
    assert len(set(side_by_side(lambda job: threading.get_ident(), 50, 2))) <= 2
    assert side_by_side(lambda job: job, 0, 3) == []


def test_the_error_is_that_of_the_first_job_and_those_after_it_are_left_out():
    failed, done = threading.Event(), []

    def job(number: int) -> None:
        if number == 1:
            failed.set()
            raise ValueError("the second")
        if number == 0:
            assert failed.wait(60)
            raise ValueError("the first")
        time.sleep(0.001)
        done.append(number)

    with pytest.raises(ValueError, match="the first"):
        side_by_side(job, 2000, 3)
    assert len(done) < 1998


def test_an_interrupt_leaves_out_what_has_not_begun():
    done = []

    def job(number: int) -> None:
        time.sleep(0.001)
        done.append(number)

    def told(count: int) -> None:
        if count == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        side_by_side(job, 2000, 3, told)
    assert len(done) < 2000
