"""Options of a distillation, which `diff3ds text` and `diff3ds image` share, and the presets that fill them in."""

from dataclasses import dataclass, fields, replace
from typing import Annotated, Literal

from tyro.conf import arg

from diff3ds._settings import MAX_SIZE, check_seed, require_finite
from diff3ds.guidance.recipe import Method, Recipe, TimeAnnealing, Weighting, Work, check_orbits, conditions

Parameter = Literal["position", "color", "alpha", "width"]


PresetName = Literal["paper", "swift"]


@dataclass(frozen=True)
class Preset:
    """Values that belong together.

    Attributes:
        steps: gradient steps.
        strokes: at the start.
        rate: learning rate of control points, world units a step.
        final_rate: learning rates fall exponentially to this share; 1 keeps them.
        radius: of the ball in which strokes start; more than about 1 lies partly outside the pictures.
        blur: of the renderings, pixels: gives gradients beside the strokes.
        guidance: weight of classifier-free guidance; None is 50 for a phrase and 7.5 for a picture.
    """

    steps: int
    strokes: int
    rate: float
    final_rate: float
    radius: float
    blur: float
    guidance: float | None


PRESETS: dict[PresetName, Preset] = {
    "paper": Preset(4000, 56, 0.002, 1.0, 1.5, 0.0, None),
    # Empirical, with a prior whose score is exact (benchmarks/distill.py): a tenth of the steps.
    "swift": Preset(400, 112, 0.01, 0.2, 0.8, 0.0, 7.5),
}


# The weight of guidance in the publication of each method that has its own; counted from the unconditional prediction.
METHOD_GUIDANCE: dict[Method, float] = {"nfsd": 7.5, "asd": 7.5, "ism": 7.5, "sdi": 8.5, "vsd": 7.5}


