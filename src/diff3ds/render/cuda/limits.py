"""How long the lists of a drawing may become: remembered from one call to the next, so that no call has to wait.

The kernels count what they need and tell the host through memory that both see. A call whose bounds are not proven
waits for that, and is done again with more where it was too little. Once twice the need fits, calls no longer wait;
what is told is read at the next one. A drawing that outgrows proven bounds in one step is spoilt: its images are NaN,
its gradients zero. Large drawings always wait, and then need little room to spare.
"""

import warnings
from dataclasses import dataclass, field

from diff3ds._checks import users_level
from diff3ds._shapes import Int, Tensor
from diff3ds.render.cuda.job import BAD, LISTS, Shape

# Numbers of fragments and others fill 32 bits.
MOST = 2**32 - 256
# Room for so many times the need. Less than half of it used is proven; more costs memory only.
MARGIN = 3
# From this length on a list has little room to spare, and calls wait: what takes milliseconds does not notice. A
# hundred million fragments are 2 GB. Empirical.
LARGE, LARGE_MARGIN = 1 << 24, 1.25
# The first guess, by stroke and view, and per pixel (empirical); it only decides how often a first call is done again.
PIECES, CHORDS, INTERSECTIONS, FRAGMENTS = 2, 32, 96, 2
# No list is shorter (20 to 60 MB in all): a small drawing may then change as it likes and never outgrows its memory.
LEAST = dict(zip(LISTS, (1 << 12, 1 << 16, 1 << 18, 1 << 15, 1 << 19, 1 << 16, 1 << 17), strict=True))


@dataclass(eq=False)
class Limits:
    """Bounds of the lists for drawings of one kind.

    Attributes:
        report: greatest needs so far, written by the device.
        length: bounds of each list.
        proven: of each pass ("forward", "backward"), the number of strokes up to which calls need not wait.
        looked_at: what was told when a call last looked at it; until there is more, there is nothing to do.
    """

    report: Int[Tensor, " C"]
    length: dict[str, int] = field(default_factory=dict)
    proven: dict[str, int] = field(default_factory=dict)
    looked_at: list[int] = field(default_factory=list)

    def guess(self, shape: Shape) -> None:
        """Raises the bounds to what a drawing like this may need."""
        seen, pixels = shape.seen, shape.views * shape.height * shape.width
        lists, fragments = (PIECES, CHORDS, INTERSECTIONS, INTERSECTIONS), FRAGMENTS * pixels * shape.samples
        first = (*(most * seen for most in lists), fragments)
        # px of outline; of many strokes, each is short.
        outline = min(1024 * seen, pixels) * shape.strata
        outlines = (outline, 2 * outline)
        for name, need in zip(LISTS, (*first, *outlines), strict=True):
            # What a piece over a tile takes grows with the samples.
            least = LEAST[name] // shape.samples if name == "tile_pieces" else LEAST[name]
            self.length[name] = min(MOST, max(self.length.get(name, 0), least, need + 1024))

    def needs(self) -> dict[str, int]:
        """The greatest so far."""
        return dict(zip(LISTS, self.report.tolist(), strict=False))

    def may_skip_waiting(self, shape: Shape, which: str, capturing: bool) -> bool:
        """Whether a pass needs no look at what it needed; grows the bounds that earlier passes came near."""
        told = self.report.tolist()
        if told != self.looked_at:
            self._look_back()
            self.looked_at = told
        large = max(told[: len(LISTS)]) > LARGE
        return shape.strokes <= self.proven.get(which, -1) and (capturing or not large)

    def _look_back(self) -> None:
        needs = self.needs()
        if any(need > self.length[name] for name, need in needs.items()):
            warnings.warn(
                "an earlier drawing needed more memory than foreseen, more than twice as much as any before it: its "
                "images are NaN and its gradients 0. From now on there is enough for it",
                RuntimeWarning,
                stacklevel=users_level(),
            )
        if any(self._near(name, need) for name, need in needs.items()):
            self.proven.clear()
            self.grow()

    def _near(self, name: str, need: int) -> bool:
        """Whether a need comes near a list's end."""
        return need > self.length[name] if need > LARGE else 2 * need > self.length[name]

    def grow(self) -> None:
        """Makes more room than was needed, where that came near the end.

        Raises:
            MemoryError: more than 2^32 of something.
        """
        for name, need in self.needs().items():
            if need > MOST:
                raise MemoryError(
                    f"the drawing needs {need:,} {name}, at most {MOST:,} are possible: draw fewer views at once"
                )
            if self._near(name, need):
                self.length[name] = min(MOST, int(LARGE_MARGIN * need) if need > LARGE else MARGIN * need)

    def enough(self, shape: Shape, which: str) -> bool:
        """After a pass has run: whether it had room. If it had plenty, it is proven; if not, there is more now."""
        needs = self.needs()
        fitted = all(need <= self.length[name] for name, need in needs.items())
        self.grow()
        # The backward pass of a drawing that was spoilt counted nothing.
        if fitted and (which == "forward" or shape.strokes <= self.proven.get("forward", -1)):
            self.proven[which] = max(shape.strokes, self.proven.get(which, -1))
        return fitted

    def forget(self, shape: Shape) -> None:
        """All needs, once memory has run out: what a large drawing needed is not taken for the next, smaller one."""
        self.length.clear()
        self.proven.clear()
        self.looked_at.clear()
        self.report.zero_()
        self.guess(shape)

    def take_bad(self) -> bool:
        """Whether a stroke could not be drawn since the last question."""
        bad = bool(self.report.tolist()[BAD])
        if bad:
            self.report[BAD] = 0
        return bad
