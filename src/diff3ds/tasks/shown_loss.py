"""The loss of a running fit for people to see."""

import math
import time

from diff3ds.optimize.fit import Step


class ShownLoss:
    """The loss of a step for people to see. A look at one on a GPU waits for the device: there is one a second."""

    def __init__(self) -> None:
        self._value, self._due = math.nan, -math.inf

    def of(self, step: Step) -> float:
        """The loss of this step, or of one not long before."""
        if step.loss_tensor.device.type == "cpu" or time.monotonic() >= self._due:
            self._value, self._due = step.loss, time.monotonic() + 1
        return self._value
