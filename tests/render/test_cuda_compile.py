"""The CUDA kernels compile for all architectures, by NVRTC and without a GPU, and compiled code is kept safely."""

import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
import torch
from gpu_promise import need

from diff3ds.render.cuda import compile as compiling
from diff3ds.render.cuda import versions
from diff3ds.render.cuda.sources import PARTS, kernels

need("cuda.bindings.nvrtc", "cuda.core")


def check_compiles(part, arch):
    code = compiling.compile_part(part, "float", arch)
    assert code.startswith(b"\x7fELF")
    here = {name for name, kernel in kernels().items() if kernel.part == part}
    assert here
    for name in kernels():
        assert (b"\0.text." + name.encode() + b"\0" in code) == (name in here), name


@pytest.fixture
def little_optimised(monkeypatch):
    """In a quarter of the time."""
    for part, options in compiling.OPTIONS.items():
        monkeypatch.setitem(compiling.OPTIONS, part, {**options, "ofast_compile": "max"})


# A second and more each; a compiler of C++ reads all of them in the tests that emulate them.
LARGE = ("areas", "differentiate", "samples")
QUICK_AND_SLOW = [pytest.param(part, marks=[pytest.mark.slow] * (part in LARGE)) for part in PARTS]


@pytest.mark.usefixtures("little_optimised")
@pytest.mark.parametrize("part", QUICK_AND_SLOW)
def test_every_part_compiles(part):
    check_compiles(part, "sm_90")


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_every_part_compiles_as_users_have_it(part):
    check_compiles(part, "sm_90")


@pytest.mark.slow
@pytest.mark.usefixtures("little_optimised")
@pytest.mark.parametrize("arch", ["sm_75", "sm_80", "sm_100"])
@pytest.mark.parametrize("part", PARTS)
def test_every_part_compiles_for_other_architectures(part, arch):
    check_compiles(part, arch)


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_double_precision_compiles(part):
    assert compiling.compile_part(part, "double", "sm_90").startswith(b"\x7fELF")


@pytest.fixture
def compiler(monkeypatch, tmp_path):
    """A compiler that counts its calls; the cache is empty."""
    calls = []

    def compile_part(part: str, real: str, arch: str) -> bytes:
        calls.append((part, real, arch))
        return f"{part} {real} {arch}".encode() * 1000

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(compiling, "compile_part", compile_part)
    return calls


def test_code_is_compiled_once(compiler):
    first = compiling.compiled("draw", "float", "sm_90")
    assert compiling.compiled("draw", "float", "sm_90") == first
    assert compiler == [("draw", "float", "sm_90")]


def test_code_is_kept_by_what_it_hangs_on(compiler, monkeypatch):
    """Part, precision and architecture; the sources; the options and the versions of what compiles."""
    for case in (("draw", "float", "sm_90"), ("pieces", "float", "sm_90"), ("draw", "double", "sm_90")):
        compiling.compiled(*case)
    compiling.compiled("draw", "float", "sm_100")
    assert len(compiler) == 4
    with monkeypatch.context() as patch:
        patch.setattr(compiling, "source_digest", lambda: "other sources")
        compiling.compiled("draw", "float", "sm_90")
    assert len(compiler) == 5
    with monkeypatch.context() as patch:
        patch.setitem(compiling.OPTIONS, "draw", {"std": "c++20", "fma": False})
        compiling.compiled("draw", "float", "sm_90")
    assert len(compiler) == 6
    with monkeypatch.context() as patch:
        patch.setattr(torch, "__version__", "99")
        compiling.compiled("draw", "float", "sm_90")
    assert len(compiler) == 7
    version = versions.metadata.version
    for count, package in enumerate(("cuda-core", "cuda-bindings", *versions.NVRTC), 8):
        with monkeypatch.context() as patch:
            other = {package: "99"}
            patch.setattr(versions.metadata, "version", lambda name, other=other: other.get(name) or version(name))
            compiling.compiled("draw", "float", "sm_90")
        assert len(compiler) == count, package


def test_several_at_once(compiler, tmp_path):
    """All get whole code, and nothing but it is left on disk."""
    workers = 8
    start = threading.Barrier(workers)

    def work(_) -> bytes:
        start.wait()
        return compiling.compiled("draw", "float", "sm_90")

    with ThreadPoolExecutor(workers) as pool:
        codes = set(pool.map(work, range(workers)))
    assert codes == {b"draw float sm_90" * 1000}
    assert [p.suffix for p in compiling.cache_folder().iterdir()] == [".cubin"]


def test_damaged_code_is_compiled_again(compiler):
    code = compiling.compiled("draw", "float", "sm_90")
    (path,) = compiling.cache_folder().iterdir()
    held = path.read_bytes()
    for damaged in (held[:-1], held[:10], b"", held[:-1] + b"?", code):
        path.write_bytes(damaged)
        assert compiling.compiled("draw", "float", "sm_90") == code
        assert path.read_bytes() == held
    assert len(compiler) == 6


def test_without_a_home(compiler, monkeypatch):
    """Where a user has none, pathlib raises."""

    def home() -> None:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(compiling.Path, "home", home)
    assert compiling.compiled("draw", "float", "sm_90") == b"draw float sm_90" * 1000


def test_a_cache_that_cannot_be_written(compiler, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert compiling.compiled("draw", "float", "sm_90") == b"draw float sm_90" * 1000
