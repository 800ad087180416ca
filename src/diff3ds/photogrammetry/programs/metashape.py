"""Agisoft Metashape's cameras.xml, and PhotoScan's: cameras of a chunk that are aligned, slaves of rigs among them."""

import warnings
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import torch

from diff3ds._files import read_text
from diff3ds._shapes import Float, Tensor
from diff3ds.distortion import Distortion
from diff3ds.frames import ADVICE
from diff3ds.photogrammetry.shot import LARGEST, Shot, inverse, picture_size, pinhole, rigid, warn_left_out

# How programs call what holds cameras, and the kinds of lenses that are read.
ROOT, LENSES = "document", ("frame", "fisheye")
_Element = ElementTree.Element
_Sensor = tuple[tuple[int, int], Float[Tensor, "3 3"], Distortion]


def is_metashape(path: Path) -> bool:
    """Whether a file begins like Metashape's."""
    with path.open("rb") as file:
        start = file.read(1024)
    return b"<document" in start and b"<chunk" in start


def read_metashape(path: Path) -> list[Shot]:
    """The cameras that have a place, in the world of the file: metres, if the chunk is referenced.

    The slaves of a rig have the place of their master, moved as their sensor is. What is left out is said in a
    warning: cameras without a place, smaller chunks, and smaller components that no transform brings into one world.

    Raises:
        ValueError: not such a file; a lens of another kind; nothing is aligned.
    """
    chunk = _chunk(path)
    sensors = {str(sensor.get("id")): sensor for sensor in chunk.iter("sensor")}
    cameras = list(chunk.iter("camera"))
    enabled = [camera for camera in cameras if camera.get("enabled") not in ("false", "0")]
    poses = _poses(path, {str(camera.get("id")): camera for camera in enabled}, sensors)
    if not poses:
        raise ValueError(f"{path}: no camera is aligned (has a transform). Align photos in Metashape, and export again")
    parts = {str(part.get("id")): _transform(path, part.find("transform")) for part in chunk.iter("component")}
    apart = _unconnected([str(camera.get("component_id")) for camera in poses], parts)
    placed = {camera: pose for camera, pose in poses.items() if str(camera.get("component_id")) not in apart}
    lenses = {key: _sensor(path, sensors[key]) for key in {str(camera.get("sensor_id")) for camera in placed}}
    whole = _transform(path, chunk.find("transform"))
    shots = []
    for camera, pose in placed.items():
        for place in (parts.get(str(camera.get("component_id"))), whole):
            if place is not None:
                scale, moved = place
                pose = moved @ torch.cat([pose[:, :3], pose[:, 3:] * pose.new_tensor([[scale]] * 3 + [[1.0]])], 1)
        size, intrinsics, lens = lenses[str(camera.get("sensor_id"))]
        shots.append(Shot(str(camera.get("label")), size, inverse(pose), intrinsics, lens))
    for some, why in (
        (set(cameras) - set(enabled), "disabled"),
        (set(enabled) - set(poses), "without a transform (not aligned, or slaves of a rig whose sensor has no place)"),
        (set(poses) - set(placed), "in components that are not aligned with the largest"),
    ):
        warn_left_out(path, [str(camera.get("label")) for camera in cameras if camera in some], len(cameras), why)
    return shots


def _chunk(path: Path) -> _Element:
    """The chunk with most aligned cameras."""
    text = read_text(path)
    # Entities make small files large.
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ValueError(f"{path}: an XML file with a DOCTYPE is not read")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise ValueError(f"{path}: not an XML file ({error})") from error
    chunks = root.findall("chunk")
    if root.tag != ROOT or not chunks:
        raise ValueError(f"{path}: not Metashape's cameras: export them as Agisoft XML (File, Export, Export Cameras)")
    counts = [sum(camera.find("transform") is not None for camera in chunk.iter("camera")) for chunk in chunks]
    chunk = chunks[counts.index(max(counts))]
    if sum(count > 0 for count in counts) > 1:
        label = chunk.get("label") or chunk.get("id")
        warnings.warn(f"{path}: of its {len(chunks)} chunks {label!r} is read, which has most cameras", stacklevel=4)
    return chunk


