"""CPU kernels in float32 against the reference in float64: pictures and gradients of 200 random scenes."""

from collections import Counter
from typing import Any, NamedTuple

import torch
from explain import Cause, explain
from random_scenes import RandomScene, random_scene
from report import say, show

import diff3ds as ds
from diff3ds.render import Backend

# A pixel misses where colour or alpha, or depth relative to itself, differ by more.
TOLERANCE = 1e-4
AIM_PIXELS, AIM_ERROR, AIM_COSINE = 0.999, 1e-3, 0.99999


class Drawn(NamedTuple):
    """A rendering and the tensors it was made of."""

    inputs: dict[str, torch.Tensor]
    image: ds.Rendering

    def gradients(self, upstream: list[torch.Tensor]) -> list[torch.Tensor]:
        """Of every input, float64."""
        images = [self.image.color, self.image.alpha, self.image.depth]
        upstream = [u.to(i.dtype) for u, i in zip(upstream, images, strict=True)]
        found = torch.autograd.grad(images, list(self.inputs.values()), upstream, retain_graph=True)
        return [g.double() for g in found]


class Miss(NamedTuple):
    """A pixel that differs."""

    error: float
    scene: int
    view: int
    y: int
    x: int
    cause: Cause


def draw(scene: RandomScene, backend: Backend, dtype: torch.dtype) -> Drawn:
    """The scene with gradients wanted to all inputs."""
    inputs = {name: value.to(dtype).requires_grad_() for name, value in scene.inputs().items()}
    return Drawn(inputs, scene.replace(inputs).render(backend))


def pixel_errors(ours: ds.Rendering, truth: ds.Rendering) -> tuple[torch.Tensor, torch.Tensor]:
    """Largest difference of colour and alpha, and difference of depth relative to it, (V, H, W)."""
    color = (ours.color - truth.color).abs().amax(-1)
    depth = (ours.depth - truth.depth).abs() / truth.depth.clamp_min(1e-30)
    both = (ours.alpha > 1e-6) & (truth.alpha > 1e-6)
    return torch.maximum(color, (ours.alpha - truth.alpha).abs()).detach(), torch.where(both, depth, 0.0).detach()


# Kinds of comparison of gradients: the images in the loss, and whether pixels that differ are left out.
KINDS = {
    "colour and alpha, all pixels": (True, False),
    "colour and alpha, without the pixels that differ": (True, True),
    "depth, without the pixels that differ": (False, True),
}
# A scene whose gradient is this small next to that of others has none: that of lines to their weights, for example.
NO_GRADIENT = 1e-4


class Pair(NamedTuple):
    """Products of the gradients of reference (a) and kernels (b) to one input, in one scene."""

    aa: float
    ab: float
    bb: float
    error2: float


def compare_gradients(ours: Drawn, truth: Drawn, same: torch.Tensor, kind: str, seed: int) -> dict[str, Pair]:
    """By input, for a random upstream."""
    by_color, only_same = KINDS[kind]
    keep = same if only_same else torch.ones_like(same)
    g = torch.Generator().manual_seed(seed)
    upstream = [torch.randn(i.shape, generator=g).double() for i in (truth.image.color, keep, keep)]
    for u, used in zip(upstream, (by_color, by_color, not by_color), strict=True):
        u *= (keep[..., None] if u.ndim == 4 else keep) & used
    result = {}
    for name, a, b in zip(truth.inputs, truth.gradients(upstream), ours.gradients(upstream), strict=True):
        result[name] = Pair(*(float(p.sum()) for p in (a * a, a * b, b * b, (a - b) ** 2)))
    return result


def run(scenes: int) -> dict[str, Any]:
    """Compares, prints and returns the figures."""
    misses: list[Miss] = []
    ink = missed_depth = 0
    gradients: dict[str, list[dict[str, Pair]]] = {kind: [] for kind in KINDS}
    for seed in range(scenes):
        scene = random_scene(seed)
        ours, truth = draw(scene, "cpu", torch.float32), draw(scene, "reference", torch.float64)
        error, depth_error = pixel_errors(ours.image, truth.image)
        ink += int(((truth.image.alpha > 0) | (ours.image.alpha > 0)).sum())
        missed_depth += int((depth_error > TOLERANCE).sum())
        for view, y, x in (error > TOLERANCE).nonzero().tolist():
            size = float(error[view, y, x])
            cause = explain(scene.to(torch.float64), view, (x + 0.5, y + 0.5), size)
            misses.append(Miss(size, seed, view, y, x, cause))
        same = (error <= TOLERANCE) & (depth_error <= TOLERANCE)
        for kind, values in gradients.items():
            values.append(compare_gradients(ours, truth, same, kind, seed))
    figures = {"scenes": scenes, **_show_pixels(ink, missed_depth, misses)}
    return {**figures, "gradients": {kind: _show_gradients(kind, values) for kind, values in gradients.items()}}


def _show_pixels(ink: int, missed_depth: int, misses: list[Miss]) -> dict[str, Any]:
    share, depth_share = 1 - len(misses) / ink, 1 - missed_depth / ink
    say("Kernels (float32) against the reference (float64) on random scenes")
    say(f"{ink:,} pixels with ink; colour and alpha within {TOLERANCE:g} in {share:.4%}, depth in {depth_share:.4%}")
    say(f"aim {AIM_PIXELS:.1%}: {'met' if share >= AIM_PIXELS else 'NOT MET'}")
    causes = Counter(m.cause.kind for m in misses)
    show("Causes of the misses", ["", "pixels"], causes.most_common())
    worst = sorted(misses, reverse=True)[:5]
    rows = [[m.error, m.scene, m.view, f"{m.x}, {m.y}", m.cause.kind, m.cause.detail] for m in worst]
    show("Worst pixels", ["error", "scene", "view", "x, y", "cause", ""], rows)
    listed = [m._asdict() | {"cause": m.cause._asdict()} for m in worst]
    return {"ink": ink, "within": share, "depth_within": depth_share, "causes": causes, "worst": listed}


def _show_gradients(kind: str, scenes: list[dict[str, Pair]]) -> dict[str, Any]:
    columns = ["", "scenes", "pooled: error", "cosine", "met", "scenes: median error", "95 %", "worst", "within aim"]
    rows, result = [], {}
    for name in scenes[0]:
        pairs = torch.tensor([s[name] for s in scenes], dtype=torch.float64)
        pairs = pairs[pairs[:, 0] > NO_GRADIENT**2 * pairs[:, 0].max()]
        if len(pairs) == 0:
            continue
        aa, ab, bb, error2 = torch.cat([pairs.sum(0, keepdim=True), pairs]).unbind(1)
        errors, cosines = (error2 / aa).sqrt(), ab / (aa * bb).sqrt()
        good = (errors <= AIM_ERROR) & (cosines >= AIM_COSINE)
        spread = errors[1:].quantile(torch.tensor([0.5, 0.95, 1.0]).double()).tolist()
        within = float(good[1:].double().mean())
        values = [f"{errors[0]:.1e}", f"{cosines[0]:.8f}", "yes" if good[0] else "NO", *(f"{v:.1e}" for v in spread)]
        rows.append([name, len(pairs), *values, f"{within:.1%}"])
        result[name] = {"error": float(errors[0]), "cosine": float(cosines[0]), "scenes": [*spread, within]}
    show(f"Relative error of the kernels' gradients: {kind}", columns, rows)
    return result
