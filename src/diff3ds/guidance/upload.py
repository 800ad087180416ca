"""Numbers that are drawn or worked out on the CPU, on their way to a device that must not be waited for."""

import torch

from diff3ds._shapes import Tensor

# Kinds of devices that work through a queue, for whose end a copy from ordinary memory waits.
QUEUED = ("cuda",)


def uploaded(constant: Tensor, device: torch.device) -> Tensor:
    """A tensor without gradients on a device; one of the CPU gets there without a wait for what runs on the device.

    It is copied from pinned memory, which torch keeps until the copy is done and then uses again.
    """
    if device.type not in QUEUED or constant.device.type != "cpu":
        return constant.to(device)
    return constant.detach().contiguous().pin_memory().to(device, non_blocking=True)
