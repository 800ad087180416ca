"""Shape annotations (`Float[Tensor, "N K 3"]`): checked by jaxtyping in the tests, plain `Tensor` at run time."""

import sys
from typing import TYPE_CHECKING, Any

from torch import Tensor

# Tests load jaxtyping as a pytest plugin before they import this package; users need not have it installed.
if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Bool, Float, Int, UInt8
else:

    class _Unchecked:
        """Stands in for a jaxtyping dtype: `Float[Tensor, "N 3"]` is then just `Tensor`."""

        def __class_getitem__(cls, item: tuple[Any, str]) -> Any:
            return item[0]

    Bool = Float = Int = UInt8 = _Unchecked

__all__ = ["Bool", "Float", "Int", "Tensor", "UInt8"]
