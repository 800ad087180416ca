"""What DiffVG draws of the scenes in tests/pydiffvg/diffvg_scenes.py, and its gradients, as small arrays for the tests.

    python benchmarks/diffvg_truth.py [FOLDER]

A build of DiffVG (https://github.com/BachiLi/diffvg; DIFFVG_CUDA=0 will do) must be what `import pydiffvg` gives.
As published it crashes on strokes of gradient colours: where its scene sets the stroke colours of a group for each kind
of gradient, the second of two equal lines must set that of the gradients.
Writes diffvg_pictures.npz and diffvg_gradients.npz to the folder, else to tests/pydiffvg.
"""

import argparse
import itertools
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pydiffvg
import torch

TESTS = Path(__file__).parents[1] / "tests" / "pydiffvg"
sys.path.append(str(TESTS))
from diffvg_scenes import SCENES, draw, scene  # noqa: E402
from scene_gradients import DIFFERENCE_SCENES, GRADIENT_SCENES, gradients, leaves, measured  # noqa: E402

SAMPLES, PICTURE_SEEDS, GRADIENT_SEEDS = 16, 8, 50
# px. A step in which the noise of samples is a hundredth, and the picture's curvature too.
STEP = 0.2
# Pixels that no edge crosses come out alike from all seeds, but for the slope of a gradient's colours within a sample.
ALIKE = 2e-4


def pictures() -> Iterator[tuple[str, Any]]:
    """Of each scene the mean over seeds, and which pixels no edge crosses."""
    for name in SCENES:
        made = scene(pydiffvg, name)
        drawn = torch.stack([draw(pydiffvg, made, SAMPLES, seed) for seed in range(PICTURE_SEEDS)])
        inside = (drawn.amax(0) - drawn.amin(0)).amax(-1) < ALIKE
        yield f"{name}: picture", drawn.mean(0).numpy().astype(np.float16)
        yield f"{name}: inside", np.packbits(inside.numpy())


def gradients_by_seed() -> Iterator[tuple[str, Any]]:
    """Of each leaf of a scene the mean over seeds, and the standard error of this mean."""
    for name in GRADIENT_SCENES:
        seeds = [gradients(pydiffvg, name, SAMPLES, seed) for seed in range(GRADIENT_SEEDS)]
        for leaf in seeds[0]:
            values = torch.stack([one[leaf] for one in seeds])
            yield f"{name}: {leaf}: mean", values.mean(0).numpy()
            yield f"{name}: {leaf}: error", (values.std(0) / GRADIENT_SEEDS**0.5).numpy()


def differences() -> Iterator[tuple[str, Any]]:
    """Central differences of what is measured by each coordinate of points and each width, in the mean over seeds."""
    for name in DIFFERENCE_SCENES:
        for leaf, value in leaves(scene(pydiffvg, name)).items():
            if leaf.endswith(("points", "stroke_width")):
                found = [_difference(name, leaf, place) for place in range(value.numel())]
                yield f"{name}: {leaf}: difference", np.array(found, dtype=np.float32).reshape(tuple(value.shape))


def _difference(name: str, leaf: str, place: int) -> float:
    sums = []
    for step in (STEP, -STEP):
        moved = scene(pydiffvg, name)
        leaves(moved)[leaf].view(-1)[place] += step
        sums.append(sum(measured(pydiffvg, moved, SAMPLES, seed).item() for seed in range(PICTURE_SEEDS)))
    return (sums[0] - sums[1]) / (2 * STEP * PICTURE_SEEDS)


def main() -> None:
    """Writes both files."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=TESTS)
    folder = parser.parse_args().folder
    if "diff3ds" in (pydiffvg.__file__ or ""):
        sys.exit("This needs DiffVG itself: `import pydiffvg` gives the module of diff3ds.")
    pydiffvg.set_use_gpu(False)
    for file, arrays in (
        ("diffvg_pictures.npz", pictures()),
        ("diffvg_gradients.npz", itertools.chain(gradients_by_seed(), differences())),
    ):
        np.savez_compressed(folder / file, **dict(arrays))
        print(f"{folder / file}: {(folder / file).stat().st_size / 1e3:.0f} KB")


if __name__ == "__main__":
    main()
