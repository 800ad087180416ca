"""From the sources of the kernels to code for one kind of GPU, by NVRTC, kept on disk: no compiler is needed."""

import hashlib
import os
import threading
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from diff3ds._files import write_bytes
from diff3ds.render.cuda.sources import PARTS, source_digest, source_folder
from diff3ds.render.cuda.versions import compiler_versions

# Strokes and contours are walked through twice, to count and to write, and both must come to the same to the bit: a
# product is rounded before it is added to, wherever the compiler meets it.
WALKS = ("pieces", "chords", "areas")
# What carries no mark is for the device: NVRTC of CUDA 13.0 takes generic lambdas for the host's else.
OPTIONS = {
    part: {"std": "c++20", "fma": part not in WALKS, "device_as_default_execution_space": True} for part in PARTS
}

# Bytes of a digest.
DIGEST = 32
_IMPORTING = threading.Lock()


class Codes:
    """The parts for one precision and architecture, compiled by threads before they are needed."""

    def __init__(self, real: str, arch: str) -> None:
        self._kind = (real, arch)
        self._codes: dict[str, Future[bytes]] = {}

    def begin(self, parts: Sequence[str]) -> None:
        """Those that have not begun begin now, all at once: the first one's kernels do not wait for the last one."""
        new = [part for part in parts if part not in self._codes]
        if new:
            # Once, not by each of the threads.
            source_digest()
            pool = ThreadPoolExecutor(len(new), thread_name_prefix="diff3ds-compile")
            self._codes |= {part: pool.submit(compiled, part, *self._kind) for part in new}
            pool.shutdown(wait=False)

    def of(self, part: str) -> bytes:
        """The cubin of a part, once it is compiled."""
        self.begin([part])
        return self._codes[part].result()


def cache_folder() -> Path:
    """Where compiled kernels are kept: `diff3ds/kernels` in XDG_CACHE_HOME, or in ~/.cache.

    Raises:
        RuntimeError: this user has no home.
    """
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "diff3ds" / "kernels"


def compiled(part: str, real: str, arch: str) -> bytes:
    """The cubin of a part for pixels in "float" or "double" on an architecture like "sm_90", from disk if it is there.

    Safe for several processes at once: files are written whole under another name and then renamed. Where nothing can
    be written, every process compiles for itself. A file begins with its digest: what a disk has damaged is made anew.
    """
    key = hashlib.sha256(repr((source_digest(), compiler_versions(), OPTIONS[part])).encode()).hexdigest()[:32]
    name = f"{part}-{real}-{arch}-{key}.cubin"
    with suppress(OSError, RuntimeError):
        held = (cache_folder() / name).read_bytes()
        digest, code = held[:DIGEST], held[DIGEST:]
        if hashlib.sha256(code).digest() == digest:
            return code
    code = compile_part(part, real, arch)
    with suppress(OSError, RuntimeError):
        write_bytes(cache_folder() / name, hashlib.sha256(code).digest() + code)
    return code


def compile_part(part: str, real: str, arch: str) -> bytes:
    """The cubin of a part, compiled now."""
    # cuda-core 1.2.0, imported by several threads at once, is found half made.
    with _IMPORTING:
        from cuda.core import Program, ProgramOptions

    options = ProgramOptions(
        name=f"{part}.cu", arch=arch, define_macro=[("REAL", real)], include_path=str(source_folder()), **OPTIONS[part]
    )
    source = (source_folder() / "cuda" / f"{part}.cu").read_text(encoding="utf-8")
    return bytes(Program(source, "c++", options).compile("cubin").code)
