"""Tensors written to a file, whole or not at all."""

import errno
import re
from collections.abc import Mapping
from pathlib import Path

from diff3ds._files import replacing
from diff3ds._shapes import Tensor


def write_tensors(path: Path, tensors: Mapping[str, Tensor], about: Mapping[str, str]) -> None:
    """Writes tensors from any device and what is said about them as safetensors, whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    from safetensors import SafetensorError
    from safetensors.torch import save_file

    # Copies: tensors that share memory are refused by the format.
    held = {name: value.detach().cpu().clone().contiguous() for name, value in tensors.items()}
    with replacing(path) as temporary:
        try:
            save_file(held, temporary, dict(about))
        except SafetensorError as error:
            # Which is no OSError, whatever the system said.
            number = re.search(r"os error (\d+)", str(error))
            raise OSError(int(number[1]) if number else errno.EIO, str(error), str(path)) from error
