"""What a run of `diff3ds text` or `diff3ds image` is to do: both fill it in, run.json records it, the run follows it.

Its options lie in groups, by their subject; each has one name, whatever its group, which is that of the command line.
"""

from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Annotated, Any, Generic, Literal, TypeVar

from tyro.conf import arg

from diff3ds._settings import MAX_SIZE, check_seed, option_values, require_finite
from diff3ds.guidance.recipe import Method, Recipe, TimeAnnealing, Weighting, Work, check_orbits, conditions
from diff3ds.tasks.render.page_options import NO_PAGE, PageOptions
from diff3ds.tasks.text_image.prior_options import PriorOptions
from diff3ds.tasks.text_image.subject import Phrase, Picture

Parameter = Literal["position", "color", "alpha", "width"]


PresetName = Literal["paper", "swift", "brief"]


@dataclass(frozen=True)
class Preset:
    """Values that belong together.

    Attributes:
        steps: gradient steps.
        strokes: at the start.
        rate: learning rate of control points, world units a step.
        final_rate: learning rates fall exponentially to this fraction; 1 keeps them.
        radius: of the ball in which strokes start; more than about 1 lies partly outside the pictures.
        blur: of the renderings, pixels: gives gradients beside the strokes.
        guidance: weight of classifier-free guidance; None is that of the subject.
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
    # Enough to tell which drawing of the library it becomes, where the end draws that again. Empirical, over all kinds:
    # as many are found whole as by swift; with its rate fewer are, for strokes do not come far enough (a ball's).
    "brief": Preset(150, 112, 0.02, 0.2, 0.8, 0.0, 7.5),
}


# The weight of guidance in the publication of each method that has its own; counted from the unconditional prediction.
METHOD_GUIDANCE: dict[Method, float] = {"nfsd": 7.5, "asd": 7.5, "ism": 7.5, "sdi": 8.5, "vsd": 7.5}


@dataclass(frozen=True)
class ScoreOptions:
    """The recipe by which the prior moves the sketch.

    Attributes:
        guidance: weight of classifier-free guidance; by default the method's own (nfsd, asd, ism, vsd 7.5; sdi 8.5),
            else the preset's, else 50 for a phrase and 7.5 for a picture.
        method: sds, reconstruction (sds with restored contrast), or csd, nfsd, asd, ism, sdi, vsd; by default
            reconstruction for priors that see several views at once, else sds.
        rescale: fraction of the contrast that reconstruction restores.
        weighting: w(t) of the methods that have one: sds (1 - alpha-bar), uniform, fantasia3d, ratio.
        clip: entries of the gradient at the prior are limited to ± this.
        t_high: highest timestep, as a fraction of all, at the first step and after the annealing.
        t_low: lowest timestep, at the first step and after the annealing.
        anneal_share: fraction of the steps that the annealing takes.
    """

    guidance: float | None = None
    method: Method | None = None
    rescale: float = 0.5
    weighting: Weighting = "sds"
    clip: float | None = None
    t_high: tuple[float, float] = (0.85, 0.30)
    t_low: tuple[float, float] = (0.85, 0.10)
    anneal_share: float = 0.9

    def __post_init__(self) -> None:
        require_finite(self)
        self.recipe(1, 0.0)

    def annealing(self) -> TimeAnnealing:
        """The timesteps that are drawn."""
        try:
            return TimeAnnealing(self.t_low[0], self.t_high[0], self.t_low[1], self.t_high[1], self.anneal_share)
        except ValueError as error:
            raise ValueError(f"t_low, t_high, anneal_share: {error}") from error

    def recipe(self, group: int, guidance: float) -> Recipe:
        """The recipe of these options.

        Args:
            group: views that the prior sees at once.
            guidance: weight of classifier-free guidance where neither these options nor the method have one.
        """
        method = self.method or ("reconstruction" if group > 1 else "sds")
        weight = METHOD_GUIDANCE.get(method, guidance) if self.guidance is None else self.guidance
        return Recipe(method, weight, self.rescale, self.weighting, self.clip, self.annealing())


@dataclass(frozen=True)
class StrokeOptions:
    """Which strokes a sketch starts with, and which it loses.

    Attributes:
        strokes: at the start; the paper: 56.
        width: of the strokes at the start, as a fraction of the image height; by default 0.006, and with the built-in
            prior, whose images are small, 0.05, which becomes 0.006 in the results.
        width_range: between which widths stay, if they are optimised.
        radius: of the ball in which strokes start; the paper: 1.5.
        delete_length: strokes shorter than this are deleted, world units; 0 deletes none.
        delete_from: fraction of the steps before the first deletion.
        delete_every: fraction of the steps between deletions.
        start: a sketch to go on from (a file, or the folder of a run) instead of random strokes. They keep their
            number and widths; those that are marked as fixed stay as they are.
    """

    strokes: int | None = None
    width: float | None = None
    width_range: tuple[float, float] = (0.001, 0.1)
    radius: float | None = None
    delete_length: float = 0.1
    delete_from: float = 0.5
    delete_every: float = 0.025
    start: Annotated[Path | None, arg(name="from")] = None

    def __post_init__(self) -> None:
        require_finite(self)
        if self.start is not None:
            for name in ("strokes", "width", "radius"):
                if getattr(self, name) is not None:
                    raise ValueError(f"--from gives the strokes, as they are: leave --{name} out")
        _require_positive(self, "strokes", "width", "radius")
        if self.delete_length < 0:
            raise ValueError("delete_length must not be negative; 0 turns the deletion off")
        if not (0 <= self.delete_from <= 1 and 0 < self.delete_every <= 1):
            raise ValueError("delete_from must lie in [0, 1] and delete_every in (0, 1]: fractions of the steps")


@dataclass(frozen=True)
class CameraOptions:
    """From where the prior looks, and at what images.

    Attributes:
        batch: views a step; a multiple of 4 for priors that see four views of an object at once.
        size: of the renderings, pixels; by default what the prior was trained on.
        blur: of the renderings, pixels; the paper: 0.
        distance: least and greatest, of the cameras from the middle.
        elevation: lowest and highest, of the cameras, degrees.
        fov: field of view, degrees.
    """

    batch: int = 4
    size: int | None = None
    blur: float | None = None
    distance: tuple[float, float] = (1.8, 2.0)
    elevation: tuple[float, float] = (0.0, 30.0)
    fov: float = 60.0

    def __post_init__(self) -> None:
        require_finite(self)
        _require_positive(self, "batch", "size")
        _require_not_negative(self, "blur")
        if self.size is not None and not (isinstance(self.size, int) and self.size <= MAX_SIZE):
            raise ValueError(f"size must be a whole number up to {MAX_SIZE}, got {self.size}")
        if not 0 < self.fov < 180:
            raise ValueError(f"fov must lie in (0, 180) degrees, got {self.fov}")
        # Said before any weights are loaded; whether the prior sees several views at once is not known yet.
        check_orbits(self.batch, 1, self.distance, self.elevation)


@dataclass(frozen=True)
class DescentOptions:
    """The gradient descent.

    Attributes:
        preset: paper (of the paper), swift (a tenth of the steps, strokes start inside the pictures) or brief (fewer
            still, for what is drawn again, and no more once all of it is there); by default brief where the end is
            drawn again, swift for other priors that are built in, else paper. Options that are given come before the
            preset's.
        steps: gradient steps; the paper: 4000.
        optimize: what is optimised: position, color, alpha, width.
        rate: learning rate of control points, world units a step; the paper: 0.002.
        color_rate: of colours, a step.
        alpha_rate: of opacities, a step.
        width_rate: of the logarithms of widths, a step.
        final_rate: learning rates fall exponentially to this fraction; the paper: 1.
        redraw: at the end draw what was found again (--no-redraw: leave it) in the strokes of the library's drawing
            that it has become, where the prior is exemplar, widths are its own, and positions are optimised.
        seed: of all random draws.
    """

    preset: PresetName | None = None
    steps: int | None = None
    optimize: tuple[Parameter, ...] = ("position",)
    rate: float | None = None
    color_rate: float = 0.01
    alpha_rate: float = 0.01
    width_rate: float = 0.01
    final_rate: float | None = None
    # The option is --no-redraw, whose default is not True.
    redraw: Annotated[bool, arg(help_behavior_hint="(default: it is drawn again)")] = True
    seed: int = 0

    def __post_init__(self) -> None:
        require_finite(self)
        _require_positive(self, "steps", "final_rate")
        _require_not_negative(self, "rate", "color_rate", "alpha_rate", "width_rate")
        check_seed(self.seed)
        if not self.optimize:
            raise ValueError("optimize must name something: position, color, alpha, width")


@dataclass(frozen=True)
class OutputOptions:
    """The folder of the run.

    Attributes:
        sheet_every: steps between contact sheets (renderings above what the prior sees in them); 0 makes none.
        resume: go on from the checkpoint in the output folder.
        overwrite: the run in the output folder may be lost.
    """

    sheet_every: int = 500
    resume: bool = False
    overwrite: bool = False

    def __post_init__(self) -> None:
        if self.sheet_every < 0:
            raise ValueError("sheet_every must not be negative; 0 makes no contact sheets")


Subject = TypeVar("Subject", bound=Phrase | Picture, covariant=True)


@dataclass(frozen=True)
class RunSpec(Generic[Subject]):
    """A run, as its user describes it.

    Attributes:
        subject: What to draw.
        prior: Which prior looks at the sketch, and where it computes.
        score: How the prior moves the sketch.
        strokes: Which strokes the sketch starts with, and which it loses.
        cameras: From where the prior looks, and at what images.
        descent: The gradient descent.
        output: The folder of the run.
        page: That the views of sketch.svg and preview.png lie on.
    """

    subject: Subject
    prior: PriorOptions = field(default_factory=PriorOptions)
    score: ScoreOptions = field(default_factory=ScoreOptions)
    strokes: StrokeOptions = field(default_factory=StrokeOptions)
    cameras: CameraOptions = field(default_factory=CameraOptions)
    descent: DescentOptions = field(default_factory=DescentOptions)
    output: OutputOptions = field(default_factory=OutputOptions)
    page: PageOptions = NO_PAGE

    def __post_init__(self) -> None:
        self.page.check_previews()
        width, (least, most) = self.strokes.width, self.strokes.width_range
        if "width" in self.descent.optimize and width is not None and not least <= width <= most:
            raise ValueError(f"width must lie in width_range {self.strokes.width_range}, got {width}: give another one")

    @property
    def redraws(self) -> bool:
        """Whether the end may replace strokes: not those of the user, nor where widths are chosen or optimised."""
        own = self.strokes.start is None and self.width_is_free
        return own and self.descent.redraw and "position" in self.descent.optimize

    @property
    def width_is_free(self) -> bool:
        """Whether the user leaves the widths of the results to the command."""
        return self.strokes.width is None and "width" not in self.descent.optimize

    def width(self, default: float) -> float:
        """The width of the strokes at the start, as a fraction of the image height.

        Raises:
            ValueError: widths are optimised, and the default is none that they may have.
        """
        width, (least, most) = self.strokes.width or default, self.strokes.width_range
        if "width" in self.descent.optimize and not least <= width <= most:
            said = f"strokes start with width {width}, outside width_range {least} to {most}"
            raise ValueError(f"{said}: give another one")
        return width

    def values(self, default: PresetName) -> Preset:
        """The values of the preset, except where options are given.

        Args:
            default: the preset where the options name none.
        """
        options = self.options()
        given = {f.name: options[f.name] for f in fields(Preset) if options[f.name] is not None}
        return replace(PRESETS[self.descent.preset or default], **given)

    def recipe(self, group: int, default: PresetName) -> Recipe:
        """The recipe by which the prior moves the sketch.

        Args:
            group: views that the prior sees at once.
            default: the preset where the options name none.
        """
        return self.score.recipe(group, self.values(default).guidance or self.subject.GUIDANCE)

    def work(self) -> Work:
        """The work of the prior in a step, as far as its memory goes."""
        return Work(self.cameras.batch, conditions(self.score.method or "sds"), self.score.method == "vsd")

    def check_built_in(self) -> None:
        """Raises ValueError for what the priors that are built in cannot do."""
        if self.score.method == "vsd":
            raise ValueError("vsd trains a network of diffusers, and the built-in priors have none: leave --method out")

    def options(self) -> dict[str, Any]:
        """All options by name, as the user gave them, but for those of the subject and the prior."""
        groups = (self.score, self.strokes, self.cameras, self.descent, self.output, self.page)
        return {name: value for group in groups for name, value in option_values(group).items()}


# Of a phrase or a picture.
AnyRun = RunSpec[Phrase | Picture]


def _require_positive(options: object, *names: str) -> None:
    for name in names:
        value = getattr(options, name)
        if value is not None and not value > 0:
            raise ValueError(f"{name} must be positive, got {value}")


def _require_not_negative(options: object, *names: str) -> None:
    for name in names:
        value = getattr(options, name)
        if value is not None and not value >= 0:
            raise ValueError(f"{name} must not be negative, got {value}")
