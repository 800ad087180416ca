"""Jobs that do not wait for each other, on several threads: what computes in numpy or in C lets other threads work."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from diff3ds.render.backends import get_num_threads, torch_on_one_thread

Result = TypeVar("Result")


def side_by_side(
    do: Callable[[int], Result], count: int, most: int, told: Callable[[int], None] = lambda done: None
) -> list[Result]:
    """What `do` gives for 0, 1, ..., in this order; torch computes on one thread in each.

    An error is that of the first job that fails in their order, whatever the threads do. After it, or an interrupt,
    jobs that have not begun are left out.

    Args:
        do: one job.
        count: of the jobs.
        most: threads at most, if that is less than `get_num_threads`.
        told: told how many jobs are done, in the caller's thread.
    """
    results: list[Result] = []
    with torch_on_one_thread():
        threads = min(get_num_threads(), most, count)
        if threads <= 1:
            for job in range(count):
                results.append(do(job))
                told(job + 1)
            return results
        with ThreadPoolExecutor(threads) as pool:
            # What goes wrong ends the iterator of `map`, which leaves out what has not begun.
            for result in pool.map(do, range(count)):
                results.append(result)
                told(len(results))
    return results
