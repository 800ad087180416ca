"""How scripts that import pydiffvg reach this package: by a function, by a command, by a distribution."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from diff3ds.pydiffvg.__main__ import main

ROOT = Path(__file__).parents[2]
SCRIPT = """
import sys
import pydiffvg, torch, beside
from pydiffvg import Path
import diffvg
if __name__ == "__main__":
    assert pydiffvg.__name__ == "diff3ds.pydiffvg", pydiffvg
    assert pydiffvg.device == pydiffvg.get_device()
    pydiffvg.set_device(torch.device("cpu"))
    pydiffvg.render_pytorch.print_timing = False
    assert pydiffvg.use_gpu is False
    assert pydiffvg.PixelFilter(type=diffvg.FilterType.box).radius == 0.5
    print(sys.argv[1:], sys.argv[0], beside.HERE)
"""


@pytest.fixture
def script(tmp_path):
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "main.py").write_text(SCRIPT)
    (tmp_path / "inner" / "beside.py").write_text("HERE = 'beside'")
    return tmp_path


def run(folder, *arguments, **environment):
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    return done.returncode, done.stdout.strip(), done.stderr


@pytest.mark.slow
def test_a_module_that_is_not_touched(script):
    code, said, error = run(script / "inner", "-m", "diff3ds.pydiffvg", "-m", "main", "7")
    assert code == 0, error
    assert said.startswith("['7']")
    assert said.endswith("beside")


def test_a_script_that_is_not_touched(script, monkeypatch):
    code, said, error = run(script, "-m", "diff3ds.pydiffvg", "inner/main.py", "--its", "args")
    assert code == 0, error
    assert said == "['--its', 'args'] inner/main.py beside"
    with monkeypatch.context() as patch:
        patch.setattr(sys, "argv", ["diff3ds.pydiffvg", "none.py"])
        patch.setattr("diff3ds.pydiffvg.__main__.install", lambda: None)
        with pytest.raises(SystemExit, match=r"^python -m diff3ds\.pydiffvg: there is no script none\.py$"):
            main()


def test_the_distribution_gives_the_name(script):
    code, said, error = run(script, "inner/main.py", PYTHONPATH=str(ROOT / "drop_in"))
    assert code == 0, error
    assert said == "[] inner/main.py beside"
    project = tomllib.loads((ROOT / "drop_in" / "pyproject.toml").read_text())
    assert project["project"]["dependencies"] == ["diff3ds"]
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"]["only-include"] == ["pydiffvg.py"]
    assert "Tzu-Mao Li" in (ROOT / "drop_in" / "README.md").read_text()


def test_gpus_that_are_not_there(monkeypatch):
    import torch

    import diff3ds.pydiffvg as pydiffvg
    from diff3ds.pydiffvg import settings

    monkeypatch.setattr(settings, "device", torch.device("cpu"))
    monkeypatch.setattr(settings, "use_gpu", False)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    with pytest.warns(UserWarning, match="there is no device cuda:1: the CPU draws"):
        pydiffvg.set_device(torch.device("cuda:1"))
    assert pydiffvg.device == torch.device("cpu")
    pydiffvg.set_device("cuda")
    assert (pydiffvg.get_device().type, pydiffvg.get_use_gpu()) == ("cuda", True)
    pydiffvg.set_use_gpu(False)
    assert pydiffvg.device.type == "cpu"


def test_pictures_are_written(tmp_path):
    import torch
    from PIL import Image

    import diff3ds.pydiffvg as pydiffvg

    picture = torch.tensor([[[0.25, 1.5, -1.0, 0.5]]], requires_grad=True)
    pydiffvg.imwrite(picture, str(tmp_path / "a" / "one.png"), gamma=2.0)
    assert Image.open(tmp_path / "a" / "one.png").getpixel((0, 0)) == (127, 255, 0, 127)
    pydiffvg.imwrite(torch.tensor([[2.0, 4.0]]).numpy(), tmp_path / "two.png", gamma=1.0, normalize=True)
    assert [Image.open(tmp_path / "two.png").getpixel((x, 0)) for x in (0, 1)] == [0, 255]
    for wrong in (torch.zeros(2, 2, 2), torch.zeros(3), torch.full((2, 2), float("nan"))):
        with pytest.raises(ValueError, match="img must"):
            pydiffvg.imwrite(wrong, tmp_path / "none.png")
    with pytest.raises(ValueError, match=r"none\.jpg: cannot write mode RGBA as JPEG: write PNG"):
        pydiffvg.imwrite(torch.zeros(2, 2, 4), tmp_path / "none.jpg")
    with pytest.raises(ValueError, match=r"none\.abc: unknown file extension"):
        pydiffvg.imwrite(torch.zeros(2, 2, 4), tmp_path / "none.abc")
    assert not list(tmp_path.glob("none*"))
