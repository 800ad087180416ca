"""The 3D sketch: strokes, each a rational Bézier curve with width, colour and opacity."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import torch

from diff3ds import _detail, _shown, bezier
from diff3ds._checks import as_numbers, check_generator, kind
from diff3ds._modes import can_look_at, check_plain
from diff3ds._shapes import Bool, Float, Tensor
from diff3ds._sketch_fields import called, filled, marks, worth
from diff3ds._with_torch import known_to_torch
from diff3ds.chains import Chains

WidthSpace = Literal["image", "world"]

# Full width as a fraction of the image height: about 3 px at 512.
DEFAULT_WIDTH = 0.006

# How strokes look that nobody said anything of.
PLAIN: dict[str, Any] = {"width": DEFAULT_WIDTH, "color": (0.0, 0.0, 0.0), "width_space": "image"}

# The fields with numbers; those with one thing of a kind for each stroke, None where no stroke has any; and files' keys
# of which segments make which stroke.
NUMBERS = ("points", "weights", "width", "color", "opacity")
BESIDE: dict[str, type] = {"fixed": bool, "names": str, "kinds": str, "importance": float}
# Of these the texts.
TEXTS = ("names", "kinds")
CHAINS = {"stroke": "chains.stroke", "closed": "chains.closed"}

# Gap at a joint that rounding may leave, as a fraction of the extent of the two segments; of widths, of the largest.
JOINT_GAP = 1e-4


@known_to_torch
@dataclass(frozen=True, eq=False, init=False)
class Sketch:
    """N strokes in world units, z up, of one or more segments: rational Bézier curves of K = degree + 1 control points.

    Everything but `points` may be left out; a number, a colour or one value a stroke does for
    `width`, `color` and `opacity`. Without `chains` every segment is a stroke of its own, M = N.

    Attributes:
        points: control points of the M segments, K = 2, 3 or 4.
        weights: positive rational weights, default 1.
        width: full widths, not negative: fractions of the image height (`width_space="image"`) or world units
            (`"world"`). One a stroke, or one a control point: then the width along a segment is the polynomial with
            these Bernstein coefficients (not weighted) in the segment's parameter.
        color: straight (not premultiplied) RGB, usually in [0, 1]; default black.
        opacity: in [0, 1], default 1.
        width_space: "image" (same width at every depth; default) or "world" (thinner with distance).
        chains: which segments make which stroke; None where each is one, also if it was given so.
        fixed: strokes that are marked to stay as they are where others are drawn further; None where none is.
        names: of the strokes, such as the edges of a solid that they draw, "" where one has none; None where all do.
            What comes before the last "/" is the thing that a stroke is part of: "lamp/stroke 3", "engine/rod/edge 7".
        importance: how much of what the sketch draws each stroke adds to those before it in that order, a share of it
            all, not negative; None where nobody has said. `ds.by_importance` finds it, `at_detail` cuts by it.
        kinds: what the strokes are, such as "crease", "border" or "contour" (an outline that is fitted, and another one
            from each side), "" where that is not known; None where it is of none.

    Raises:
        TypeError, ValueError: a wrong type, shape, dtype, device or value, segments that do not meet at a joint, or
            widths that jump there; the message names the field, the stroke and the value. Values on a GPU are not
            looked at here, because that would wait for it: `render` refuses bad ones, and `check_values` looks at once.
    """

    points: Float[Tensor, "M K 3"]
    weights: Float[Tensor, "M K"]
    width: Float[Tensor, " N"] | Float[Tensor, "M K"]
    color: Float[Tensor, "N 3"]
    opacity: Float[Tensor, " N"]
    width_space: WidthSpace
    chains: Chains | None
    fixed: Bool[Tensor, " N"] | None
    names: tuple[str, ...] | None
    importance: Float[Tensor, " N"] | None
    kinds: tuple[str, ...] | None

    def __init__(
        self,
        points: Float[Tensor, "M K 3"],
        weights: Float[Tensor, "M K"] | None = None,
        width: float | Float[Tensor, " N"] | Float[Tensor, "M K"] = DEFAULT_WIDTH,
        color: Sequence[float] | Float[Tensor, " 3"] | Float[Tensor, "N 3"] = (0.0, 0.0, 0.0),
        opacity: float | Float[Tensor, " N"] = 1.0,
        width_space: WidthSpace = "image",
        chains: Chains | None = None,
        fixed: Bool[Tensor, " N"] | None = None,
        names: Sequence[str] | None = None,
        importance: Float[Tensor, " N"] | None = None,
        kinds: Sequence[str] | None = None,
    ) -> None:
        if not isinstance(points, Tensor) or not points.is_floating_point():
            raise TypeError(f"points must be a floating point tensor, got {kind(points)}")
        if points.ndim != 3 or points.shape[1] not in (2, 3, 4) or points.shape[2] != 3:
            hint = ": add a leading stroke axis with points[None]" if points.ndim == 2 else ""
            raise ValueError(f"points must have shape (N, K, 3), K = 2, 3 or 4, got {tuple(points.shape)}{hint}")
        segments, controls = points.shape[:2]
        chains = _kept(chains, points)
        count, rows = (segments, "strokes") if chains is None else (len(chains), "segments")
        along = isinstance(width, Tensor) and width.ndim == 2
        given = {
            "points": points,
            "weights": filled("weights", 1.0 if weights is None else weights, points, (segments, controls), rows),
            "width": filled("width", width, points, *(((segments, controls), rows) if along else ((count,),))),
            "color": filled("color", color, points, (count, 3)),
            "opacity": filled("opacity", opacity, points, (count,)),
        }
        check_plain(**given)
        if width_space not in get_args(WidthSpace):
            raise ValueError(f'width_space must be "image" or "world", got {width_space!r}')
        for name, value in given.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "width_space", width_space)
        object.__setattr__(self, "chains", chains)
        object.__setattr__(self, "fixed", marks(fixed, points, count))
        object.__setattr__(self, "names", called("names", names, count))
        object.__setattr__(self, "kinds", called("kinds", kinds, count))
        object.__setattr__(self, "importance", worth(importance, points, count))
        # Where values are not looked at, drawing refuses bad ones.
        if can_look_at(points):
            self.check_values()

    def check_values(self) -> None:
        """Raises ValueError for the first value out of range; names the field, the stroke and the value."""
        rules: dict[str, tuple[str, Callable[[Tensor], Tensor]]] = {
            "points": ("finite", lambda v: v.isfinite()),
            "weights": ("finite and positive", lambda v: v.isfinite() & (v > 0)),
            "width": ("finite and not negative", lambda v: v.isfinite() & (v >= 0)),
            "color": ("finite", lambda v: v.isfinite()),
            "opacity": ("in [0, 1]", lambda v: (v >= 0) & (v <= 1)),
        }
        if self.importance is not None:
            rules["importance"] = rules["width"]
        for name, (expected, holds) in rules.items():
            value = getattr(self, name).detach()
            good = holds(value)
            if not bool(good.all()):
                row = int(good.reshape(len(value), -1).all(1).int().argmin())
                got = value[row].reshape(-1)[int(good[row].reshape(-1).int().argmin())].item()
                raise ValueError(f"{name} of {self._named(row, len(value))} must be {expected}, got {got}")
        if self.chains is not None:
            self._check_joints(self.chains)

    def _named(self, row: int, rows: int) -> str:
        """What a row of a tensor with so many rows is about."""
        if self.chains is None or rows != len(self.points) or rows == len(self):
            return f"stroke {row}"
        stroke = int(self.chains.stroke[row])
        return f"stroke {stroke} (segment {row - int(self.chains.first[stroke])})"

    def _check_joints(self, chains: Chains) -> None:
        """Raises ValueError for the first joint where segments do not meet, or the width jumps."""
        ends, starts = chains.joints
        points, width = self.points.detach().double(), self.width.detach().double()
        extent = (points.amax(1) - points.amin(1)).amax(1)
        gap = (points[ends, -1] - points[starts, 0]).abs().amax(1)
        rules = [("has a gap", gap, torch.maximum(extent[ends], extent[starts]))]
        if width.ndim == 2:
            widest = torch.maximum(width[ends].amax(1), width[starts].amax(1))
            rules.append(("changes its width", (width[ends, -1] - width[starts, 0]).abs(), widest))
        for what, jump, scale in rules:
            apart = jump > JOINT_GAP * scale
            if bool(apart.any()):
                joint = int(apart.int().argmax())
                stroke = int(chains.stroke[starts[joint]])
                before, after = (int(rows[joint] - chains.first[stroke]) for rows in (ends, starts))
                raise ValueError(
                    f"stroke {stroke} {what} of {jump[joint].item():g} between its segments {before} and {after}: a "
                    "segment must begin as the one before it ends (Chains.joined makes values agree there)"
                )

    def __len__(self) -> int:
        return len(self.opacity)

    def __getitem__(self, index: int | slice | list[int] | Tensor) -> "Sketch":
        """Some of the strokes, by index, slice or mask, with all their segments; an int gives a sketch of one."""
        return self.select(index)

    def select(self, strokes: int | slice | list[int] | Tensor, **curves: Any) -> "Sketch":
        """Some of the strokes with all their segments, or other curves that look like them.

        Args:
            strokes: index, slice, mask or numbers, which may come several times, of strokes of this sketch.
            curves: `points`, `weights`, `chains`, and `width` where it is one a control point, of as many new strokes:
                each has the rest from the stroke of this sketch that is chosen in its place.

        Raises:
            TypeError, ValueError: as `Sketch`; other curves without widths, where these are one a control point.
        """
        if curves and self.width.ndim == 2 and "width" not in curves:
            raise ValueError("other curves of strokes with a width a control point must be given with such widths")
        rows: Any = [strokes] if isinstance(strokes, int) else strokes
        every = torch.arange(len(self), device=self.points.device)
        if not curves and self.chains is None:
            curves = {name: getattr(self, name)[rows] for name in self.segment_fields}
        elif not curves and self.chains is not None:
            rows = every[rows]
            segments, chains = self.chains.select(rows)
            curves = {name: getattr(self, name)[segments] for name in self.segment_fields} | {"chains": chains}
        looks = {name: value[rows] for name, value in self.tensors().items() if name not in self.segment_fields}
        of_strokes = {n: None if (v := getattr(self, n)) is None else v[rows] for n in ("fixed", "importance")}
        chosen = every[rows].tolist()
        texts = {name: [v[row] for row in chosen] for name in TEXTS if (v := getattr(self, name)) is not None}
        return Sketch(**{**looks, "width_space": self.width_space, **of_strokes, **texts, **curves})

    def replace(self, **changes: Any) -> "Sketch":
        """The same sketch with other values of some fields, given as to `Sketch`.

        Raises:
            TypeError, ValueError: as `Sketch`.
        """
        return replace(self, **changes)

    def with_color(
        self, strokes: int | slice | list[int] | Tensor, color: Sequence[float] | Float[Tensor, " 3"]
    ) -> "Sketch":
        """The same sketch with some of its strokes, by index, slice, mask or numbers, in another colour.

        Args:
            color: straight RGB, usually in [0, 1].

        Raises:
            TypeError, ValueError: a colour that is not three numbers.
        """
        chosen = torch.zeros(len(self), 1, dtype=torch.bool, device=self.color.device)
        chosen[strokes] = True
        return replace(self, color=torch.where(chosen, filled("color", color, self.points, (3,)), self.color))

    def at_detail(self, detail: float = 1.0, *, strokes: int | None = None) -> "Sketch":
        """The strokes that say most, in the order of this sketch; at a lower level some of those at a higher one.

        Args:
            detail: from 0, one stroke, to 1, all: the most important strokes, as few as draw together the share
                1 - (1 - detail)^3 of what all draw, and those that are worth as much as the last of them.
            strokes: so many at most.

        Raises:
            ValueError: the sketch has no `importance` (`ds.by_importance` finds it); a detail or a number out of range.
        """
        if self.importance is None:
            raise ValueError("nothing is known of the importance of the strokes: give ds.by_importance(sketch)")
        return self.select(_detail.kept(self.importance, detail, strokes))

    def segments(self) -> "Sketch":
        """Every segment as a stroke of its own, with the appearance of its stroke."""
        if self.chains is None:
            return self
        curves = {name: getattr(self, name) for name in self.segment_fields}
        return self.select(self.chains.stroke, **curves)

    def tensors(self) -> dict[str, Tensor]:
        """The five tensor fields by name."""
        return {name: getattr(self, name) for name in NUMBERS}

    @property
    def segment_fields(self) -> tuple[str, ...]:
        """Names of the tensors that have a row for each segment; the others have one for each stroke."""
        return ("points", "weights", "width") if self.width.ndim == 2 else ("points", "weights")

    def to(self, target: torch.dtype | torch.device | str) -> "Sketch":
        """The same sketch in another dtype or on another device."""
        moved = {name: value.to(target) for name, value in self.tensors().items()}
        home = moved["points"].device
        chains = None if self.chains is None else self.chains.to(home)
        fixed = None if self.fixed is None else self.fixed.to(home)
        importance = None if self.importance is None else self.importance.to(moved["points"])
        return self.replace(**moved, chains=chains, fixed=fixed, importance=importance)

    def detach(self) -> "Sketch":
        """The same sketch without its autograd history."""
        return self.replace(**{name: value.detach() for name, value in self.tensors().items()})

    def _repr_png_(self) -> bytes:
        """The sketch as it is seen from the right and above, for notebooks."""
        return _shown.png_of(self)

    def transform(self, matrix: Float[Tensor, "4 4"]) -> "Sketch":
        """The sketch moved by a similarity (rotation, uniform scale, translation); world widths scale with it.

        Raises:
            ValueError: the matrix is not a similarity: other maps would not leave the strokes' widths uniform.
        """
        matrix = matrix.to(self.points)
        linear = matrix[:3, :3]
        scale = linear.detach().det().abs() ** (1 / 3)
        gram = linear.detach().T @ linear.detach() / scale**2
        bottom = torch.tensor([0.0, 0.0, 0.0, 1.0]).to(matrix)
        if matrix.shape != (4, 4) or not torch.allclose(gram, torch.eye(3).to(gram), atol=1e-4):
            raise ValueError("matrix must be a 4x4 similarity: a rotation times one scale, and a translation")
        if not torch.equal(matrix[3].detach(), bottom):
            raise ValueError(f"the last row of matrix must be (0, 0, 0, 1), got {matrix[3].tolist()}")
        width = self.width * scale if self.width_space == "world" else self.width
        return replace(self, points=self.points @ linear.T + matrix[:3, 3], width=width)

    def elevate(self, degree: int = bezier.MAX_DEGREE) -> "Sketch":
        """The same strokes with degree + 1 control points each."""
        points, weights = bezier.elevate(self.points, self.weights, degree)
        width = self.width
        if width.ndim == 2:
            width = bezier.elevate(width[..., None], None, degree)[0][..., 0]
        return replace(self, points=points, weights=weights, width=width)

    @staticmethod
    def concatenate(sketches: "Sequence[Sketch]") -> "Sketch":
        """One sketch of all strokes, of the highest degree among them; with widths a control point if one has such.

        Raises:
            ValueError: no sketches, or sketches of different `width_space`.
        """
        if not sketches:
            raise ValueError("expected at least one sketch, got none")
        spaces = {s.width_space for s in sketches}
        if len(spaces) > 1:
            raise ValueError("sketches with widths in image and in world units cannot be joined")
        degree = max(s.points.shape[1] for s in sketches) - 1
        raised = [s.elevate(degree) for s in sketches]
        chains = None
        if any(s.chains is not None for s in raised):
            home = raised[0].points.device
            chains = Chains.concatenate([s.chains or Chains.plain(len(s), home) for s in raised])
        if any(s.width.ndim == 2 for s in raised):
            raised = [s.with_widths_along() for s in raised]
        parts = [s.tensors() for s in raised]
        joined: Any = {name: torch.cat([p[name] for p in parts]) for name in parts[0]}
        fixed = None
        if any(s.fixed is not None for s in raised):
            flags = [torch.zeros_like(s.opacity, dtype=torch.bool) if s.fixed is None else s.fixed for s in raised]
            fixed = torch.cat(flags)
        texts: Any = {name: [text for s in raised for text in getattr(s, name) or ("",) * len(s)] for name in TEXTS}
        known = [s.importance for s in raised if s.importance is not None]
        importance = torch.cat(known) if len(known) == len(raised) else None
        space = sketches[0].width_space
        return Sketch(**joined, **texts, width_space=space, chains=chains, fixed=fixed, importance=importance)

    def with_widths_along(self) -> "Sketch":
        """The same sketch with one width a control point."""
        if self.width.ndim == 2:
            return self
        width = self.width if self.chains is None else self.width[self.chains.stroke]
        return replace(self, width=width[:, None].expand(self.weights.shape))

    @staticmethod
    def random(
        count: int = 56,
        *,
        generator: torch.Generator,
        radius: float = 1.5,
        extent: float = 0.3,
        width: float = DEFAULT_WIDTH,
    ) -> "Sketch":
        """The paper's start: short black cubics at random places in a ball around the origin.

        Each has its centre uniform in the ball, a random direction, and its four points along `extent` of the radius
        with a jitter of a tenth of that. The paper says no more than "random in a sphere of radius 1.5"; the rest is
        empirical.

        Args:
            radius: of the ball, world units.
            extent: length of the strokes as a fraction of the radius.
            width: as for `Sketch`.

        Raises:
            TypeError, ValueError: no generator, a negative count, or values that `Sketch` refuses.
        """
        check_generator(generator)
        if not isinstance(count, int) or count < 0:
            raise ValueError(f"count must be a whole number, not negative, got {count!r}")
        for name, value in (("radius", radius), ("extent", extent)):
            number = as_numbers(name, value)
            if number.ndim or not 0 <= number < math.inf:
                raise ValueError(f"{name} must be a finite number, not negative, got {value!r}")

        def normal(*shape: int) -> Tensor:
            return torch.randn(*shape, 3, generator=generator, device=generator.device)

        uniform = torch.rand(count, 1, 1, generator=generator, device=generator.device)
        direction = torch.nn.functional.normalize(normal(count, 1), dim=-1)
        center = torch.nn.functional.normalize(normal(count, 1), dim=-1) * uniform ** (1 / 3)
        along = torch.linspace(-0.5, 0.5, 4, device=generator.device)[:, None]
        points = center + extent * (direction * along + 0.1 * normal(count, 4))
        return Sketch(radius * points, width=width)


def parts_of(sketch: Sketch) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """All that a sketch is, for files and other processes: tensors by name, and the rest as plain values of JSON."""
    beside = {name: value for name in BESIDE if (value := getattr(sketch, name)) is not None}
    tensors = sketch.tensors() | {name: value for name, value in beside.items() if isinstance(value, Tensor)}
    if sketch.chains is not None:
        tensors |= {key: getattr(sketch.chains, name) for name, key in CHAINS.items()}
    lists = {name: list(value) for name, value in beside.items() if name not in tensors}
    return tensors, {"width_space": sketch.width_space, **lists}


def of_parts(tensors: dict[str, Tensor], rest: dict[str, Any]) -> Sketch:
    """The sketch with these parts (`parts_of`); what else there is by other names does not matter.

    Raises:
        KeyError: a part is missing.
        TypeError, ValueError: as `Sketch`.
    """
    given: dict[str, Any] = {name: tensors[name] for name in NUMBERS} | {"width_space": rest["width_space"]}
    given |= {name: part[name] for name in BESIDE for part in (tensors, rest) if name in part}
    if CHAINS["stroke"] in tensors:
        given["chains"] = Chains(**{name: tensors[key] for name, key in CHAINS.items()})
    return Sketch(**given)


def _kept(chains: Chains | None, points: Tensor) -> Chains | None:
    """The chains, if they fit and are needed."""
    if chains is None:
        return None
    if not isinstance(chains, Chains):
        raise TypeError(f"chains must be Chains(...) or None, got {type(chains).__name__}")
    if len(chains.stroke) != len(points):
        raise ValueError(f"chains must say the stroke of each of the {len(points)} segments, got {len(chains.stroke)}")
    if chains.stroke.device != points.device:
        raise ValueError(f"chains must be on the device of points, {points.device}, got {chains.stroke.device}")
    return None if chains.is_plain() else chains
