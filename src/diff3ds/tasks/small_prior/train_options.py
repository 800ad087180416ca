"""Options of `diff3ds prior train`."""

from dataclasses import dataclass
from pathlib import Path

from diff3ds.guidance.built_in.small_shape import Shape
from diff3ds.tasks.exact_prior.up_axis import Up


@dataclass(frozen=True)
class TrainOptions:
    """Options of `diff3ds prior train`.

    Attributes:
        library: a folder of sketches or meshes to train on instead of the built-in library; files are named after what
            they are: chair_01.json, or chair/01.json.
        up: of a library's meshes, the axis that points up: z or y. glTF defines it.
        steps: gradient steps. May be changed when a run is resumed, not to fewer than are done.
        batch: objects a step, each seen by four cameras.
        rate: highest learning rate.
        depth: blocks of the network.
        width: of the network's tokens.
        patch: side of a patch, pixels.
        device: auto (the first of cuda, mps, cpu), cpu, cuda, cuda:1, mps.
        threads: of the network on a CPU, of which a quarter of the batch have work; by default as many as there are
            cores. The result does not depend on it.
        workers: processes that draw the examples ahead; the result does not depend on it.
        checkpoint_every: steps between checkpoints and sheets of samples.
        seed: of everything.
        resume: go on from the checkpoint in the output folder.
        overwrite: the run in the output folder may be lost.
    """

    library: Path | None = None
    up: Up = "z"
    steps: int = 6000
    batch: int = 16
    rate: float = 0.005
    depth: int = Shape.depth
    width: int = Shape.width
    patch: int = Shape.patch
    device: str = "auto"
    threads: int | None = None
    workers: int = 1
    checkpoint_every: int = 250
    seed: int = 0
    resume: bool = False
    overwrite: bool = False

    def __post_init__(self) -> None:
        for name in ("steps", "batch", "threads", "checkpoint_every"):
            if getattr(self, name) is not None and getattr(self, name) < 1:
                raise ValueError(f"{name} must be positive, got {getattr(self, name)}")
        if self.workers < 0 or self.seed < 0:
            raise ValueError("workers and seed must not be negative")
        if not 0 < self.rate < 1:
            raise ValueError(f"rate must lie in (0, 1), got {self.rate}")
        self.shape(1)

    def shape(self, words: int) -> Shape:
        """The shape of the network, for so many words."""
        return Shape(words, patch=self.patch, width=self.width, depth=self.depth)
