"""Pictures turned by their EXIF orientation: as stored where that has the size, turned where only that has."""

import pytest
import torch
from PIL import Image

from diff3ds.formats import load_image
from diff3ds.formats.orientation import load_of_size, load_upright

TAG = 0x0112


def saved(path, orientation):
    """Stored 2 rows high and 3 wide, each pixel of its own gray."""
    picture = Image.frombytes("L", (3, 2), bytes([0, 51, 102, 153, 204, 255]))
    exif = picture.getexif()
    exif[TAG] = orientation
    picture.save(path, exif=exif)
    return path


@pytest.mark.parametrize("orientation", range(9))
def test_the_size_tells_whether_to_turn(tmp_path, orientation):
    path = saved(tmp_path / "a.png", orientation)
    assert torch.equal(load_of_size(path, (2, 3), "the cameras say"), load_image(path))
    if orientation > 4:
        turned = load_of_size(path, (3, 2), "the cameras say")
        assert torch.equal(turned, load_upright(path))
        # Held with the right side down (6), the last row as stored is the first column.
        assert orientation != 6 or (turned[:, 0, 0] * 5).round().tolist() == [3, 4, 5]
    else:
        with pytest.raises(ValueError, match=r"2 x 3 .* pixels, but the cameras say 3 x 2\. Width and height are exch"):
            load_of_size(path, (3, 2), "the cameras say")


def test_both_sizes_are_named(tmp_path):
    path = saved(tmp_path / "a.png", 6)
    with pytest.raises(ValueError, match=r"2 x 3 .* pixels, or 3 x 2 turned as its EXIF says, but the cameras say 4 x"):
        load_of_size(path, (4, 4), "the cameras say")
