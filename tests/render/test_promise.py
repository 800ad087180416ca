"""Where DIFF3DS_GPU promises GPUs, no test of theirs is left out without a failure."""

import sys
from contextlib import contextmanager
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import emulated
import pytest
import torch

import diff3ds as ds

SKIPPED, FAILED = pytest.skip.Exception, pytest.fail.Exception


def load(name: str, folder: Path = Path(__file__).parent):
    """A module of tests, as pytest collects it."""
    spec = spec_from_file_location(f"again_{name}", folder / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@contextmanager
def ends(outcome: type[BaseException], message: str):
    """A skip where a failure is wanted would skip the test itself."""
    with pytest.raises((SKIPPED, FAILED), match=message) as raised:
        yield
    assert raised.type is outcome


@pytest.mark.parametrize(("promise", "outcome"), [("", SKIPPED), ("0", SKIPPED), ("1", FAILED), ("2", FAILED)])
@pytest.mark.parametrize(
    ("name", "missing"),
    [
        ("test_cuda_compile", "cuda.core"),
        ("test_cuda_compile", "cuda.bindings.nvrtc"),
        ("test_cuda_launch", "cuda.bindings.driver"),
    ],
)
def test_without_what_compiles(monkeypatch, promise, outcome, name, missing):
    monkeypatch.setenv("DIFF3DS_GPU", promise)
    monkeypatch.setitem(sys.modules, missing, None)
    with ends(outcome, rf"{missing} is not installed"):
        load(name)


@pytest.mark.parametrize(("promise", "outcome"), [("", SKIPPED), ("1", FAILED)])
def test_doctor_without_what_compiles(monkeypatch, promise, outcome):
    monkeypatch.setenv("DIFF3DS_GPU", promise)
    monkeypatch.setitem(sys.modules, "cuda.bindings.nvrtc", None)
    module = load("test_doctor", Path(__file__).parents[1] / "tasks")
    with ends(outcome, r"cuda.bindings.nvrtc is not installed"):
        module.test_the_compiler_for_gpus_fits_torch(monkeypatch)


@pytest.mark.parametrize(("promise", "outcome"), [("", SKIPPED), ("1", FAILED)])
def test_without_a_compiler_for_the_emulation(monkeypatch, promise, outcome):
    monkeypatch.setenv("DIFF3DS_GPU", promise)
    monkeypatch.setattr(emulated, "compiler", lambda: None)
    with ends(outcome, "no C\\+\\+ compiler"):
        load("test_cuda")


@pytest.mark.parametrize(("promise", "outcome"), [("1", SKIPPED), ("2", FAILED)])
def test_with_one_gpu(monkeypatch, promise, outcome):
    """It is all that one promises; not what two do."""
    monkeypatch.setenv("DIFF3DS_GPU", promise)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    module = load("test_gpu")
    with ends(outcome, "there are no two GPUs"):
        module.test_several_devices(torch.device("cuda"))


def test_without_the_gpu_itself(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr(ds, "available_backends", lambda: ["reference", "cpu"])
    monkeypatch.setenv("DIFF3DS_GPU", "")
    with pytest.raises(SKIPPED, match="none promised"):
        load("test_gpu")
    monkeypatch.setenv("DIFF3DS_GPU", "1")
    with pytest.raises(AssertionError, match="a GPU is here or promised"):
        load("test_gpu").gpu.__wrapped__()
