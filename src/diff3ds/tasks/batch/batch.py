"""Jobs of a file by this machine, others that share its disk, or a Ray cluster: what `diff3ds batch` does."""

from collections.abc import Callable
from pathlib import Path

from diff3ds.tasks.batch.job_file import read_jobs
from diff3ds.tasks.batch.machine import places
from diff3ds.tasks.batch.options import BatchOptions
from diff3ds.tasks.batch.processes import Batch, ended_as_by_ctrl_c
from diff3ds.tasks.batch.summary import JobState, states_of, write_summary
from diff3ds.tasks.progress import Report


def run_batch(
    path: Path,
    out: Path,
    options: BatchOptions,
    report: Report = lambda progress: None,
    say: Callable[[str], None] = lambda line: None,
) -> list[JobState]:
    """Does all jobs of a file that are not done yet; writes summary.csv, summary.md and sheet.png.

    Several calls may share a folder, on one machine or many: each job is done by one of them.

    Args:
        path: the jobs.
        out: folder, with one for each job in it.
        report: called with the number of jobs that are settled.
        say: told what failed.

    Returns:
        Where each job of the file is.

    Raises:
        FileNotFoundError, ValueError, OSError: as `read_jobs` and `places`; the folder cannot be written.
        KeyboardInterrupt: Ctrl-C. What the jobs have reached is kept, and the same call goes on.
    """
    jobs = read_jobs(path)
    part, parts = options.part()
    mine = jobs[part::parts]
    out.mkdir(parents=True, exist_ok=True)
    here = places(options.workers, options.threads, options.gpus)
    batch = Batch(out, here, options.retries, options.timeout, mine, report, say)
    try:
        with ended_as_by_ctrl_c():
            batch.run()
    finally:
        states = states_of(jobs, out, batch.claims, batch.done)
        write_summary(out, states)
    done = [state.job for state in states if state.state == "done"]
    if done:
        # It loads torch.
        from diff3ds.tasks.batch.sheet import write_sheet

        write_sheet(out, done)
    return states
