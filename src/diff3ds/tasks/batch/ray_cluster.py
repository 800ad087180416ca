"""Jobs on a Ray cluster: workers of one job each, spread over its machines, which share the folder of the batch."""

import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from diff3ds.tasks.batch.batch_options import BatchOptions
from diff3ds.tasks.batch.claims import Claims
from diff3ds.tasks.batch.finished import run_record
from diff3ds.tasks.batch.job_file import Job
from diff3ds.tasks.batch.processes import ATTEMPTS
from diff3ds.tasks.batch.summary import JobState, done_state
from diff3ds.tasks.progress import Progress, Report

# Seconds between looks at what is done.
LOOK = 2.0


def run_on_ray(
    path: Path, out: Path, jobs: Sequence[Job], options: BatchOptions, report: Report, say: Callable[[str], None]
) -> dict[str, JobState]:
    """Has workers do the jobs: each is this command on some machine, with one job at a time and the same folder.

    Which of them does which job they decide among themselves, as machines without Ray do; so none is done twice, and
    workers may come and go.

    Returns:
        Where the jobs are that are done, by name.

    Raises:
        ImportError: without Ray.
        ConnectionError: no cluster at the address.
    """
    try:
        import ray
    except ImportError as error:
        raise ImportError('--runner ray needs Ray: pip install "diff3ds[ray]"') from error
    threads = options.threads or 1
    ray.init(address=options.address, log_to_driver=False, include_dashboard=False, logging_level="error")
    try:
        here = ray.cluster_resources()
        gpus = int(here.get("GPU", 0)) if options.gpus != "none" else 0
        count = min(options.workers or gpus or max(1, int(here["CPU"]) // threads), len(jobs))
        words = _words(path, out, options, threads)
        worker = ray.remote(num_cpus=threads, num_gpus=1 if gpus else 0, max_retries=options.retries)(_work)
        say(f"{count} workers on {len(ray.nodes())} machines of the cluster")
        return _watched([worker.remote(words, str(Path.cwd())) for _ in range(count)], out, jobs, report, say, ray)
    finally:
        # Ends the workers, and Ray what they have begun.
        ray.shutdown()


def _words(path: Path, out: Path, options: BatchOptions, threads: int) -> list[str]:
    """The command of a worker."""
    words = [str(path.absolute()), "-o", str(out.absolute()), "--workers", "1", "--threads", str(threads)]
    words += ["--retries", str(options.retries), "--quiet"]
    words += ["--gpus", "none"] if options.gpus == "none" else []
    words += ["--timeout", str(options.timeout)] if options.timeout else []
    return words + (["--shard", options.shard] if options.shard else [])


def _work(words: list[str], folder: str) -> tuple[int, str]:
    """Runs the command on a machine of the cluster; gives its exit code, and what it said."""
    batch = [sys.executable, "-m", "diff3ds.cli", "batch", *words]
    done = subprocess.run(batch, cwd=folder, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    return done.returncode, done.stderr


def _watched(
    workers: list[Any], out: Path, jobs: Sequence[Job], report: Report, say: Callable[[str], None], ray: Any
) -> dict[str, JobState]:
    """Waits for the workers, and tells how far they are."""
    done: dict[str, JobState] = {}
    claims = Claims(out / ATTEMPTS)
    while True:
        for job in jobs:
            if job.name not in done and (record := run_record(out / job.name)) is not None:
                done[job.name] = done_state(job, record, claims)
        report(Progress("jobs", len(done), len(jobs), None, 0))
        if not workers:
            return done
        ended, workers = ray.wait(workers, num_returns=len(workers), timeout=LOOK)
        for one in ended:
            try:
                code, said = ray.get(one)
            except ray.exceptions.RayError as error:
                code, said = 1, str(error)
            if code not in (0, 1) or (code == 1 and said):
                say(f"a worker ended with code {code}: {said.strip()}")
