"""Which segments make which stroke: a stroke is a chain of rational curves, open or closed, that is drawn as one."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import torch

from diff3ds._modes import can_look_at
from diff3ds._shapes import Bool, Float, Int, Tensor
from diff3ds._with_torch import known_to_torch


@known_to_torch
@dataclass(frozen=True, eq=False)
class Chains:
    """How M segments make N strokes.

    The segments of a stroke follow on each other: each begins where the one before it ends, and in a closed stroke the
    first begins where the last one ends. These places are the stroke's joints.

    Attributes:
        stroke: the stroke of each segment: 0 for the first ones, then 1, and so on without a gap.
        closed: whether a stroke has a joint in place of its two ends.

    Raises:
        TypeError, ValueError: other dtypes, or strokes without segments or out of order.
    """

    stroke: Int[Tensor, " M"]
    closed: Bool[Tensor, " N"]

    def __post_init__(self) -> None:
        for name, dtype in (("stroke", torch.int64), ("closed", torch.bool)):
            value = getattr(self, name)
            if not isinstance(value, Tensor) or value.dtype != dtype or value.ndim != 1:
                got = f"{value.dtype} of {tuple(value.shape)}" if isinstance(value, Tensor) else type(value).__name__
                raise TypeError(f"{name} of Chains must be a tensor of {dtype} with one axis, got {got}")
        if self.stroke.device != self.closed.device:
            raise ValueError(
                f"stroke and closed must be on one device, got {self.stroke.device} and {self.closed.device}"
            )
        if can_look_at(self.stroke):
            expected = torch.arange(len(self.closed))
            if not torch.equal(torch.unique_consecutive(self.stroke), expected):
                raise ValueError(
                    f"stroke of Chains must run from 0 to {len(self.closed) - 1} without gaps, in order, for "
                    f"{len(self.closed)} strokes, got {self.stroke.tolist()[:20]}"
                )

    @staticmethod
    def of(segments: Sequence[int], closed: bool | Sequence[bool] = False) -> "Chains":
        """Strokes of so many segments each.

        Args:
            segments: how many each stroke has, at least one.
            closed: of all strokes, or one a stroke.

        Raises:
            TypeError: numbers of segments that are no whole numbers, or `closed` that is not true or false.
            ValueError: a stroke without segments, or another number of values than strokes.
        """
        counts = segments.tolist() if isinstance(segments, Tensor) else list(segments)
        for stroke, count in enumerate(counts):
            if not isinstance(count, int) or isinstance(count, bool):
                raise TypeError(f"stroke {stroke} must have a whole number of segments, got {count!r}")
            if count < 1:
                raise ValueError(f"stroke {stroke} must have at least one segment, got {count}")
        given = closed.tolist() if isinstance(closed, Tensor) else closed
        flags = [given] * len(counts) if isinstance(given, bool) else list(given)
        if not all(isinstance(flag, bool) for flag in flags):
            raise TypeError(f"closed must be true or false, or one such value a stroke, got {closed!r}")
        if len(flags) != len(counts):
            raise ValueError(f"closed must have one value a stroke, {len(counts)}, got {len(flags)}")
        rows = torch.repeat_interleave(torch.arange(len(counts)), torch.tensor(counts, dtype=torch.int64))
        return Chains(rows, torch.tensor(flags, dtype=torch.bool))

    def __len__(self) -> int:
        return len(self.closed)

    def is_plain(self) -> bool:
        """Whether every stroke is one open segment: then no chains need to be kept."""
        return len(self.stroke) == len(self.closed) and not bool(self.closed.any())

    @cached_property
    def counts(self) -> Int[Tensor, " N"]:
        """Segments of each stroke."""
        return torch.bincount(self.stroke, minlength=len(self.closed))

    @cached_property
    def first(self) -> Int[Tensor, " F"]:
        """The first segment of each stroke, and the number of all: N + 1 numbers."""
        return torch.cat([self.counts.new_zeros(1), self.counts.cumsum(0)])

    @cached_property
    def joints(self) -> tuple[Int[Tensor, " J"], Int[Tensor, " J"]]:
        """Pairs of segments, the first of which ends where the second begins: within strokes, then where they close."""
        after = (self.stroke[1:] == self.stroke[:-1]).nonzero()[:, 0] + 1
        first, last = self.first[:-1][self.closed], self.first[1:][self.closed] - 1
        return torch.cat([after - 1, last]), torch.cat([after, first])

    @cached_property
    def before(self) -> Int[Tensor, " M"]:
        """The segment that each begins at the end of; -1 at the start of an open stroke."""
        ends, starts = self.joints
        return torch.full_like(self.stroke, -1).index_copy(0, starts, ends)

    @cached_property
    def after(self) -> Int[Tensor, " M"]:
        """The segment that begins at the end of each; -1 at the end of an open stroke."""
        ends, starts = self.joints
        return torch.full_like(self.stroke, -1).index_copy(0, ends, starts)

    def joined(self, values: Float[Tensor, "M K *D"]) -> Float[Tensor, "M K *D"]:
        """Values a control point, such as points and widths, that agree at the joints; gradients add up there.

        A segment's first value becomes the last one of the segment before it; where a stroke closes, its last value
        becomes its first.
        """
        inner = (self.stroke[1:] == self.stroke[:-1]).nonzero()[:, 0]
        first, last = self.first[:-1][self.closed], self.first[1:][self.closed] - 1
        start = values[:, 0].index_copy(0, inner + 1, values[inner, -1])
        stop = values[:, -1].index_copy(0, last, start[first])
        return torch.cat([start[:, None], values[:, 1:-1], stop[:, None]], 1)

    def select(self, strokes: Int[Tensor, " S"]) -> tuple[Int[Tensor, " L"], "Chains"]:
        """Some of the strokes, in this order: their segments, and how these make them."""
        counts = self.counts[strokes]
        stroke = torch.repeat_interleave(torch.arange(len(strokes), device=counts.device), counts)
        within = torch.arange(len(stroke), device=counts.device) - (counts.cumsum(0) - counts)[stroke]
        return self.first[strokes][stroke] + within, Chains(stroke, self.closed[strokes])

    def to(self, device: torch.device | str) -> "Chains":
        """The same chains on another device."""
        return Chains(self.stroke.to(device), self.closed.to(device))

    @staticmethod
    def plain(count: int, device: torch.device | str = "cpu") -> "Chains":
        """Open strokes of one segment each."""
        return Chains(torch.arange(count, device=device), torch.zeros(count, dtype=torch.bool, device=device))

    @staticmethod
    def concatenate(parts: "Sequence[Chains]") -> "Chains":
        """The strokes of all parts, one after the other."""
        before = [sum(len(part) for part in parts[:k]) for k in range(len(parts))]
        stroke = torch.cat([part.stroke + count for part, count in zip(parts, before, strict=True)])
        return Chains(stroke, torch.cat([part.closed for part in parts]))
