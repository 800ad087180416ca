"""Blender as a Python module (bpy), in environments of its own: 350 MB each, made once under build/."""

import fcntl
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from waiting import PATIENCE

# Both ask for Python 3.11: the last with data blocks called as before 5.0, and the first ones after.
VERSIONS = ("4.5.0", "5.0.1")
BUILD = Path(__file__).parents[2] / "build"


def made(version: str, folder: Path) -> str:
    """Makes an environment with this version; says why there is none, or nothing."""
    python = shutil.which("python3.11")
    if python is None:
        return "there is no python3.11, for which bpy is published"
    subprocess.run([python, "-m", "venv", folder], check=True, capture_output=True)
    wanted = [folder / "bin" / "python", "-m", "pip", "install", "-q", f"bpy=={version}", "numpy"]
    done = subprocess.run(wanted, capture_output=True, text=True, check=False)
    return "" if done.returncode == 0 else f"bpy {version} could not be installed: {done.stderr.strip()[-200:]}"


@pytest.fixture(scope="session", params=VERSIONS)
def blender(request) -> Callable[..., str]:
    """Runs a script with arguments in this version of Blender; gives what it says. DIFF3DS_BPY: a folder of both."""
    folder = Path(os.environ.get("DIFF3DS_BPY", BUILD)) / f"bpy-{request.param}"
    python = folder / "bin" / "python"
    folder.parent.mkdir(exist_ok=True)
    with Path(f"{folder}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "whole").exists():
            shutil.rmtree(folder, ignore_errors=True)
            if lacking := made(request.param, folder):
                shutil.rmtree(folder, ignore_errors=True)
                pytest.skip(lacking)
            (folder / "whole").touch()

    def run(script: Path | str, *arguments: Path | str) -> str:
        # Nothing of this process's Python but the path.
        quiet = {"PATH": os.environ["PATH"], "HOME": os.environ.get("HOME", "/")}
        command = [python, script, *arguments]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env=quiet, timeout=PATIENCE)
        assert done.returncode == 0, (done.stdout + done.stderr)[-4000:]
        return done.stdout

    return run
