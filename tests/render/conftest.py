"""Fixtures of the renderer's tests: every backend of this machine, and both kinds of antialiasing."""

from importlib import import_module

import pytest
from cuda_backends import on_device, use_device, use_emulation
from emulated import Emulated

from diff3ds.render import available_backends, set_num_threads

# The CUDA kernels are emulated everywhere, and run on the device where there is one, or one is promised.
CUDA = ["cuda", *on_device("cuda on the device")]
KERNELS = [*(name for name in available_backends() if name == "cpu"), *CUDA]


# The reference draws slowly: of these tests the cases that are quick with it. The kernels' are all quick.
QUICK_OF_REFERENCE = {
    "test_a_batch_is_a_loop_to_the_last_bit": ("kinds",),
    "test_nothing_outlives_a_transform": ("grad", "hessian", "jvp", "record"),
    "test_outline_of_a_straight_stroke": (),
}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items) -> None:
    """The reference takes seconds to sample; with the kernels' samples its own are compared in any run."""
    for item in items:
        if "render" not in item.path.parts or not hasattr(item, "callspec"):
            continue
        given = item.callspec.params
        sampled = given.get("antialiasing") == "montecarlo" or "sample" in item.originalname
        quick = QUICK_OF_REFERENCE.get(item.originalname)
        left_out = quick is not None and not any(value in quick for value in given.values())
        if given.get("backend") == "reference" and (sampled or left_out):
            item.add_marker("slow")


@pytest.fixture(params=["reference", *KERNELS])
def backend(request, monkeypatch) -> str:
    """A backend that draws tensors on the CPU, or as if they were there."""
    return _ready(request.param, monkeypatch)


@pytest.fixture(params=KERNELS)
def kernels(request, monkeypatch) -> str:
    """The same without the reference."""
    return _ready(request.param, monkeypatch)


@pytest.fixture(params=CUDA)
def cuda(request, monkeypatch) -> str:
    """The CUDA kernels alone."""
    return _ready(request.param, monkeypatch)


def _ready(name: str, monkeypatch) -> str:
    if name == "cuda":
        use_emulation(monkeypatch)
    elif name == "cuda on the device":
        use_device(monkeypatch)
        return "cuda"
    return name


@pytest.fixture(params=["analytic", "montecarlo"])
def antialiasing(request) -> str:
    return request.param


@pytest.fixture
def threads():
    """Sets the number of threads of the kernels; afterwards it follows torch's again."""
    yield set_num_threads
    set_num_threads(None)


@pytest.fixture
def memories(monkeypatch) -> dict:
    """What is remembered of earlier drawings, empty."""
    monkeypatch.setattr(import_module("diff3ds.render.cuda.rasterize"), "_limits", {})
    return import_module("diff3ds.render.cuda.rasterize")._limits


@pytest.fixture
def device(monkeypatch, memories) -> Emulated:
    """A device without a past."""
    one = Emulated("float")
    use_emulation(monkeypatch, lambda *_: one)
    return one
