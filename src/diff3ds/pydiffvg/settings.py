"""Where pictures are drawn, and whether times are told: for the whole process, as scripts for DiffVG expect it."""

import warnings

import torch

from diff3ds._checks import users_level

use_gpu = torch.cuda.is_available()
device = torch.device("cuda" if use_gpu else "cpu")
print_timing = False


def set_use_gpu(v: bool) -> None:
    """Draws on the CPU if false. If true, on the device that `set_device` said, or on a GPU that was there at first."""
    global use_gpu, device
    use_gpu = bool(v)
    if not use_gpu:
        device = torch.device("cpu")


def get_use_gpu() -> bool:
    """What `set_use_gpu` or `set_device` said last."""
    return use_gpu


def set_device(d: torch.device | str) -> None:
    """Draws on this device; on the CPU, with a warning, where it is a GPU that is not there."""
    global use_gpu, device
    wanted = torch.device(d)
    if wanted.type == "cuda" and (wanted.index or 0) >= torch.cuda.device_count():
        warnings.warn(f"there is no device {wanted}: the CPU draws", stacklevel=users_level())
        wanted = torch.device("cpu")
    device = wanted
    use_gpu = wanted.type == "cuda"


def get_device() -> torch.device:
    """The device that pictures come on."""
    return device


def set_print_timing(val: bool) -> None:
    """Whether each picture prints how long it took to draw, without its gradients."""
    global print_timing
    print_timing = bool(val)
