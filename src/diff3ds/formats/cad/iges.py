"""IGES files for old CAD programs: the curves of STEP files, by OCCT (the extra `cad`), which reads these for it."""

from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from diff3ds._files import replacing
from diff3ds._units import Unit
from diff3ds.formats.cad.step import save_step
from diff3ds.formats.opening import check_writable
from diff3ds.sketch import Sketch


def save_iges(path: str | Path, sketch: Sketch, *, unit: Unit = "mm", tolerance: float | None = None) -> None:
    """Writes an IGES file of lines, arcs and rational B-splines, whole or not at all; in millimetres.

    OCCT writes numbers of ten digits. Not kept: names, colours, widths and layers.

    Args:
        unit: what a world unit is.
        tolerance: as of `save_step`.

    Raises:
        ImportError: the extra `cad` is not installed.
        ValueError: as `save_step`.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_writable(path, sketch, unit, "IGES", "OCP", "cadquery-ocp-novtk", "cad")
    reader: Any = import_module("OCP.STEPControl").STEPControl_Reader()
    with TemporaryDirectory() as folder:
        exact = Path(folder) / "sketch.step"
        save_step(exact, sketch, unit=unit, tolerance=tolerance)
        reader.ReadFile(str(exact))
    reader.TransferRoots()
    writer: Any = import_module("OCP.IGESControl").IGESControl_Writer("MM", 0)
    with replacing(path) as temporary:
        if not (writer.AddShape(reader.OneShape()) and writer.Write(str(temporary))):
            raise OSError(f"{path}: OCCT cannot write this file")
