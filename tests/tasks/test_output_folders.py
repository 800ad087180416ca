"""A file where a command is to make its folder: said in a sentence, and left as it is."""

import json

import pytest
import torch

import diff3ds as ds
from diff3ds.cli import main
from diff3ds.formats import save_png
from diff3ds.library import member


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A file of jobs, two folders of a run each, and a folder with cameras."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "jobs.jsonl").write_text(json.dumps({"command": "text", "phrase": "a chair", "prior": "exemplar"}))
    sketch = ds.Sketch(torch.tensor([[[0.0, -0.5, 0], [0, 0.5, 0]]]), width=0.2)
    for method in ("a", "b"):
        ds.save(folder / method / "cat" / "sketch.json", sketch)
        (folder / method / "cat" / "run.json").write_text(json.dumps({"options": {"phrase": "a cat"}}))
    cameras = ds.orbit([0.0, 90.0], size=16)
    pictures = [f"{view}.png" for view in range(2)]
    for view, name in enumerate(pictures):
        save_png(folder / "scene" / name, ds.render(sketch, cameras[view]).color[0])
    mug = member("mug", torch.Generator().manual_seed(5)).sketch
    save_png(folder / "mug.png", ds.render(mug, ds.orbit(40, 20, 1.9, size=96)).color[0])
    ds.save_transforms(folder / "scene" / "transforms.json", cameras, pictures)
    return folder


@pytest.mark.parametrize("below", ["", "below"])
@pytest.mark.parametrize(
    "words",
    [
        "batch {0}/jobs.jsonl",
        "eval {0}/a",
        "study make a={0}/a b={0}/b",
        "cameras {0}/scene",
        "views {0}/scene --resume",
        "image {0}/mug.png --guess",
    ],
)
def test_a_file_is_no_folder_for_results(inputs, words, below, tmp_path, capsys):
    file = tmp_path / "file"
    file.write_text("kept")
    with pytest.raises(SystemExit):
        main([*words.format(inputs).split(), "-o", str(file / below)])
    message = " ".join(capsys.readouterr().err.split())
    assert f"{file} is a file, not a folder for results: give another -o" in message
    assert file.read_text() == "kept"
