"""Sixteen strokes that a network sees as a picture: on paper by diff3ds.pydiffvg, then in space by ds.render.

python examples/sixteen_strokes.py [OUTPUT_FOLDER]

Needs `pip install "diff3ds[judges]"`, for a small network that was trained on photographs. The pictures: what is drawn,
the strokes on paper; and in three views what is drawn, the strokes in space.
"""

import sys
from pathlib import Path

import torch

import diff3ds as ds
import diff3ds.pydiffvg as pydiffvg
from diff3ds.formats import save_png, tile_images
from diff3ds.metrics.imagenet import ImageNetRank

STROKES, STEPS, SIZE = 16, 100, 96
# Blocks of EfficientNet-Lite0 after which the picture is half as large as before.
TAPS = (0, 2, 4, 10)
# px, of the strokes.
WIDTH = 2.0


class Perceptual:
    """How differently a network sees pictures (V, H, W, 3) and what they are to look like."""

    def __init__(self, targets: torch.Tensor) -> None:
        self.network = ImageNetRank().network.requires_grad_(False)
        self.targets = targets
        self.wanted = self.seen(targets)

    def seen(self, pictures: torch.Tensor) -> list[torch.Tensor]:
        """Features of length 1 in every pixel, of several layers."""
        x, found = 2 * pictures.permute(0, 3, 1, 2) - 1, []
        x = self.network._swish(self.network._bn0(self.network._conv_stem(x)))
        for number, block in enumerate(self.network._blocks[: TAPS[-1] + 1]):
            x = block(x)
            if number in TAPS:
                found.append(torch.nn.functional.normalize(x, dim=1))
        return found

    def __call__(self, pictures: torch.Tensor) -> torch.Tensor:
        """The loss, which is 0 for the targets themselves."""
        pairs = zip(self.seen(pictures), self.wanted, strict=True)
        return sum((a - b).square().sum(1).mean() for a, b in pairs) + (pictures - self.targets).square().mean()


def descend(name: str, leaf: torch.Tensor, rate: float, draw, loss: Perceptual) -> torch.Tensor:
    """Moves control points until the pictures of them are seen as the targets are; the last pictures."""
    optimizer = torch.optim.Adam([leaf], lr=rate)
    for step in range(STEPS):
        for group in optimizer.param_groups:
            group["lr"] = rate * (1 - step / STEPS)
        value = loss(draw(leaf))
        optimizer.zero_grad()
        value.backward()
        optimizer.step()
        if step % 25 == 0 or step == STEPS - 1:
            print(f"{name} step {step:3d}  loss {value.item():.4f}")
    return draw(leaf).detach()


def on_paper(points: torch.Tensor) -> torch.Tensor:
    """Strokes (N, 4, 2), in pixels, as a script for DiffVG draws them; white paper."""
    cubic, black = torch.tensor([2]), torch.tensor([0.0, 0.0, 0.0, 1.0])
    shapes = [pydiffvg.Path(cubic, each, is_closed=False, stroke_width=torch.tensor(WIDTH / 2)) for each in points]
    groups = [pydiffvg.ShapeGroup(torch.tensor([k]), None, stroke_color=black) for k in range(len(shapes))]
    scene = pydiffvg.RenderFunction.serialize_scene(SIZE, SIZE, shapes, groups)
    image = pydiffvg.RenderFunction.apply(SIZE, SIZE, 2, 2, 0, None, *scene)
    return (image[..., :3] * image[..., 3:] + 1 - image[..., 3:])[None]


def main(folder: Path) -> None:
    """Fits both and writes the pictures."""
    g = torch.Generator().manual_seed(3)
    thing = ds.library.member("cat", g).sketch.replace(width=WIDTH / SIZE)
    cameras = ds.orbit(azimuth=[0, 45, 90], elevation=10, distance=3.2, fov=40, size=SIZE)
    targets = ds.render(thing, cameras, background=(1.0, 1.0, 1.0)).color

    # On paper: one picture, and strokes that begin around its middle.
    start = torch.rand(STROKES, 1, 2, generator=g) * SIZE / 2 + SIZE / 4
    leaf = (start + torch.randn(STROKES, 4, 2, generator=g) * SIZE / 12).requires_grad_()
    paper = descend("paper", leaf, 1.5, on_paper, Perceptual(targets[:1]))
    save_png(folder / "sixteen_strokes.png", tile_images(torch.cat([targets[:1], paper]), columns=2))

    # In space: the same loss and the same loop; a third coordinate, and one call for all views.
    leaf = ds.Sketch.random(STROKES, generator=g, radius=0.7, extent=0.3).points.clone().requires_grad_()

    def in_space(points: torch.Tensor) -> torch.Tensor:
        return ds.render(ds.Sketch(points, width=WIDTH / SIZE), cameras, background=(1.0, 1.0, 1.0)).color

    space = descend("space", leaf, 0.02, in_space, Perceptual(targets))
    save_png(folder / "sixteen_strokes_3d.png", tile_images(torch.cat([targets, space]), columns=3))


if __name__ == "__main__":
    main(Path(*sys.argv[1:2]))
