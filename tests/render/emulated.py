"""The CUDA kernels on the CPU, as a device: compiled by the system's compiler, threads are fibers (emulation/)."""

import ctypes
import fcntl
import functools
import hashlib
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import torch

from diff3ds.render.areas.area_job import AreaJob
from diff3ds.render.cuda.job import Job
from diff3ds.render.cuda.sources import kernels, source_digest, source_folder

HERE = Path(__file__).parent
BUILT = HERE.parents[1] / "build" / "emulated"


@functools.cache
def compiler() -> str | None:
    """A C++ compiler, if there is one."""
    return next(
        (found for name in (os.environ.get("CXX", ""), "g++", "clang++") if name and (found := shutil.which(name))),
        None,
    )


JOBS: dict[str, type[ctypes.Structure]] = {"emulate": Job, "emulate_areas": AreaJob}


@functools.cache
def library(real: str, name: str = "emulate") -> ctypes.CDLL:
    """The kernels for pixels in "float" or "double": of strokes, or of layers ("emulate_areas").

    Compiled once for all processes and runs, for it takes some ten seconds: again when any source has changed.
    """
    command = [
        str(compiler()),
        "-std=c++20",
        "-O1",
        "-shared",
        "-fPIC",
        f"-DREAL={real}",
        "-DSTROKE_EMULATE",
        f"-I{source_folder()}",
        str(HERE / "emulation" / f"{name}.cpp"),
    ]
    target = BUILT / f"{name}-{real}-{_digest(command)}.so"
    BUILT.mkdir(parents=True, exist_ok=True)
    with (BUILT / f"{name}-{real}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not target.exists():
            for old in BUILT.glob(f"{name}-{real}-*"):
                old.unlink()
            unfinished = target.with_suffix(".new")
            subprocess.run([*command, "-o", str(unfinished)], check=True)
            unfinished.rename(target)
        loaded = ctypes.CDLL(str(target))
    loaded.job_size.restype = ctypes.c_size_t
    loaded.emulate.restype = ctypes.c_char_p
    assert loaded.job_size() == ctypes.sizeof(JOBS[name]), "job.py and job.cuh disagree"
    return loaded


def _digest(command: Sequence[str]) -> str:
    """Of all that a library is made of, and by what."""
    version = subprocess.run([command[0], "--version"], capture_output=True, check=True).stdout
    own = [path.read_bytes() for path in sorted((HERE / "emulation").iterdir())]
    return hashlib.sha256(repr((source_digest(), own, command, version)).encode()).hexdigest()[:32]


class Emulated:
    """Runs kernels at once. backwards: threads and blocks take their turns in the opposite order."""

    strides = 3

    def __init__(self, real: str, backwards: bool = False, name: str = "emulate"):
        self.library, self.backwards, self.waits, self.recording = library(real, name), backwards, 0, False

    def launch(self, launches: Sequence[tuple[str, int]], job: ctypes.Structure) -> None:
        for name, blocks in launches:
            error = self.library.emulate(
                self.library[name], blocks, kernels()[name].threads, ctypes.byref(job), self.backwards
            )
            assert not error, f"{name}: {error.decode()}"

    def wait(self) -> None:
        self.waits += 1

    def capturing(self) -> bool:
        return self.recording

    def report(self, length: int) -> torch.Tensor:
        return torch.zeros(length, dtype=torch.int64)
