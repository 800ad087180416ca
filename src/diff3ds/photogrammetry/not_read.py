"""What folders hold whose cameras, or pictures, are not read: said by name, with what to do."""

from collections.abc import Sequence
from pathlib import Path

from diff3ds.formats.pixels import HEIC, HEIC_ADVICE, HEIC_READ
from diff3ds.transforms import NAMED

WANTED = (
    "What would do: a transforms.json (nerfstudio, instant-ngp), a COLMAP model (sparse/0), Metashape's cameras.xml, "
    "Bundler's bundle.out, OpenMVG's sfm_data.json, OpenSfM's reconstruction.json, Meshroom's cameras.sfm, VisualSFM's "
    ".nvm, the cameras.json of 3D Gaussians, NeuS's cameras_sphere.npz, LLFF's poses_bounds.npy, MVSNet's cams, or the "
    "meta_data.json of NEF and EMAP"
)
AS_COLMAP = "export its registration as COLMAP or Bundler"
CONVERTED = "convert it to a transforms.json by nerfstudio's ns-process-data"
# Files and folders that say where pictures were taken from: pattern, what their beginning holds, and what they are.
NOT_READ = (
    ("*.psx", b"", "a Metashape project: export its cameras as Agisoft XML"),
    ("*.psz", b"", "a Metashape project: export its cameras as Agisoft XML"),
    ("*.rcproj", b"", f"a RealityCapture project: {AS_COLMAP}"),
    ("*.rsproj", b"", f"a RealityScan project: {AS_COLMAP}"),
    ("*.csv", b"heading", f"the table of RealityCapture, whose angles and lens are not read: {AS_COLMAP}"),
    ("*.xmp", b"xcr:Rotation", f"a file of RealityCapture's for one picture: {AS_COLMAP}"),
    ("*.p4d", b"", "a Pix4D project: export it as Bundler's"),
    ("sfm_data.bin", b"", "OpenMVG's, binary: openMVG_main_ConvertSfM_DataFormat makes sfm_data.json of it"),
    ("*.abc", b"", "Alembic: ConvertSfMFormat of Meshroom makes a .sfm of it"),
    ("keyframes/*cameras/*.json", b"", f"of Polycam: {CONVERTED} polycam"),
    ("metadata", b'"poses"', f"of Record3D: {CONVERTED} record3d"),
    ("odometry.csv", b"", f"of Stray Scanner: {CONVERTED}"),
    ("project.ini", b"", "COLMAP's settings, of a model that is not here: give the folder sparse/0"),
)
# Those that say nothing of the kind.
WITHOUT = {
    "database.db": 'COLMAP\'s database, which has no poses: run its mapper, or "diff3ds cameras" on the pictures',
}
VIDEOS = (".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".mts", ".insv")
RAW = (".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw")
HEIC_LEFT = f"HEIC pictures, which are not read: {HEIC_ADVICE}"
RAW_LEFT = "raw pictures, which are not read: develop them as JPEG or TIFF"
# How much of a file is looked at.
BEGINNING = 1 << 16


def require_no_video(path: Path) -> None:
    """Checks that a file is no video.

    Raises:
        ValueError: it is; says how frames are taken.
    """
    if path.suffix.lower() in VIDEOS:
        raise ValueError(f"{path}: a video, of which frames are to be taken first: {_frames_of(path)}")


def cameras_not_read(path: Path, pictures: Sequence[Path] = ()) -> str:
    """Says which file of a folder, or that this file, has cameras and is not read; empty if none has.

    Args:
        pictures: of the folder, beside which files may lie too.
    """
    for place in dict.fromkeys([path, *(picture.parent for picture in pictures)]):
        for pattern, needle, what in NOT_READ:
            for file in sorted(place.glob(pattern)) if place.is_dir() else [place]:
                if file.match(pattern) and file.is_file() and needle in _beginning(file):
                    return f"{file.relative_to(path) if path.is_dir() else path.name} is {what}"
    return ""


def pictures_not_read(path: Path, pictures: Sequence[Path]) -> list[str]:
    """Says what pictures a folder holds that are not read, and what to do with them.

    Args:
        pictures: of it that are read.
    """
    places = dict.fromkeys([path, path / "images", *(picture.parent for picture in pictures)])
    files = sorted(file for place in places if place.is_dir() for file in place.iterdir())
    left = [(RAW, RAW_LEFT)] if HEIC_READ else [(HEIC, HEIC_LEFT), (RAW, RAW_LEFT)]
    counts = [(sum(file.suffix.lower() in suffixes for file in files), advice) for suffixes, advice in left]
    said = [f"{count} {advice}" for count, advice in counts if count]
    return said + [f"{file.name} is a video: {_frames_of(file)}" for file in files if file.suffix.lower() in VIDEOS]


def no_cameras(path: Path, pictures: Sequence[Path], not_read: str, others: Sequence[str]) -> str:
    """Says what a folder without cameras that are read holds."""
    where = pictures[0].parent if pictures else path
    held = [f"{len(pictures)} pictures" + ("" if where == path else f" in {where.name}")] if pictures else []
    held += [not_read] if not_read else []
    held += [f"{name} is {what}" for name, what in WITHOUT.items() if (path / name).is_file()] + list(others[:NAMED])
    anew = " anew" if not_read else ""
    advice = f'"diff3ds cameras {path}" finds cameras of photographs{anew}. ' if pictures else ""
    lack = f"{path}: no file that says where pictures were taken from{' is read' if not_read else ''}"
    return f"{lack}. Found: {'; '.join(held) or 'no pictures either'}. {advice}{WANTED}"


def _frames_of(video: Path) -> str:
    return f"ffmpeg -i {video.name} -vf fps=2 frames/%04d.jpg"


def _beginning(file: Path) -> bytes:
    with file.open("rb") as content:
        return content.read(BEGINNING)
