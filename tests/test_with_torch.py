"""Sketches, cameras and renderings in torch's own files, copies and loaders."""

import copy
import io
import pickle
import subprocess
import sys
from dataclasses import fields

import pytest
import torch
from torch.utils.data import DataLoader, Dataset

from diff3ds import Cameras, Chains, Sketch, orbit, project, render, render_batch


def chained() -> Sketch:
    """One closed stroke of two segments, marked, with widths along it."""
    points = torch.tensor([[[0.0, 0, 0], [0, 0, 1]], [[0.0, 0, 1], [0, 0, 0]]], dtype=torch.float64)
    width = torch.tensor([[0.1, 0.2], [0.2, 0.1]], dtype=torch.float64)
    chains = Chains.of([2], [True])
    return Sketch(points, width=width, width_space="world", chains=chains, fixed=torch.tensor([True]))


CAMERAS = orbit([10.0, 80.0], height=2.0, size=(8, 12), near=0.5)
MADE = {
    "sketch": chained,
    "plain sketch": lambda: Sketch(torch.rand(3, 4, 3)),
    "cameras": lambda: CAMERAS,
    "chains": lambda: Chains.of([2, 1], [True, False]),
    "rendering": lambda: render(chained(), CAMERAS.to(torch.float64)),
    "strokes": lambda: project(chained(), orbit(0, size=8)),
}
WAYS = {
    "torch.load": lambda value: torch.load(io.BytesIO(saved(value)), weights_only=True),
    "pickle": lambda value: pickle.loads(pickle.dumps(value)),
    "deepcopy": copy.deepcopy,
}


def saved(value: object) -> bytes:
    file = io.BytesIO()
    torch.save(value, file)
    return file.getvalue()


def assert_same(one: object, other: object) -> None:
    assert type(one) is type(other)
    for field in fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, torch.Tensor):
            assert a.dtype == b.dtype
            assert torch.equal(a, b)
        elif isinstance(a, Chains):
            assert_same(a, b)
        else:
            assert a == b


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", MADE)
def test_what_is_written_and_copied_comes_back(name, way):
    value = MADE[name]()
    found = WAYS[way]({"step": 3, "value": [value]})
    assert found["step"] == 3
    assert_same(found["value"][0], value)


def test_what_was_kept_for_speed_is_not_written():
    cameras = orbit(10.0, size=8)
    before = saved(cameras)
    assert cameras.projection.shape == (1, 4, 4)
    assert saved(cameras) == before
    assert "_kept_projection" not in vars(copy.deepcopy(cameras))


def test_values_of_a_file_are_checked():
    sketch = Sketch(torch.rand(3, 4, 3))
    sketch.opacity.data = torch.full((3,), 2.0)
    with pytest.raises(ValueError, match=r"opacity of stroke 0 must be in \[0, 1\], got 2.0"):
        torch.load(io.BytesIO(saved(sketch)))


@pytest.mark.slow
def test_a_file_is_read_in_another_process(tmp_path):
    torch.save(chained(), tmp_path / "sketch.pt")
    script = (
        "import sys, torch; from diff3ds import Sketch\n"
        "sketch = torch.load(sys.argv[1]); print(len(sketch.points), len(sketch))"
    )
    command = [sys.executable, "-c", script, tmp_path / "sketch.pt"]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "2 1\n"


class Drawings(Dataset):
    """Sketches of one, two and three strokes, cameras with pictures of two sizes, and a number."""

    def __len__(self) -> int:
        return 3

    def __getitem__(self, k: int) -> dict[str, object]:
        return {"sketch": Sketch(torch.rand(k + 1, 2, 3)), "cameras": orbit(10.0 * k, size=(8, 12)[k % 2]), "label": k}


@pytest.mark.parametrize("workers", [0, 1])
def test_a_loader_hands_on_what_a_batch_is_drawn_of(workers):
    (batch,) = DataLoader(Drawings(), batch_size=3, num_workers=workers)
    assert [len(sketch) for sketch in batch["sketch"]] == [1, 2, 3]
    assert torch.equal(batch["label"], torch.arange(3))
    pictures = render_batch(batch["sketch"], batch["cameras"])
    assert [tuple(picture.alpha.shape) for picture in pictures] == [(1, 8, 8), (1, 12, 12), (1, 8, 8)]
    assert len(Sketch.concatenate(batch["sketch"])) == 6
    assert len(Cameras.concatenate(batch["cameras"][::2])) == 2


def test_a_network_that_holds_a_sketch_is_copied_and_written():
    class Strokes(torch.nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.points = torch.nn.Parameter(torch.rand(2, 4, 3))

        def forward(self, cameras: Cameras) -> torch.Tensor:
            return render(Sketch(self.points), cameras).color

    first = Strokes()
    second = copy.deepcopy(first)
    second.load_state_dict(torch.load(io.BytesIO(saved(first.state_dict()))))
    assert torch.equal(first(CAMERAS), second(CAMERAS))
