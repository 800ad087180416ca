"""The CUDA kernels on the CPU, as a device: compiled by the system's compiler, threads are fibers (emulation/)."""

import ctypes
import functools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import torch

from diff3ds.render.areas.area_job import AreaJob
from diff3ds.render.cuda.job import Job
from diff3ds.render.cuda.sources import kernels, source_folder

HERE = Path(__file__).parent


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
    """The kernels for pixels in "float" or "double": of strokes, or of layers ("emulate_areas")."""
    folder = Path(tempfile.mkdtemp(prefix="diff3ds-emulated-"))
    target, source = folder / f"{real}.so", HERE / "emulation" / f"{name}.cpp"
    command = [
        compiler(),
        "-std=c++20",
        "-O1",
        "-shared",
        "-fPIC",
        f"-DREAL={real}",
        "-DSTROKE_EMULATE",
        f"-I{source_folder()}",
    ]
    subprocess.run([*command, str(source), "-o", str(target)], check=True)
    loaded = ctypes.CDLL(str(target))
    shutil.rmtree(folder)
    loaded.job_size.restype = ctypes.c_size_t
    loaded.emulate.restype = ctypes.c_char_p
    assert loaded.job_size() == ctypes.sizeof(JOBS[name]), "job.py and job.cuh disagree"
    return loaded


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
