"""Lenses: directions found again from where they are shown, and another k1."""

import pytest
import torch

from diff3ds.distortion import NO_DISTORTION, Distortion

LENSES = {
    "none": NO_DISTORTION,
    "barrel": Distortion((-0.3, 0.05)),
    "pincushion": Distortion((0.2,)),
    "all of OpenCV's": Distortion((-0.1, 0.05, 0.03), (0.01, -0.02), (0.2, -0.1, 0.05), (0.004, -0.003)),
    "fisheye": Distortion((0.1, -0.02), fisheye=True),
}


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_directions_are_found_again(lens):
    x, y = torch.meshgrid(*[torch.linspace(-0.6, 0.6, 9, dtype=torch.float64)] * 2, indexing="xy")
    x, y = x.flatten(), y.flatten()
    back = lens.straight(*lens.bent(x, y))
    torch.testing.assert_close(torch.stack(back), torch.stack([x, y]), atol=1e-12, rtol=0)


def test_more_k1_is_added_to_the_lens():
    x, y = torch.tensor([0.3]), torch.tensor([0.4])
    for lens in LENSES.values():
        more = lens.with_more_k1(0.1)
        assert more.radial[:1] == (sum(lens.radial[:1]) + 0.1,)
        assert more.radial[1:] == lens.radial[1:]
        assert lens.with_more_k1(0.0) == lens
    seen = NO_DISTORTION.with_more_k1(0.1).bent(x, y)
    torch.testing.assert_close(torch.cat(seen), torch.tensor([0.3, 0.4]) * 1.025)