@dataclass(frozen=True)
class DistillOptions:
    """How a prior makes a sketch.

    Attributes:
        preset: paper (of the paper) or swift (a tenth of the steps, strokes start inside the pictures); by default
            swift for priors that are built in, else paper. Options that are given come before the preset's.
        steps: gradient steps; the paper: 4000.
        strokes: at the start; the paper: 56.
        batch: views a step; a multiple of 4 for priors that see four views of an object at once.
        size: of the renderings, pixels; by default what the prior was trained on.
        optimize: what is optimised: position, color, alpha, width.
        rate: learning rate of control points, world units a step; the paper: 0.002.
        color_rate: of colours, a step.
        alpha_rate: of opacities, a step.
        width_rate: of the logarithms of widths, a step.
        final_rate: learning rates fall exponentially to this share; the paper: 1.
        width: of the strokes at the start, as a fraction of the image height; by default 0.006, and with the built-in
            prior, whose images are small, 0.05, which becomes 0.006 in the results.
        width_range: between which widths stay, if they are optimised.
        radius: of the ball in which strokes start; the paper: 1.5.
        blur: of the renderings, pixels; the paper: 0.
        distance: least and greatest, of the cameras from the middle.
        elevation: lowest and highest, of the cameras, degrees.
        fov: field of view, degrees.
        guidance: weight of classifier-free guidance; by default the method's own (nfsd, asd, ism, vsd 7.5; sdi 8.5),
            else the preset's, else 50 for a phrase and 7.5 for a picture.
        method: sds, reconstruction (sds with restored contrast), or csd, nfsd, asd, ism, sdi, vsd; by default
            reconstruction for priors that see several views at once, else sds.
        rescale: share of the contrast that reconstruction restores.
        weighting: w(t) of the methods that have one: sds (1 - alpha-bar), uniform, fantasia3d, ratio.
        clip: entries of the gradient at the prior are limited to ± this.
        t_high: highest timestep, share of all, at the first step and after the annealing.
        t_low: lowest timestep, at the first step and after the annealing.
        anneal_share: share of the steps that the annealing takes.
        delete_length: strokes shorter than this are deleted, world units; 0 deletes none.
        delete_from: share of the steps before the first deletion.
        delete_every: share of the steps between deletions.
        sharpen: end with 300 further steps (--no-sharpen: without them) on finer pictures, where the prior is exemplar,
            widths are its own, and positions are optimised.
        sheet_every: steps between contact sheets (renderings above what the prior sees in them); 0 makes none.
        seed: of all random draws.
        resume: go on from the checkpoint in the output folder.
        overwrite: the run in the output folder may be lost.
    """

    preset: PresetName | None = None
    steps: int | None = None
    strokes: int | None = None
    batch: int = 4
    size: int | None = None
    optimize: tuple[Parameter, ...] = ("position",)
    rate: float | None = None
    color_rate: float = 0.01
    alpha_rate: float = 0.01
    width_rate: float = 0.01
    final_rate: float | None = None
    width: float | None = None
    width_range: tuple[float, float] = (0.001, 0.1)
    radius: float | None = None
    blur: float | None = None
    distance: tuple[float, float] = (1.8, 2.0)
    elevation: tuple[float, float] = (0.0, 30.0)
    fov: float = 60.0
    guidance: float | None = None
    method: Method | None = None
    rescale: float = 0.5
    weighting: Weighting = "sds"
    clip: float | None = None
    t_high: tuple[float, float] = (0.85, 0.30)
    t_low: tuple[float, float] = (0.85, 0.10)
    anneal_share: float = 0.9
    delete_length: float = 0.1
    delete_from: float = 0.5
    delete_every: float = 0.025
    # The option is --no-sharpen, whose default is not True.
    sharpen: Annotated[bool, arg(help_behavior_hint="(default: with them)")] = True
    sheet_every: int = 500
    seed: int = 0
    resume: bool = False
    overwrite: bool = False

    def __post_init__(self) -> None:
        require_finite(self)
        for name in ("steps", "strokes", "batch", "size"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise ValueError(f"{name} must be positive, got {value}")
        for name in ("radius", "width", "final_rate"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ValueError(f"{name} must be positive, got {value}")
        for name in ("rate", "color_rate", "alpha_rate", "width_rate", "blur"):
            value = getattr(self, name)
            if value is not None and not value >= 0:
                raise ValueError(f"{name} must not be negative, got {value}")
        check_seed(self.seed)
        if self.size is not None and not (isinstance(self.size, int) and self.size <= MAX_SIZE):
            raise ValueError(f"size must be a whole number up to {MAX_SIZE}, got {self.size}")
        if not 0 < self.fov < 180:
            raise ValueError(f"fov must lie in (0, 180) degrees, got {self.fov}")
        if not self.optimize:
            raise ValueError("optimize must name something: position, color, alpha, width")
        if self.sheet_every < 0 or self.delete_length < 0:
            raise ValueError("sheet_every and delete_length must not be negative; 0 turns them off")
        if not (0 <= self.delete_from <= 1 and 0 < self.delete_every <= 1):
            raise ValueError("delete_from must lie in [0, 1] and delete_every in (0, 1]: they are shares of the steps")
        # What these check is said before any weights are loaded.
        check_orbits(self.batch, 1, self.distance, self.elevation)
        self.recipe(0.0, group=1)
        least, most = self.width_range
        if "width" in self.optimize and self.width is not None and not least <= self.width <= most:
            raise ValueError(f"width must lie in width_range {self.width_range}, got {self.width}: give another one")

    @property
    def sharpens(self) -> bool:
        """Whether the last steps may move strokes and change widths: not widths that are chosen or optimised."""
        return self.sharpen and self.width is None and "position" in self.optimize and "width" not in self.optimize

    def annealing(self) -> TimeAnnealing:
        """The timesteps that are drawn."""
        try:
            return TimeAnnealing(self.t_low[0], self.t_high[0], self.t_low[1], self.t_high[1], self.anneal_share)
        except ValueError as error:
            raise ValueError(f"t_low, t_high, anneal_share: {error}") from error

    def values(self, default: PresetName = "paper") -> Preset:
        """The values of the preset, except where options are given."""
        preset = PRESETS[self.preset or default]
        given = {f.name: getattr(self, f.name) for f in fields(Preset)}
        return replace(preset, **{name: value for name, value in given.items() if value is not None})

    def work(self) -> Work:
        """What a prior does in a step, as far as its memory goes."""
        return Work(self.batch, conditions(self.method or "sds"), self.method == "vsd")

    def recipe(self, guidance: float, group: int, preset: PresetName = "paper") -> Recipe:
        """How the prior moves the sketch.

        Args:
            guidance: weight of classifier-free guidance where neither options, method nor preset have one.
            group: views that the prior sees at once.
            preset: where the options name none.
        """
        method = self.method or ("reconstruction" if group > 1 else "sds")
        said = PRESETS[self.preset or preset].guidance or guidance
        weight = METHOD_GUIDANCE.get(method, said) if self.guidance is None else self.guidance
        return Recipe(method, weight, self.rescale, self.weighting, self.clip, self.annealing())
