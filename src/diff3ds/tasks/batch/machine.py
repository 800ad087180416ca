"""What a machine has for jobs: cores and GPUs, and how they are dealt out."""

import os
import subprocess
from contextlib import suppress
from dataclasses import dataclass


@dataclass(frozen=True)
class Place:
    """Where one job at a time is done.

    Attributes:
        number: of the place.
        threads: of its jobs.
        gpu: the one that its jobs see; "": they see none; None: nobody knows of any.
    """

    number: int
    threads: int
    gpu: str | None


def places(workers: int | None, threads: int | None, gpus: str) -> list[Place]:
    """Deals out the cores and GPUs of this machine.

    Args:
        workers: how many jobs at a time; None for as many as the cores or GPUs allow.
        threads: of each job; None to share the cores out.
        gpus: "auto", "none", or numbers joined by commas.

    Raises:
        ValueError: more workers than GPUs.
    """
    found = gpus_here() if gpus == "auto" else [] if gpus == "none" else gpus.split(",")
    count = workers or len(found) or (cores() if threads is None else max(1, cores() // threads))
    if found and count > len(found):
        raise ValueError(
            f"{count} workers for {len(found)} GPUs, of which each job has its own: give --workers {len(found)}, or "
            "--gpus none"
        )
    each = threads or max(1, cores() // count)
    none = "" if gpus == "none" else None
    return [Place(number, each, found[number] if found else none) for number in range(count)]


def cores() -> int:
    """The processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def gpus_here() -> list[str]:
    """NVIDIA's GPUs that this process may use, as CUDA_VISIBLE_DEVICES names them."""
    visible = os.environ.get("CUDA_VISIBLE_DEVICES")
    if visible is not None:
        return [name.strip() for name in visible.split(",") if name.strip() not in ("", "-1", "NoDevFiles")]
    with suppress(OSError, subprocess.SubprocessError):
        # Without torch, which takes seconds to load.
        asked = ["nvidia-smi", "--query-gpu=index", "--format=csv,noheader"]
        told = subprocess.run(asked, capture_output=True, text=True, timeout=20, check=True)
        return told.stdout.split()
    return []
