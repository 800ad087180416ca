"""Which device and number format a prior computes with, and whether it has the memory."""

import torch

from diff3ds.guidance.recipe import Precision


def pick_device(name: str = "auto") -> torch.device:
    """A device by name: cpu, cuda, cuda:1, mps, or auto, which is the first that there is of cuda, mps and cpu.

    Raises:
        ValueError: no such device here.
    """
    there = {"cuda": torch.cuda.is_available(), "mps": torch.backends.mps.is_available(), "cpu": True}
    if name == "auto":
        return torch.device(next(kind for kind, present in there.items() if present))
    kind, _, index = name.partition(":")
    if not there.get(kind) or (
        index and not (index.isdecimal() and kind == "cuda" and int(index) < torch.cuda.device_count())
    ):
        raise ValueError(f"no device {name!r} here; there is {', '.join(k for k, present in there.items() if present)}")
    return torch.device(name)


def pick_dtype(precision: Precision, device: torch.device, upcast: bool = False) -> torch.dtype:
    """Chooses what a UNet computes in. auto: float32 on a CPU, else float16, or bfloat16 if float16 may overflow.

    Args:
        upcast: the configuration asks for attention in float32 (`upcast_attention`, Stable Diffusion 2.1 at 768
            pixels), which torch's attention does not heed; bfloat16 has the range of float32.
    """
    if precision == "auto":
        return torch.float32 if device.type == "cpu" else torch.bfloat16 if upcast else torch.float16
    return {"float16": torch.float16, "bfloat16": torch.bfloat16, "float32": torch.float32}[precision]


def free_memory(device: torch.device) -> int | None:
    """Free bytes of a GPU; None for a CPU, whose system may swap."""
    if device.type == "cuda":
        return int(torch.cuda.mem_get_info(device)[0])
    if device.type == "mps":
        return int(torch.mps.recommended_max_memory() - torch.mps.driver_allocated_memory())
    return None


def require_memory(device: torch.device, needed: int, what: str) -> None:
    """Raises ValueError if a GPU has less free memory than so many bytes."""
    free = free_memory(device)
    if free is not None and free < needed:
        raise ValueError(
            f"{what} needs about {needed / 1e9:.1f} GB of memory, {device} has {free / 1e9:.1f} GB free. "
            "Close what else uses it, choose --precision float16, a smaller --batch, a prior with smaller images, or "
            "--device cpu"
        )
