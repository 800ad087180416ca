"""Gradients of the reference against finite differences of the reference, float64, along random directions.

The box filter makes coverage bend where the edge of a stroke passes the edge of a pixel, and depth jumps where the
nearest point does. A direction that meets such a place within its step is found by its one-sided differences, which
disagree there, and is counted apart.
"""

from typing import Any

import torch
from random_scenes import RandomScene, random_scene
from report import say, show

# Steps move strokes by about this many pixels. The best depends on what is near: the one whose one-sided differences
# agree best is taken. (Nearest points are found to some 1e-11, which the shortest step magnifies.)
STEPS = (1e-5, 1e-6, 1e-7)
# Pixels of motion a unit of each input makes, roughly: scenes are 64 px high, some 3 units high.
PIXELS = {"points": 20.0, "weights": 5.0, "world_to_camera": 20.0, "intrinsics": 1.0, "width": 40.0}
# One-sided differences that disagree by more at every step, relative to the larger, met a bend.
BEND = 1e-4
# Largest error of the central difference where nothing bends (empirical): rounding of depth reaches some 3e-4 at the
# shortest step; of colour and alpha 1e-4.
AIM = 1e-3
# Derivatives are sums over some 1,000 pixels, of about 100; errors are relative to no less than this (empirical).
LEAST = 1.0
OUTPUTS = ("color", "alpha", "depth")


def losses(scene: RandomScene, seed: int) -> torch.Tensor:
    """One number for each output: its product with a random upstream."""
    image = scene.render("reference")
    g = torch.Generator().manual_seed(seed)
    values = [getattr(image, name) for name in OUTPUTS]
    return torch.stack([(v * torch.randn(v.shape, generator=g)).sum() for v in values])


def compare(scene: RandomScene, seed: int, directions: int) -> list[tuple[str, str, float, float]]:
    """Rows (output, input, bend, error): disagreement of one-sided differences, error of the derivative."""
    inputs = {name: value.requires_grad_() for name, value in scene.inputs().items()}
    found = losses(scene.replace(inputs), seed)
    gradients = [
        torch.autograd.grad(loss, list(inputs.values()), retain_graph=True, materialize_grads=True) for loss in found
    ]
    g = torch.Generator().manual_seed(seed)
    rows = []
    for i, (name, value) in enumerate(inputs.items()):
        for _ in range(directions):
            direction = moving(name, value.detach(), g)
            slopes, bends = differences(scene, name, direction, found.detach(), seed)
            truth = torch.stack([(gradient[i] * direction).sum() for gradient in gradients])
            errors = (slopes - truth).abs() / slopes.abs().clamp_min(LEAST)
            rows += [(o, name, float(b), float(e)) for o, b, e in zip(OUTPUTS, bends, errors, strict=True)]
    return rows


def differences(
    scene: RandomScene, name: str, direction: torch.Tensor, middle: torch.Tensor, seed: int
) -> tuple[torch.Tensor, torch.Tensor]:
    """Central differences of the losses, and by how much the one-sided ones disagree, at the best step for each."""
    slopes, bends = [], []
    for step in (s / PIXELS.get(name, 1.0) for s in STEPS):
        ahead, behind = (shifted(scene, name, sign * step * direction, seed) for sign in (1, -1))
        slopes.append((ahead - behind) / (2 * step))
        one, other = (ahead - middle) / step, (middle - behind) / step
        bends.append((one - other).abs() / torch.maximum(one.abs(), other.abs()).clamp_min(LEAST))
    least, which = torch.stack(bends).min(0)
    return torch.stack(slopes).gather(0, which[None])[0], least


def moving(name: str, value: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """A random direction: relative for weights, zero for the entries of matrices that are constants."""
    direction = torch.randn(value.shape, generator=generator, dtype=torch.float64)
    if name in ("world_to_camera", "intrinsics"):
        direction[:, -1] = 0
    return direction * value if name == "weights" else direction


@torch.no_grad()
def shifted(scene: RandomScene, name: str, change: torch.Tensor, seed: int) -> torch.Tensor:
    """Losses of the scene with one input changed."""
    inputs = scene.inputs()
    return losses(scene.replace({**inputs, name: inputs[name] + change}), seed)


def run(scenes: int, directions: int) -> dict[str, Any]:
    """Compares, prints and returns the figures."""
    rows = []
    for seed in range(scenes):
        scene = random_scene(seed, sides=(32, 48), strokes=8).to(torch.float64)
        rows += compare(scene, seed, directions)
    say(f"Reference against its finite differences, {scenes} scenes, {directions} directions an input")
    result, table = {}, []
    for output in OUTPUTS:
        for name in dict.fromkeys(r[1] for r in rows):
            chosen = [(bend, error) for o, n, bend, error in rows if (o, n) == (output, name)]
            if not chosen:
                continue
            smooth = torch.tensor([error for bend, error in chosen if bend <= BEND])
            bent = len(chosen) - len(smooth)
            worst = float(smooth.max()) if len(smooth) else 0.0
            median = float(smooth.median()) if len(smooth) else 0.0
            result[f"{output} / {name}"] = {"directions": len(chosen), "bent": bent, "median": median, "worst": worst}
            met = "yes" if worst <= AIM else "NO"
            table.append([f"{output} / {name}", len(chosen), bent, f"{median:.1e}", f"{worst:.1e}", met])
    show(
        "Derivatives along directions", ["", "directions", "met a bend", "others: median error", "worst", "met"], table
    )
    return result
