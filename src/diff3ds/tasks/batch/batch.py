"""Jobs of a file by this machine, others that share its disk, or a Ray cluster: what `diff3ds batch` does."""

from collections.abc import Callable
from pathlib import Path

from diff3ds._files import existing_folder
from diff3ds.tasks.batch.batch_options import BatchOptions
from diff3ds.tasks.batch.claims import Claims
from diff3ds.tasks.batch.job_file import read_jobs
from diff3ds.tasks.batch.machine import places
from diff3ds.tasks.batch.processes import ATTEMPTS, Batch, ended_as_by_ctrl_c
from diff3ds.tasks.batch.ray_cluster import run_on_ray
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
    existing_folder(out)
    part, parts = options.part()
    mine = jobs[part::parts]
    out.mkdir(parents=True, exist_ok=True)
    done: dict[str, JobState] = {}
    try:
        with ended_as_by_ctrl_c():
            if options.runner == "ray":
                done = run_on_ray(path, out, mine, options, report, say)
            else:
                here = places(options.workers, options.threads, options.gpus)
                done = Batch(out, here, options.retries, options.timeout, mine, report, say).run()
    finally:
        states = states_of(jobs, out, Claims(out / ATTEMPTS), done)
        write_summary(out, states)
    if drawn := [state.job for state in states if state.state == "done"]:
        # It loads torch.
        from diff3ds.tasks.batch.sheet import write_sheet

        write_sheet(out, drawn)
    return states