def _poses(
    path: Path, cameras: Mapping[str, _Element], sensors: Mapping[str, _Element]
) -> dict[_Element, Float[Tensor, "4 4"]]:
    """Camera to chunk, or component, of those that have one; slaves by their masters'."""
    poses = {}
    for i, camera in enumerate(cameras.values()):
        key = str(camera.get("sensor_id"))
        if key not in sensors:
            raise ValueError(f"{path}: camera {camera.get('label')} has sensor {key}, which the file does not list")
        matrix = camera.findtext("transform")
        if matrix is not None:
            numbers = _numbers(path, matrix, 16)
            poses[camera] = rigid(path, i, [numbers[row : row + 4] for row in range(0, 16, 4)], "transform")
    for camera in cameras.values():
        master = cameras.get(str(camera.get("master_id")))
        sensor = sensors[str(camera.get("sensor_id"))]
        # A sensor of one place with its master's, as of the bands of one camera, has a master and no rotation.
        placed = sensor.find("rotation") is not None or sensor.find("location") is not None or sensor.get("master_id")
        if camera not in poses and master is not None and master in poses and placed:
            poses[camera] = poses[master] @ _offset(path, sensor)
    return {camera: poses[camera] for camera in cameras.values() if camera in poses}


def _offset(path: Path, sensor: _Element) -> Float[Tensor, "4 4"]:
    """A slave's camera to its master's."""
    turn = _numbers(path, sensor.findtext("rotation", "1 0 0 0 1 0 0 0 1"), 9)
    place = _numbers(path, sensor.findtext("location", "0 0 0"), 3)
    return rigid(path, 0, [[*turn[3 * i : 3 * i + 3], place[i]] for i in range(3)], "rotation")


def _unconnected(used: list[str], parts: Mapping[str, object]) -> set[str]:
    """The components of these, one a camera, that are in another world than the largest."""
    count = Counter(used)
    if len(count) < 2 or all(parts.get(key) is not None for key in count):
        return set()
    return {key for key, _ in count.most_common()[1:]}


def _numbers(path: Path, text: str | None, count: int) -> list[float]:
    try:
        found = [float(word) for word in (text or "").split()]
    except ValueError:
        found = []
    if len(found) != count or not all(abs(n) < LARGEST for n in found):
        raise ValueError(f"{path}: expected {count} finite numbers, got {text!r:.60}")
    return found


def _transform(path: Path, element: _Element | None) -> tuple[float, Float[Tensor, "4 4"]] | None:
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


def _sensor(path: Path, sensor: _Element) -> _Sensor:
    """Size, intrinsics and lens."""
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

    if others := [name for name in ("p3", "p4") if value(name)]:
        raise ValueError(f"{where}: lens distortion {', '.join(others)} is not supported; {ADVICE}")
    radial, fisheye = tuple(value(f"k{i}") for i in range(1, 5)), kind == "fisheye"
    if calibration.find("f") is None and calibration.find("fx") is not None:
        # PhotoScan before 1.2, from the corner of the picture.
        if value("p1") or value("p2"):
            raise ValueError(f"{where}: p1 and p2 of PhotoScan before 1.2 are not read; {ADVICE}")
        intrinsics = pinhole(where, value("fx"), value("fy"), value("cx"), value("cy"), value("skew"))
        return size, intrinsics, Distortion(radial, fisheye=fisheye)
    # From the middle of the picture, with P1 and P2 the other way round than in OpenCV's formulas.
    focal, cx, cy = value("f"), size[1] / 2 + value("cx"), size[0] / 2 + value("cy")
    intrinsics = pinhole(where, focal + value("b1"), focal, cx, cy, value("b2"))
    return size, intrinsics, Distortion(radial, (value("p2"), value("p1")), fisheye=fisheye)
