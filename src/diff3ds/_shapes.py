"""Shape annotations (`Float[Tensor, "N K 3"]`): checked by jaxtyping in the tests, plain `Tensor` at run time."""

import sys
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

# Tests load jaxtyping as a pytest plugin before they import this package; users need not have it installed.
if TYPE_CHECKING:
    from jaxtyping import Bool, Float, Int, UInt8
elif "jaxtyping" in sys.modules:
    import jaxtyping

    class _Checked:
        """A dtype of jaxtyping that takes aliases as well, such as numpy 2.5's `NDArray` is from Python 3.12 on."""

        def __init__(self, dtype: Any) -> None:
            self.dtype = dtype

        def __getitem__(self, item: tuple[Any, str]) -> Any:
            array, shape = item
            return self.dtype[getattr(array, "__value__", array), shape]

    Bool, Float, Int, UInt8 = (_Checked(getattr(jaxtyping, name)) for name in ("Bool", "Float", "Int", "UInt8"))
else:

    class _Unchecked:
        """Stands in for a jaxtyping dtype: `Float[Tensor, "N 3"]` is then just `Tensor`."""

        def __class_getitem__(cls, item: tuple[Any, str]) -> Any:
            return item[0]

    Bool = Float = Int = UInt8 = _Unchecked

# Coordinates, lengths and weights outside of what torch differentiates.
Array = NDArray[np.float64]
# Numbers of vertices, faces and the like, and masks.
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

__all__ = ["Array", "Bool", "Float", "Index", "Int", "Mask", "Tensor", "UInt8"]
