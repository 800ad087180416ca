"""Pictures by the user's Blender, in a process of its own."""

import importlib.util
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from diff3ds._files import write_bytes
from diff3ds.camera import Cameras
from diff3ds.formats.scenes.blender import FRAMES, blender_script
from diff3ds.sketch import Sketch
from diff3ds.tasks.render.render_options import OrbitOptions, PictureOptions

# Of what Blender says when it fails, the last part tells why.
TOLD = 2000


def draw_in_blender(file: Path, sketch: Sketch, cameras: Cameras, view: OrbitOptions, picture: PictureOptions) -> None:
    """Draws the first view as a PNG file, or a turn from there as MP4; whole or not at all.

    Raises:
        ImportError: there is no Blender; says where to get one.
        OSError: Blender failed, with the end of what it said; the file cannot be written.
    """
    command = _command()
    height, width = cameras.size
    with tempfile.TemporaryDirectory() as folder:
        script, drawn = Path(folder) / "scene.py", Path(folder) / f"drawn{file.suffix.lower()}"
        turn = ["--turntable"] if picture.turntable else []
        text = blender_script(sketch, cameras, view.fov, picture.turntable or FRAMES, picture.fps)
        script.write_text(text, encoding="utf-8")
        rest = [str(script), "--", str(drawn), str(width), str(height), *turn]
        done = subprocess.run([*command, *rest], capture_output=True, text=True, errors="replace", check=False)
        if done.returncode or not drawn.exists():
            raise OSError(f"Blender drew nothing; the end of what it said: {(done.stdout + done.stderr)[-TOLD:]}")
        write_bytes(file, drawn.read_bytes())


def _command() -> list[str]:
    """What runs a script in Blender."""
    if blender := shutil.which("blender"):
        return [blender, "--background", "--factory-startup", "--python-exit-code", "1", "--python"]
    if importlib.util.find_spec("bpy"):
        return [sys.executable]
    raise ImportError(
        "Blender was not found: install it (blender.org) so that `blender` is on the PATH, or `pip install bpy` for "
        "this Python; or write a script for another machine: diff3ds export SKETCH scene.py"
    )
