"""Jobs by processes of this machine: each is done once, whoever is killed."""

import json
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from diff3ds.tasks.batch.claims import BEAT, Claim, Claims, Outcome, shortened
from diff3ds.tasks.batch.finished import is_finished, run_record
from diff3ds.tasks.batch.job_file import Job
from diff3ds.tasks.batch.job_process import GRACE, Work, interrupt, kill, process_context, run_job
from diff3ds.tasks.batch.machine import Place
from diff3ds.tasks.batch.summary import JobState, done_state
from diff3ds.tasks.progress import Progress, Report

# Folder of the tries, in that of the batch.
ATTEMPTS = "attempts"
# Seconds between looks at jobs that others are at.
LOOK = 2.0


@dataclass
class Running:
    """A job that a process of this machine is at."""

    job: Job
    place: Place
    claim: Claim
    process: BaseProcess
    channel: Connection
    begun: float
    beaten: float
    # When it is killed, once it was told to stop; and what for.
    killed_at: float | None = None
    why: str = ""

    def interrupt(self) -> None:
        """Tells the job to stop and keep what it has reached."""
        self.killed_at = time.monotonic() + GRACE
        interrupt(self.process)


@dataclass
class Batch:
    """The jobs of one call of the command, and where each is.

    Attributes:
        out: folder of the batch.
        places: for one job at a time each.
        retries: more tries of a job after the first.
        timeout: seconds of a try.
        jobs: all that are to be done.
        report, say: told how many are done, and what failed.
        done: where jobs are that are, by name.
        failed: names of those that are not tried again.
    """

    out: Path
    places: list[Place]
    retries: int
    timeout: float | None
    jobs: Sequence[Job]
    report: Report
    say: Callable[[str], None]
    claims: Claims = field(init=False)
    done: dict[str, JobState] = field(default_factory=dict)
    failed: list[str] = field(default_factory=list)
    _waiting: deque[Job] = field(init=False)
    _elsewhere: list[Job] = field(default_factory=list)
    _running: list[Running] = field(default_factory=list)
    _tries: dict[str, int] = field(default_factory=dict)
    _looked: float = 0.0

    def __post_init__(self) -> None:
        self.claims = Claims(self.out / ATTEMPTS)
        self._waiting = deque(self.jobs)

    def run(self) -> dict[str, JobState]:
        """Does what is to be done; whatever ends it, its processes end before.

        Returns:
            Where the jobs are that are done, by name.

        Raises:
            KeyboardInterrupt: Ctrl-C; what the jobs have reached is kept.
            OSError: the folder cannot be written.
        """
        # What earlier calls have tried does not count.
        self._tries = {job.name: tries for job in self.jobs if (tries := self.claims.tries(job.name))}
        context = process_context({job.command for job in self.jobs}, self.places[0].threads)
        self._tell()
        try:
            while self._waiting or self._elsewhere or self._running:
                self._fill(context)
                self._rest()
                self._keep()
        finally:
            self._stop_all()
        return self.done

    def _tell(self) -> None:
        self.report(Progress("jobs", len(self.done) + len(self.failed), len(self.jobs), None, 0))

    def _is_done(self, job: Job, record: Mapping[str, Any]) -> None:
        self.done[job.name] = done_state(job, record, self.claims)

    # Jobs that begin

    def _fill(self, context: BaseContext) -> None:
        """Begins jobs, as long as there are places and jobs that are free."""
        taken = [running.place for running in self._running]
        free = [place for place in self.places if place not in taken]
        if free and not self._waiting and time.monotonic() - self._looked > LOOK:
            self._looked = time.monotonic()
            self._waiting.extend(self._elsewhere)
            self._elsewhere = []
        while free and self._waiting:
            job = self._waiting.popleft()
            if self._is_settled(job):
                self._tell()
            elif self.claims.is_busy(job.name) or not (claim := self.claims.claim(job.name)):
                self._elsewhere.append(job)
            elif is_finished(self.out / job.name):
                # By another, between the two looks.
                claim.drop()
                self._waiting.appendleft(job)
            else:
                self._begin(job, free.pop(0), claim, context)

    def _is_settled(self, job: Job) -> bool:
        """Whether nothing is left to do: it is done, or another batch has failed at it since this one began."""
        if (record := run_record(self.out / job.name)) is not None:
            self._is_done(job, record)
            return True
        before, now = self._tries.get(job.name, 0), self.claims.tries(job.name)
        outcome = self.claims.outcome(job.name, now) if now > before else None
        if outcome is None or outcome.state in ("stopped", "done"):
            return False
        if outcome.final or now - before > self.retries:
            self.failed.append(job.name)
            return True
        return False

    def _begin(self, job: Job, place: Place, claim: Claim, context: BaseContext) -> None:
        ours, theirs = context.Pipe()
        log = claim.path.with_suffix(".log")
        out = self.out / job.name
        work = Work(job.command, job.options, job.base, out, log, place.threads, place.gpu)
        process = context.Process(target=run_job, args=(work, theirs))  # type: ignore[attr-defined]
        process.start()
        theirs.close()
        now = time.monotonic()
        self._running.append(Running(job, place, claim, process, ours, now, now))
        # It begins when its claim says which process it is: should this one die, others know that it goes on.
        claim.began(process.pid)
        with suppress(OSError):
            ours.send_bytes(b"begin")

    # Jobs that run

    def _rest(self) -> None:
        """Waits for something to happen."""
        ends = [running.process.sentinel for running in self._running]
        if ends:
            soon = 0.1 if any(running.killed_at for running in self._running) else 1.0
            wait(ends, timeout=min(soon, LOOK) if self._elsewhere else soon)
        elif self._elsewhere and not self._waiting:
            time.sleep(LOOK / 4)

    def _keep(self) -> None:
        """Looks after what runs: heart-beats, time limits, ends."""
        now = time.monotonic()
        for running in list(self._running):
            if not running.process.is_alive():
                self._ended(running)
                continue
            if running.killed_at is not None and now > running.killed_at:
                kill(running.process)
            elif now - running.beaten > BEAT:
                running.beaten = now
                if running.claim.is_lost:
                    kill(running.process)
                running.claim.beat()
            if self.timeout and now - running.begun > self.timeout and running.killed_at is None:
                running.why = "timeout"
                running.interrupt()

    def _ended(self, running: Running) -> None:
        """Writes down how a try ended, and whether there is another one."""
        self._running.remove(running)
        outcome = self._outcome(running)
        kill(running.process)
        running.process.join()
        running.channel.close()
        name = running.job.name
        if running.claim.is_lost:
            self._elsewhere.append(running.job)
            return
        running.claim.end(outcome)
        again = running.claim.number - self._tries.get(name, 0) <= self.retries and not outcome.final
        if outcome.state == "done":
            self._is_done(running.job, run_record(self.out / name) or {})
        elif outcome.state == "stopped" or again:
            self.say(f"{name}: {outcome.state}{': ' if outcome.message else ''}{shortened(outcome.message)}; once more")
            self._waiting.append(running.job)
        else:
            self.failed.append(name)
            log = running.claim.path.with_suffix(".log")
            self.say(f"{name}: {outcome.state}: {shortened(outcome.message)} ({log})")
        self._tell()

    def _outcome(self, running: Running) -> Outcome:
        seconds = round(time.monotonic() - running.begun, 3)
        try:
            told = json.loads(running.channel.recv_bytes()) if running.channel.poll() else {}
        except (EOFError, OSError):
            told = {}
        if is_finished(self.out / running.job.name):
            return Outcome("done", seconds=seconds)
        if running.why == "timeout":
            return Outcome("timeout", f"more than {self.timeout:g} s", seconds=seconds)
        if not told:
            code = running.process.exitcode or 0
            how = f"signal {-code} ended its process" if code < 0 else f"its process ended with code {code}"
            return Outcome("killed", f"{how}; is there enough memory?" if code == -9 else how, seconds=seconds)
        if told["state"] == "done":
            return Outcome("failed", "it wrote no run.json", seconds=seconds)
        return Outcome(**told, seconds=seconds)

    def _stop_all(self) -> None:
        """Ends what runs, as Ctrl-C does, and writes down that it was stopped."""
        for running in self._running:
            running.interrupt()
        end = time.monotonic() + GRACE
        try:
            while any(r.process.is_alive() for r in self._running) and time.monotonic() < end:
                wait([r.process.sentinel for r in self._running if r.process.is_alive()], timeout=0.5)
        finally:
            # Also when Ctrl-C comes again.
            for running in self._running:
                outcome = self._outcome(running)
                kill(running.process)
                running.process.join()
                running.channel.close()
                state = "done" if outcome.state == "done" else "stopped"
                with suppress(OSError):
                    running.claim.end(Outcome(state, seconds=outcome.seconds))
            self._running = []


@contextmanager
def ended_as_by_ctrl_c() -> Iterator[None]:
    """Within this block SIGTERM, by which schedulers and shells end programs, does what Ctrl-C does."""
    if threading.current_thread() is not threading.main_thread() or os.name == "nt":
        yield
        return

    def stop(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
