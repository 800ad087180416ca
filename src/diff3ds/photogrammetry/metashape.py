"""Agisoft Metashape's cameras.xml: cameras of the first chunk that are aligned."""

import math
from pathlib import Path
from xml.etree import ElementTree

import torch

from diff3ds._files import read_text
from diff3ds._shapes import Float, Tensor
from diff3ds.distortion import Distortion
from diff3ds.frames import ADVICE
from diff3ds.photogrammetry.shot import Shot, inverse, picture_size, pinhole, rigid

# How programs call what holds cameras, and the kinds of lenses that are read.
ROOT, LENSES = "document", ("frame", "fisheye")
_Sensor = tuple[tuple[int, int], Float[Tensor, "3 3"], Distortion]


def is_metashape(path: Path) -> bool:
    """Whether a file begins like Metashape's."""
    with path.open("rb") as file:
        start = file.read(1024)
    return b"<document" in start and b"<chunk" in start


def read_metashape(path: Path) -> list[Shot]:
    """The cameras that have a place, in the world of the file: metres, if the chunk is referenced.

    Raises:
        ValueError: not such a file; a lens of another kind; nothing is aligned.
    """
    chunk = _chunk(path)
    sensors = {str(sensor.get("id")): sensor for sensor in chunk.iter("sensor")}
    lenses: dict[str, _Sensor] = {}
    to_world = {str(part.get("id")): _transform(path, part.find("transform")) for part in chunk.iter("component")}
    whole = _transform(path, chunk.find("transform"))
    shots = []
    for i, camera in enumerate(chunk.iter("camera")):
        matrix = camera.findtext("transform")
        if matrix is None or camera.get("enabled") in ("false", "0"):
            continue
        label, sensor = str(camera.get("label")), str(camera.get("sensor_id"))
        if sensor not in sensors:
            raise ValueError(f"{path}: camera {label} has sensor {sensor}, which the file does not list")
        if sensor not in lenses:
            lenses[sensor] = _sensor(path, sensors[sensor])
        size, intrinsics, lens = lenses[sensor]
        numbers = _numbers(path, matrix, 16)
        pose = rigid(path, i, [numbers[row : row + 4] for row in range(0, 16, 4)], "transform")
        for place in (to_world.get(str(camera.get("component_id"))), whole):
            if place is not None:
                scale, moved = place
                pose = moved @ torch.cat([pose[:, :3], pose[:, 3:] * pose.new_tensor([[scale]] * 3 + [[1.0]])], 1)
        shots.append(Shot(label, size, inverse(pose), intrinsics, lens))
    if not shots:
        raise ValueError(f"{path}: no camera is aligned (has a transform). Align photos in Metashape, and export again")
    return shots


def _chunk(path: Path) -> ElementTree.Element:
    text = read_text(path)
    # Entities make small files large.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError(f"{path}: an XML file with a DOCTYPE is not read")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise ValueError(f"{path}: not an XML file ({error})") from error
    chunk = root.find("chunk")
    if root.tag != ROOT or chunk is None:
        raise ValueError(f"{path}: not Metashape's cameras: export them as Agisoft XML (File, Export, Export Cameras)")
    return chunk


def _numbers(path: Path, text: str | None, count: int) -> list[float]:
    try:
        found = [float(word) for word in (text or "").split()]
    except ValueError:
        found = []
    if len(found) != count or not all(map(math.isfinite, found)):
        raise ValueError(f"{path}: expected {count} finite numbers, got {text!r:.60}")
    return found


def _transform(path: Path, element: ElementTree.Element | None) -> tuple[float, Float[Tensor, "4 4"]] | None:
    """Scale, then rotation and translation, of a chunk or component."""
    if element is None or element.find("rotation") is None:
        return None
    turn = _numbers(path, element.findtext("rotation"), 9)
    place = _numbers(path, element.findtext("translation"), 3)
    (scale,) = _numbers(path, element.findtext("scale", "1"), 1)
    if not scale > 0:
        raise ValueError(f"{path}: a scale must be positive, got {scale}")
    rows = [[*turn[3 * i : 3 * i + 3], place[i]] for i in range(3)]
    return scale, rigid(path, 0, rows, "rotation")


def _sensor(path: Path, sensor: ElementTree.Element) -> _Sensor:
    """Size, intrinsics and lens. Metashape's principal point is relative to the middle of the picture."""
    where = f"{path}: sensor {sensor.get('label') or sensor.get('id')}"
    kind = str(sensor.get("type", LENSES[0]))
    if kind not in LENSES:
        raise ValueError(f"{where} is {kind}, not one of {', '.join(LENSES)}; {ADVICE}")
    found = {str(c.get("class")): c for c in sensor.iter("calibration")}
    calibration = found.get("adjusted", found.get("initial"))
    shown = sensor.find("resolution") if calibration is None else calibration.find("resolution")
    if calibration is None or shown is None:
        raise ValueError(f"{where} has no calibration with a focal length: align photos first")
    size = picture_size(where, shown.get("width"), shown.get("height"))

    def value(name: str) -> float:
        return _numbers(path, calibration.findtext(name, "0"), 1)[0]

    focal, b1, b2 = value("f"), value("b1"), value("b2")
    if calibration.find("f") is None and calibration.find("fx") is not None:
        focal, b1 = value("fy"), value("fx") - value("fy")
    intrinsics = pinhole(where, focal + b1, focal, size[1] / 2 + value("cx"), size[0] / 2 + value("cy"), b2)
    # P1 and P2 are the other way round in OpenCV's formulas.
    lens = Distortion(tuple(value(f"k{i}") for i in range(1, 5)), (value("p2"), value("p1")), fisheye=kind == "fisheye")
    return size, intrinsics, lens
