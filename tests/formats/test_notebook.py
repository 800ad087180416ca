"""Sketches and renderings show themselves in a notebook."""

import io

import numpy as np
import torch
from PIL import Image

import diff3ds as ds


def picture(png: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(png)))


def test_a_sketch_fills_the_picture_wherever_and_however_large_it_is():
    """The three axes' ends lie on a ball that fills 90 % of the picture, so that ink reaches far but not the border."""
    axes = torch.tensor([[[-1.0, 0, 0], [1, 0, 0]], [[0, -1, 0], [0, 1, 0]], [[0, 0, -1], [0, 0, 1]]])
    shown = [picture(ds.Sketch(axes * scale + place)._repr_png_()) for scale, place in ((1, 0), (50, 30), (0.01, -2))]
    for image in shown:
        assert image.shape == (256, 256, 3)
        rows = np.flatnonzero((image < 128).any((1, 2)))
        assert 0.7 * 256 < rows[-1] - rows[0] < 0.95 * 256
        assert np.abs(image.astype(int) - shown[0]).mean() < 0.1


def test_a_point_and_no_strokes_are_shown():
    assert (picture(ds.Sketch(torch.zeros(1, 2, 3), width=0.05)._repr_png_()) < 128).any()
    assert (picture(ds.Sketch(torch.zeros(0, 2, 3))._repr_png_()) == 255).all()


def test_a_rendering_shows_its_views_side_by_side():
    sketch = ds.Sketch(torch.tensor([[[-0.5, 0, 0], [0.5, 0, 0.3]]]), width=0.05)
    image = ds.render(sketch, ds.orbit([0, 90, 180], size=32))
    expected = (ds.formats.tile_images(image.color) * 255).round().byte().numpy()
    assert (picture(image._repr_png_()) == expected).all()
