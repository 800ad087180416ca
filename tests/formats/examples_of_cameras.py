"""Projects with cameras of one feature each, for the tables of docs/reference/formats-read.md."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import written_projects as written
from PIL import Image
from read_example import Example
from written_projects import CAMERAS, KINDS, MODELS, NAMES, PLACES, SIZE, TURNS, pictures

import diff3ds as ds
from diff3ds.photogrammetry.find_project import find_project, present_views
from diff3ds.transforms import View, of_picture_sizes

TRUE = written.seen(View(Path(), None, SIZE, CAMERAS.world_to_camera[1], CAMERAS.intrinsics[1]))


def read(path: Path) -> list[View]:
    found = find_project(path)
    return of_picture_sizes(found, present_views(found))


def places(views: list[View]) -> bool:
    """Whether all four pictures are there, from where they were taken."""
    named = [view.picture.stem for view in views] == [name[:-4] for name in NAMES]
    return named and all(
        np.allclose(v.world_to_camera, p, atol=2e-6) for v, p in zip(views, written_poses(), strict=True)
    )


def written_poses() -> list[np.ndarray]:
    return [np.vstack([np.column_stack([t, p]), [0, 0, 0, 1]]) for t, p in zip(TURNS, PLACES, strict=True)]


def sees(views: list[View]) -> bool:
    """Whether the cameras without distortion show points where they are."""
    return places(views) and np.allclose(written.seen(views[1]), TRUE, atol=1e-4)


def bends(radial: tuple[float, ...], fisheye: bool = False, tangential: tuple[float, float] = (0.0, 0.0)):
    def right(views: list[View]) -> bool:
        lens = views[0].distortion
        same = np.allclose(lens.radial[: len(radial)], radial) and lens.tangential == tangential
        return places(views) and same and lens.fisheye == fisheye

    return right


def project(kind: str, *edits: tuple[str, str], more: Callable[[Path], object] = lambda folder: None):
    """A project of a program, with words in its file replaced."""

    def make(folder: Path) -> Path:
        KINDS[kind](folder)
        for file in folder.rglob("*"):
            if file.suffix in (".xml", ".json", ".txt", ".out", ".sfm", ".nvm"):
                text = file.read_text()
                for old, new in edits:
                    text = text.replace(old, new)
                file.write_text(text)
        more(folder)
        return folder

    return make


def colmap(model: str, binary: bool = False):
    def make(folder: Path) -> Path:
        (written.colmap_binary if binary else written.colmap_text)(folder / "sparse" / "0", model)
        pictures(folder / "images")
        return folder

    return make


def meshroom(version: tuple[int, int, int], **lens: object):
    return lambda folder: written.write_meshroom(folder, version, lens) or folder


def unnamed(folder: Path) -> None:
    """A project without the picture that has no camera."""
    for file in (*folder.glob("*.sfm"), *folder.glob("sfm_data.json")):
        file.write_text(json.dumps({**(data := json.loads(file.read_text())), "views": data["views"][:4]}))


def transforms(
    more: dict | None = None, frame: dict | None = None, folder_name: str = "images", left: tuple = (), times=1
):
    def make(folder: Path) -> Path:
        file = folder / "transforms.json"
        ds.save_transforms(file, CAMERAS, [f"images/{name}" for name in NAMES])
        data = json.loads(file.read_text())
        for one in data["frames"]:
            for key in left:
                one.pop(key, None)
            one |= frame or {}
        file.write_text(json.dumps(data | (more or {})))
        pictures(folder / folder_name, NAMES, (SIZE[0] // times, SIZE[1] // times))
        Image.new("L", SIZE[::-1], 255).save(folder / "mask.png")
        return folder

    return make


UNALIGNED = '<camera id="9" sensor_id="0" label="never"/>'
RIG = '<camera id="9" sensor_id="5" master_id="1" label="never"/>'
SLAVE = (
    '<sensor id="5" type="frame" master_id="0"><resolution width="64" height="48"/><calibration type="frame" '
    'class="adjusted"><resolution width="64" height="48"/><f>60</f></calibration><rotation>1 0 0 0 1 0 0 0 1</rotation>'
    "<location>1 0 0</location></sensor></sensors>"
)
ALIGNED = (UNALIGNED, "")
REGISTERED = (("5 4\n", "4 4\n"), ("\n0 0 0" * 5, ""), (f"\nimages/never.png 0 {written.FOCAL}", ""))
BROWN = ('"disto_k3": [-0.1, 0.05, 0]', '"disto_t2": [-0.1, 0.05, 0, 0.25, 0.5]')
ANGLE = 2 * np.arctan(SIZE[1] / 2 / written.FOCAL)
FOCALS = ("fl_x", "fl_y")


def rig(views: list[View]) -> bool:
    """Whether the slave is one unit to the right of its master: at half scale, for the component is twice as large."""
    slave = views[-1]
    moved = slave.world_to_camera.numpy() @ np.linalg.inv(written_poses()[1])
    return places(views[:4]) and np.allclose(moved[:3, 3], [-2, 0, 0], atol=1e-5)


def more_reconstructions(folder: Path) -> None:
    file = folder / "reconstruction.json"
    whole = json.loads(file.read_text())[0]
    file.write_text(json.dumps([{**whole, "shots": dict(list(whole["shots"].items())[:1])}, whole]))


def largest(folder: Path) -> None:
    (folder / "sparse" / "1").mkdir()
    for name in ("cameras.txt", "images.txt"):
        text = (folder / "sparse" / "0" / name).read_text()
        (folder / "sparse" / "1" / name).write_text("\n".join(text.splitlines()[:4]) + "\n")


EXAMPLES = {
    "transforms.json: nerfstudio, instant-ngp, NeRF": {
        "focal lengths in pixels, of the file or of a frame": Example(transforms(), sees),
        "`camera_angle_x`": Example(transforms({"camera_angle_x": ANGLE}, left=FOCALS), sees),
        "`x_fov` in degrees, of the file or of a frame": Example(
            transforms(frame={"x_fov": np.rad2deg(ANGLE)}, left=FOCALS), sees
        ),
        "`k1` to `k4`, `p1`, `p2`": Example(
            transforms({"k1": -0.1, "p1": 0.25, "p2": 0.5}), bends((-0.1,), tangential=(0.25, 0.5))
        ),
        "`is_fisheye`, fisheye models": Example(transforms({"k1": -0.1, "is_fisheye": True}), bends((-0.1,), True)),
        "`mask_path`": Example(
            transforms(frame={"mask_path": "mask.png"}), lambda views: sees(views) and views[0].mask.name == "mask.png"
        ),
        "`depth_file_path`, `applied_transform`, `applied_scale`, `aabb_scale`": Example(
            transforms(
                {"applied_transform": [[1, 0, 0, 5]], "applied_scale": 7, "aabb_scale": 16}, {"depth_file_path": "a"}
            ),
            sees,
        ),
        "pictures of another size and the same shape": Example(
            transforms(times=2), places, "focal lengths are scaled with them"
        ),
        "pictures in `images_2` (4, 8) alone": Example(
            transforms(folder_name="images_4", times=4), places, "focal lengths are scaled with them"
        ),
        "`rolling_shutter`, `n_frames`, `sharpen`": Example(
            transforms({"rolling_shutter": [0, 0, 0, 1]}), sees, "rolling_shutter is for instant-ngp"
        ),
        "`FISHEYE624`, `EQUIRECTANGULAR` and other models": Example(
            transforms({"camera_model": "FISHEYE624"}), words="camera_model 'FISHEYE624' is not one of"
        ),
        "`ftheta_p0`, `latlong`, `equirectangular`": Example(transforms({"latlong": True}), words="that are latlong"),
    },
    "COLMAP: `cameras`, `images`, `points3D`, `.bin` or `.txt`": {
        "text files": Example(colmap("PINHOLE"), places),
        "binary files": Example(colmap("PINHOLE", True), places),
        "text files of one line a picture": Example(
            project("colmap", ("\n\n", "\n"), ("10.5 3.25 -1 4 4 1\n", "")), places
        ),
        "`SIMPLE_PINHOLE` to `RADIAL`, `OPENCV`": Example(
            colmap("OPENCV"), bends(tuple(MODELS["OPENCV"][4:6]), tangential=tuple(MODELS["OPENCV"][6:]))
        ),
        "`FULL_OPENCV`": Example(colmap("FULL_OPENCV"), lambda views: views[0].distortion.divisor == (0.2, -0.1, 0.05)),
        "`FISHEYE` and its kin, `THIN_PRISM_FISHEYE`": Example(
            colmap("THIN_PRISM_FISHEYE", True), lambda views: views[0].distortion.prism == (0.02, 0.015)
        ),
        "`rigs` and `frames` of version 3.12": Example(
            project("colmap", more=lambda folder: (folder / "sparse" / "0" / "rigs.txt").write_text("1 1 CAMERA 7")),
            places,
        ),
        "several models": Example(project("colmap", more=largest), places, "2 models of COLMAP, of which the largest"),
        "some pictures that are missing": Example(
            project("colmap", more=lambda folder: (folder / "images" / NAMES[1]).unlink()),
            lambda views: len(views) == 3,
            "1 of 4 pictures are missing",
        ),
        "`FOV`, `DIVISION`, `EUCM`, `EQUIRECTANGULAR`": Example(
            project("colmap", (" RADIAL ", " FOV ")), words="the camera model 'FOV' is not one of"
        ),
        "straightened pictures of cameras with distortion": Example(
            project("colmap", more=lambda folder: (folder / "images").rename(folder / "undistorted_images")),
            words="which the pictures in",
        ),
    },
    "Metashape: `cameras.xml`": {
        "frame and fisheye lenses": Example(project("metashape", ALIGNED), bends((-0.1, 0.05))),
        "labels without a suffix": Example(project("metashape", ALIGNED), places),
        "transforms of components and of the chunk": Example(project("metashape", ALIGNED), places),
        "slaves of a rig": Example(
            project(
                "metashape",
                (UNALIGNED, RIG.replace("/>", ' component_id="0"/>')),
                ("</sensors>", SLAVE),
                more=lambda folder: pictures(folder / "images", ["never.png"]),
            ),
            rig,
        ),
        "covariances of a rig's places": Example(
            project("metashape", ALIGNED, ("</sensor>", "<location_covariance>1</location_covariance></sensor>")),
            places,
        ),
        "cameras that are not aligned": Example(project("metashape"), places, "1 of 5 pictures are left out"),
        "disabled cameras": Example(
            project("metashape", (UNALIGNED, UNALIGNED.replace('id="9"', 'id="9" enabled="false"'))),
            places,
            "left out, disabled: never",
        ),
        "several chunks": Example(
            project(
                "metashape",
                ALIGNED,
                ("</chunk>", '</chunk><chunk label="b"><cameras><camera><transform/></camera></cameras></chunk>'),
            ),
            places,
            "of its 2 chunks 'a' is read",
        ),
        "masks beside photographs of the same names": Example(
            project(
                "metashape", ALIGNED, more=lambda folder: pictures(folder / "images", [f"{n[:-4]}.jpg" for n in NAMES])
            ),
            lambda views: places(views) and {v.picture.suffix for v in views} == {".jpg"},
            "4 files are named as pictures that lie beside them",
        ),
        "spherical, cylindrical and RPC lenses": Example(
            project("metashape", ('type="frame">', 'type="spherical">')), words="is spherical, not one of"
        ),
        "`p3`, `p4`": Example(project("metashape", ("<k1>", "<p3>0.1</p3><k1>")), words="lens distortion p3"),
    },
    "Bundler: `bundle.out`": {
        "`NAME.list.txt`, `list.txt` and a lone list": Example(
            project("bundler", *REGISTERED, more=lambda folder: (folder / "list.txt").rename(folder / "some.list.txt")),
            bends((-0.1, 0.05)),
        ),
        "pictures that are not registered": Example(project("bundler"), places, "not registered: images/never.png"),
    },
    "OpenMVG: `sfm_data.json`": {
        "pinhole, radial, Brown and fisheye cameras": Example(
            project("openmvg", BROWN, more=unnamed), bends((-0.1, 0.05), tangential=(0.25, 0.5))
        ),
        "views without a pose": Example(project("openmvg"), places, "without a pose or intrinsics: never.png"),
        "spherical cameras": Example(project("openmvg", ("focal_length", "none")), words="(spherical?)"),
    },
    "OpenSfM: `reconstruction.json`": {
        "perspective, radial, Brown and fisheye cameras": Example(project("opensfm"), bends((-0.1, 0.05))),
        "several reconstructions": Example(
            project("opensfm", more=more_reconstructions), places, "the largest is read, 4 of 5 shots"
        ),
        "spherical, dual and other cameras": Example(
            project("opensfm", ("brown", "spherical")), words="'spherical' is not"
        ),
    },
    "Meshroom: `cameras.sfm`": {
        "pinhole, radial, Brown and fisheye cameras": Example(project("meshroom", more=unnamed), bends((-0.1, 0.05))),
        "views without a pose": Example(
            project("meshroom"), places, "without a pose or intrinsics: /elsewhere/never.png"
        ),
        "`radialk3pt`, `fisheye1`, `equidistant` and those of 3DEqualizer": Example(
            project("meshroom", ("radialk3", "radialk3pt")), words="the lens pinhole radialk3pt"
        ),
        "rigs": Example(project("meshroom", ('"viewId"', '"rigId": "5", "viewId"')), words="rigs are not read"),
    },
    "VisualSFM: `.nvm`": {
        "pictures, focal lengths and poses": Example(project("nvm"), sees),
        "radial distortion": Example(project("nvm", (" 0 0\n", " 0.1 0\n")), words="VisualSFM's radial distortion"),
        "fixed calibration": Example(project("nvm", ("NVM_V3", "NVM_V3 FixedK 1 2 3 4")), words="of fixed calibration"),
    },
    "3D Gaussians: `cameras.json`": {"poses and focal lengths": Example(project("gaussians"), sees)},
    "NeuS, IDR, DTU: `cameras_sphere.npz`": {
        "`world_mat` times `scale_mat`": Example(project("neus"), sees),
        "fewer pictures than cameras, or more": Example(
            project("neus", more=lambda folder: pictures(folder / "image", ["zzz.png"])), words="cameras of 4 pictures"
        ),
    },
    "LLFF: `poses_bounds.npy`": {
        "poses, size and focal length": Example(project("llff"), sees),
        "the depths of the scene": Example(project("llff"), sees),
        "fewer pictures than cameras, or more": Example(
            project("llff", more=lambda folder: pictures(folder / "images", ["zzz.png"])), words="cameras of 4 pictures"
        ),
    },
    "MVSNet, BlendedMVS: `cams`": {
        "extrinsic and intrinsic": Example(project("mvsnet"), sees),
        "the range of depths": Example(project("mvsnet"), sees),
        "intrinsics of pictures of another size": Example(
            project("mvsnet", more=lambda folder: pictures(folder / "images", NAMES, (2 * SIZE[0], 2 * SIZE[1]))),
            words="and its camera looks at",
        ),
    },
}
