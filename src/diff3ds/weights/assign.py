"""Weights put into small networks: each one that a network has, and no other."""

from collections.abc import Mapping

import torch

from diff3ds._shapes import Tensor

# Key names in an error message; more say nothing more.
NAMED = 3


def load_weights(network: torch.nn.Module, tensors: Mapping[str, Tensor], source: str, prefix: str = "") -> None:
    """Puts tensors into a network, which then takes no gradients for them, and evaluates only.

    Args:
        tensors: by the network's own names, after the prefix. Those without it belong to other networks.
        source: where they come from, for messages.

    Raises:
        ValueError: tensors that are missing, too many, or of another shape; it names them.
    """
    wanted = {name: value for name, value in network.state_dict().items() if not name.endswith("num_batches_tracked")}
    given = {
        name.removeprefix(prefix): value
        for name, value in tensors.items()
        if name.startswith(prefix) and not name.endswith("num_batches_tracked")
    }
    for names, fault in ((wanted.keys() - given.keys(), "lacks"), (given.keys() - wanted.keys(), "has the unknown")):
        if names:
            raise ValueError(f"{source}: not the weights of this network: it {fault} {_some(prefix, names)}")
    for name, value in wanted.items():
        if given[name].shape != value.shape:
            raise ValueError(
                f"{source}: {prefix}{name} must have the shape {tuple(value.shape)}, got {tuple(given[name].shape)}"
            )
    # BatchNorm counts batches in training only, so that its counter may be missing.
    network.load_state_dict({name: value.float() for name, value in given.items()}, strict=False)
    network.eval().requires_grad_(False)


def _some(prefix: str, names: set[str]) -> str:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(prefix + name for name in sorted(names)[:NAMED]) + more
