"""Metashape's cameras.xml: rigs, chunks, components, disabled cameras, lenses of all its versions."""

import numpy as np
import pytest
from written_projects import CAMERAS, FOCAL, NAMES, POINTS, SIZE, pictures, seen

from diff3ds.photogrammetry.find_project import find_project, present_views

RESOLUTION = f'<resolution width="{SIZE[1]}" height="{SIZE[0]}"/>'
LENS = f"<f>{FOCAL!r}</f>"
TO_WORLD = np.linalg.inv(CAMERAS.world_to_camera.numpy())


def numbers(values):
    return " ".join(repr(float(n)) for n in np.asarray(values).flatten())


def sensor(number=0, lens=LENS, more="", attributes="", kind="frame"):
    calibration = f'<calibration type="{kind}" class="adjusted">{RESOLUTION}{lens}</calibration>'
    return f'<sensor id="{number}" type="{kind}" {attributes}>{RESOLUTION}{calibration}{more}</sensor>'


def camera(i, pose=None, attributes="", sensor_id=0):
    matrix = f"<transform>{numbers(TO_WORLD[i] if pose is None else pose)}</transform>" if pose is not False else ""
    return f'<camera id="{i}" sensor_id="{sensor_id}" label="{NAMES[i]}" {attributes}>{matrix}</camera>'


def chunk(cameras, sensors=None, components="", label="a"):
    return (
        f'<chunk label="{label}"><sensors>{sensors or sensor()}</sensors><components>{components}</components>'
        f"<cameras>{cameras}</cameras></chunk>"
    )


def views_of(folder, *chunks):
    (folder / "cameras.xml").write_text(f'<?xml version="1.0"?><document version="2.0.0">{"".join(chunks)}</document>')
    pictures(folder / "images")
    return present_views(find_project(folder))


def all_cameras():
    return "".join(camera(i) for i in range(len(NAMES)))


def test_slaves_of_a_rig_have_the_place_of_their_master_moved_as_their_sensor_is(tmp_path):
    """Sensors hold the slave in the coordinates of the master."""
    offset = np.linalg.inv(TO_WORLD[0]) @ TO_WORLD[1]
    place = (
        f'<rotation locked="false">{numbers(offset[:3, :3])}</rotation><location>{numbers(offset[:3, 3])}</location>'
    )
    place += "<rotation_covariance>1 0 0 0 1 0 0 0 1</rotation_covariance><location_covariance>1</location_covariance>"
    moved = TO_WORLD[2] @ offset
    cameras = camera(0) + camera(1, False, 'master_id="0"', 1) + camera(2) + camera(3, False, 'master_id="2"', 1)
    sensors = sensor() + sensor(1, more=place, attributes='master_id="0" layer_index="1"')
    views = views_of(tmp_path, chunk(cameras, sensors))
    assert [view.picture.name for view in views] == NAMES
    for view, pose in zip(views, [TO_WORLD[0], TO_WORLD[1], TO_WORLD[2], moved], strict=True):
        np.testing.assert_allclose(view.world_to_camera, np.linalg.inv(pose), atol=1e-5)


def test_bands_of_one_camera_share_its_place(tmp_path):
    cameras = camera(0) + camera(1, False, 'master_id="0"', 1) + camera(2) + camera(3)
    views = views_of(tmp_path, chunk(cameras, sensor() + sensor(1, attributes='master_id="0" layer_index="1"')))
    np.testing.assert_array_equal(views[0].world_to_camera, views[1].world_to_camera)


def test_slaves_without_a_place_and_disabled_cameras_are_left_out_with_a_word(tmp_path):
    cameras = camera(0) + camera(1, False, 'master_id="0"') + camera(2) + camera(3)
    with pytest.warns(UserWarning, match=r"1 of 4 pictures are left out, without a transform .*slaves.*: shot 1\.png"):
        assert len(views_of(tmp_path, chunk(cameras))) == 3
    with pytest.warns(UserWarning, match=r"1 of 4 pictures are left out, disabled: shot 1\.png"):
        assert len(views_of(tmp_path, chunk(cameras.replace('master_id="0"', 'enabled="false"')))) == 3


def test_of_several_chunks_the_one_with_most_cameras(tmp_path):
    with pytest.warns(UserWarning, match="of its 2 chunks 'large' is read"):
        views = views_of(tmp_path, chunk(camera(0)), chunk(all_cameras(), label="large"))
    assert len(views) == 4
    assert len(views_of(tmp_path, chunk(camera(0, False)), chunk(all_cameras()))) == 4


def test_components_that_are_not_aligned_are_not_mixed(tmp_path):
    cameras = "".join(camera(i, attributes=f'component_id="{int(i == 3)}"') for i in range(4))
    empty = '<component id="0"/><component id="1"/>'
    with pytest.warns(UserWarning, match=r"in components that are not aligned with the largest: shot 3\.png"):
        assert len(views_of(tmp_path, chunk(cameras, components=empty))) == 3
    place = f"<transform><rotation>{numbers(np.eye(3))}</rotation><translation>0 0 0</translation></transform>"
    both = f'<component id="0">{place}</component><component id="1">{place}</component>'
    assert len(views_of(tmp_path, chunk(cameras, components=both))) == 4


def test_photoscan_tells_principal_points_from_the_corner(tmp_path):
    lens = f"<fx>{FOCAL + 1!r}</fx><fy>{FOCAL!r}</fy><cx>30.5</cx><cy>22</cy><skew>0.25</skew><k1>-0.1</k1>"
    view = views_of(tmp_path, chunk(all_cameras(), sensor(lens=lens)))[0]
    x, y, z = (POINTS @ CAMERAS.world_to_camera[0, :3, :3].numpy().T + CAMERAS.world_to_camera[0, :3, 3].numpy()).T
    bend = 1 - 0.1 * ((x / z) ** 2 + (y / z) ** 2)
    expected = np.stack([30.5 + ((FOCAL + 1) * x + 0.25 * y) / z * bend, 22 + FOCAL * y / z * bend], 1)
    np.testing.assert_allclose(seen(view), expected, atol=1e-4)


@pytest.mark.parametrize(
    ("lens", "kind", "message"),
    [
        (f"{LENS}<p3>0.1</p3>", "frame", "lens distortion p3 is not supported"),
        ("<fx>60</fx><fy>60</fy><cx>32</cx><cy>24</cy><p1>0.1</p1>", "frame", "p1 and p2 of PhotoScan"),
        (LENS, "spherical", "is spherical, not one of frame, fisheye"),
        (LENS, "cylindrical", "is cylindrical, not one of"),
        (LENS, "rpc", "is rpc, not one of"),
    ],
)
def test_other_lenses_are_refused_by_name(tmp_path, lens, kind, message):
    with pytest.raises(ValueError, match=message):
        views_of(tmp_path, chunk(all_cameras(), sensor(lens=lens, kind=kind)))


def test_no_camera_is_aligned(tmp_path):
    with pytest.raises(ValueError, match="no camera is aligned"):
        views_of(tmp_path, chunk(camera(0, False)))
