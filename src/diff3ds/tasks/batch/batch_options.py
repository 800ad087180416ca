"""Options of `diff3ds batch`."""

import re
from dataclasses import dataclass
from typing import Literal

from diff3ds._settings import require_finite


@dataclass(frozen=True)
class BatchOptions:
    """Options of `diff3ds batch`.

    Attributes:
        workers: jobs at a time; by default one a GPU, or one a core where there is none.
        threads: of each job; by default the cores shared among the workers.
        gpus: which GPUs are dealt out, one a job: auto (all there are), none, or their numbers: 0,1.
        retries: how often a job that was killed, ran out of time or failed otherwise is tried again. What is wrong with
            its input is not.
        timeout: seconds that one try may take; then it is stopped as by Ctrl-C, and the next one goes on from there.
        shard: do this part of the jobs only: 3/16 is the third of sixteen.
        runner: process (processes of this machine), or ray (of a Ray cluster whose machines share the disk; extra ray).
        address: of the Ray cluster; by default one is started on this machine.
    """

    workers: int | None = None
    threads: int | None = None
    gpus: str = "auto"
    retries: int = 1
    timeout: float | None = None
    shard: str | None = None
    runner: Literal["process", "ray"] = "process"
    address: str | None = None

    def __post_init__(self) -> None:
        require_finite(self)
        for name in ("workers", "threads", "timeout"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ValueError(f"{name} must be positive, got {value}")
        if self.retries < 0:
            raise ValueError(f"retries must not be negative, got {self.retries}")
        if not re.fullmatch(r"auto|none|\d+(,\d+)*", self.gpus):
            raise ValueError(f"gpus must be auto, none, or numbers such as 0,1, got {self.gpus!r}")
        self.part()
        if self.address is not None and self.runner != "ray":
            raise ValueError("address is that of a Ray cluster: add --runner ray, or leave it out")

    def part(self) -> tuple[int, int]:
        """Which of how many parts of the jobs is done, counted from 0."""
        found = re.fullmatch(r"(\d+)/(\d+)", self.shard or "1/1")
        number, count = (int(part) for part in found.groups()) if found else (0, 0)
        if not 1 <= number <= count:
            raise ValueError(f"shard must be one part of all, such as 3/16, got {self.shard!r}")
        return number - 1, count
