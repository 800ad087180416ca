"""What a sketch looks like: a classifier of line drawings, trained on members of the library of other seeds.

    python benchmarks/classifier.py FILE [--steps N]

Sees ink of 64 x 64 pixels from cameras all around; a sketch's category is the one that is likeliest over 8 views.
Training members have seeds that no run of the benchmarks has; strokes differ in width, are jittered, and some are left
out, so that it knows drawings that are not perfect. Says how often it is right on members that it has not seen.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file
from torch import nn

import diff3ds as ds
from diff3ds.guidance.built_in.small import ink
from diff3ds.guidance.orbits import Orbits
from diff3ds.library import CATEGORIES, member

SIZE, VIEWS, WIDTHS = 64, 8, (0.015, 0.05)
# Elevation and distance from which results are looked at; width of their strokes.
ELEVATION, DISTANCE, WIDTH = 15.0, 1.9, 0.03
# Seeds of members to train and to test on; commands take seeds from 0.
TRAIN_SEEDS, TEST_SEEDS = 1_000_000, 2_000_000
JITTER, LEFT_OUT = 0.04, 0.3
BATCH, STEPS, RATE = 32, 1200, 4e-3


class Classifier(nn.Sequential):
    """Logits of one view: a convolutional network of .5 M parameters.

    Attributes:
        kinds: names of the categories that it tells apart, in the order of its answers.
    """

    kinds: tuple[str, ...]


def network(kinds: Sequence[str]) -> Classifier:
    """One that is not trained."""
    layers: list[nn.Module] = []
    before = 1
    for channels, size in ((32, 5), (64, 3), (128, 3)):
        layers += [nn.Conv2d(before, channels, size, stride=2, padding=size // 2, bias=False)]
        layers += [nn.BatchNorm2d(channels), nn.ReLU()]
        before = channels
    layers += [nn.Conv2d(before, 256, 3, padding=1, bias=False), nn.BatchNorm2d(256), nn.ReLU()]
    made = Classifier(*layers, nn.AdaptiveMaxPool2d(1), nn.Flatten(), nn.Linear(256, len(kinds)))
    made.kinds = tuple(kinds)
    return made


def looks(sketch: ds.Sketch, width: float = WIDTH) -> torch.Tensor:
    """Ink (8, 1, 64, 64) of a sketch from all around."""
    cameras = ds.orbit([360 * i / VIEWS for i in range(VIEWS)], ELEVATION, DISTANCE, size=SIZE)
    with torch.no_grad():
        return ink(ds.render(replace(sketch, width=torch.full_like(sketch.width, width)), cameras).color)


def recognised(classifier: Classifier, sketch: ds.Sketch) -> list[str]:
    """Categories of a sketch, the likeliest first: by the mean of the logarithms over its views."""
    with torch.no_grad():
        order = classifier(looks(sketch)).log_softmax(1).mean(0).argsort(descending=True)
    return [classifier.kinds[int(i)] for i in order]


def example(index: int) -> tuple[torch.Tensor, int]:
    """Four views of a member, and which category it is."""
    (mixed,) = np.random.SeedSequence([TRAIN_SEEDS, index]).generate_state(1)
    generator = torch.Generator().manual_seed(int(mixed))
    label = int(torch.randint(len(CATEGORIES), (), generator=generator))
    name = list(CATEGORIES)[label]
    kinds = CATEGORIES[name].combinations()
    sketch = member(name, generator, kinds[int(torch.randint(len(kinds), (), generator=generator))]).sketch
    shake, drop, thick = torch.rand(3, generator=generator).tolist()
    moved = JITTER * shake * torch.randn(sketch.points.shape, generator=generator)
    width = WIDTHS[0] + (WIDTHS[1] - WIDTHS[0]) * thick
    sketch = replace(sketch, points=sketch.points + moved, width=torch.full_like(sketch.width, width))
    kept = torch.rand(len(sketch), generator=generator) >= LEFT_OUT * max(0.0, 2 * drop - 1)
    sketch = sketch[kept if bool(kept.any()) else slice(None)]
    with torch.no_grad():
        seen = ink(ds.render(sketch, Orbits(4, 1, SIZE)(0, generator)).color)
    return seen, label


def train(path: Path, steps: int) -> Classifier:
    """Trains a classifier and writes it."""
    torch.manual_seed(0)
    classifier = network(tuple(CATEGORIES))
    classifier.to(memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(classifier.parameters(), RATE, weight_decay=0.01)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, RATE, steps)
    begun, right = time.perf_counter(), []
    for step in range(steps):
        drawn = [example(step * BATCH + i) for i in range(BATCH)]
        seen = torch.cat([views for views, _ in drawn]).contiguous(memory_format=torch.channels_last)
        labels = torch.tensor([label for _, label in drawn]).repeat_interleave(4)
        found = classifier(seen)
        loss = nn.functional.cross_entropy(found, labels, label_smoothing=0.1)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        right.append(float((found.argmax(1) == labels).float().mean()))
        if step % 100 == 99:
            share = sum(right[-100:]) / 100
            print(f"step {step + 1}: {share:.1%} of views right, {time.perf_counter() - begun:.0f} s", file=sys.stderr)
    state = {name: value.contiguous() for name, value in classifier.state_dict().items()}
    save_file(state, path, {"kinds": json.dumps(classifier.kinds)})
    classifier.eval()
    return classifier


def load(path: Path) -> Classifier:
    """A classifier that was trained, on the kinds that there were."""
    with safe_open(path, "pt") as file:
        classifier = network(json.loads(file.metadata()["kinds"]))
    classifier.load_state_dict(load_file(path))
    classifier.eval()
    return classifier


def held_out(classifier: Classifier, each: int = 10) -> float:
    """Share of members of unseen seeds, with any attributes, that it names rightly."""
    generator = torch.Generator().manual_seed(TEST_SEEDS)
    right = 0
    for name in classifier.kinds:
        kinds = CATEGORIES[name].combinations()
        for _ in range(each):
            chosen = kinds[int(torch.randint(len(kinds), (), generator=generator))]
            right += recognised(classifier, member(name, generator, chosen).sketch)[0] == name
    return right / each / len(classifier.kinds)


def main() -> None:
    """Trains one and tests it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--steps", type=int, default=STEPS)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    ds.set_num_threads(1)
    print(f"{held_out(train(chosen.file, chosen.steps)):.1%} of unseen members are named rightly")


if __name__ == "__main__":
    main()
