"""Photographs whose object rembg cuts out, before a run of `diff3ds views` looks at them."""

import sys

import pytest
import torch
from red_network import red_network

import diff3ds as ds
from diff3ds.formats.png import load_image, save_png
from diff3ds.tasks.views.run_views import run_views
from diff3ds.tasks.views.views_options import ViewsOptions


@pytest.fixture
def photographs(tmp_path):
    """A red bar before noise that has no red, 120 x 80 pixels; two cameras name their pictures alike."""
    cameras = ds.orbit([0.0, 90.0, 180.0], 20.0, 3.0, size=(80, 120))
    bar = ds.Sketch(torch.tensor([[[-0.3, -0.3, 0], [0.3, 0.3, 0.2]]]), width=0.4, width_space="world")
    noise = torch.rand(80, 120, 3, generator=torch.Generator().manual_seed(0)) * torch.tensor([0.0, 1, 1])
    names, alpha = ["a/1.png", "b/1.png", "b/2.png"], ds.render(bar, cameras).alpha[..., None]
    for name, share in zip(names, alpha, strict=True):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        save_png(tmp_path / name, share * torch.tensor([1.0, 0, 0]) + (1 - share) * noise)
    ds.save_transforms(tmp_path / "transforms.json", cameras, names)
    return tmp_path, alpha


def test_the_object_is_cut_out_of_photographs(photographs, monkeypatch):
    source, alpha = photographs
    red_network(source, monkeypatch)
    stages = []
    options = ViewsOptions(cut_out=True, target="color", strokes=16, steps=2, size=60)
    run_views(source, source / "out", options, lambda progress: stages.append(progress.stage))
    assert stages.count("masks by rembg") == 3
    masks = torch.stack([load_image(source / "out" / "masks_rembg" / n) for n in ("a/1.png", "b/1.png", "b/2.png")])
    # As large as the photographs; at the object's border a pixel of the reduced one lies between.
    assert masks.shape == (3, 80, 120, 1)
    assert ((masks > 0.5) != (alpha > 0.5)).float().mean() < 0.02
    shown = load_image(source / "out" / "targets.png")
    # Around the object there is nothing left of the noise.
    assert float(shown[:8, :20, :3].std()) < 0.01
    # Masks that are there are kept.
    save_png(source / "out" / "masks_rembg" / "b" / "2.png", torch.ones(80, 120, 1))
    with pytest.raises(ValueError, match="1 of 3 pictures have no transparent areas"):
        run_views(source, source / "out", ViewsOptions(**{**vars(options), "resume": True}))


def test_what_cannot_be_cut_out_is_said(photographs, monkeypatch):
    source = photographs[0]
    with pytest.raises(ValueError, match="--cut-out or --background white"):
        ViewsOptions(cut_out=True, background="white")
    with pytest.raises(ValueError, match="--cut-out or --masks object"):
        ViewsOptions(cut_out=True, masks="object")
    with pytest.raises(ValueError, match="line drawings"):
        ViewsOptions(cut_out=True, target="edges")
    with pytest.raises(ValueError, match="leave --cut-out out"):
        run_views(None, source / "out", ViewsOptions(cut_out=True))
    monkeypatch.setitem(sys.modules, "rembg", None)
    with pytest.raises(ImportError, match=r"--cut-out takes rembg: pip install .* a folder 'masks' beside"):
        run_views(source, source / "out", ViewsOptions(cut_out=True))
    assert not (source / "out").exists()


def test_photographs_that_have_masks_are_not_cut_out(photographs, monkeypatch):
    source, alpha = photographs
    monkeypatch.setattr("diff3ds.tasks.views.run_views.require_rembg", lambda instead: None)
    (source / "masks" / "a").mkdir(parents=True)
    save_png(source / "masks" / "a" / "1.png", alpha[0])
    content = (source / "transforms.json").read_text().replace('"a/1.png"', '"a/1.png", "mask_path": "masks/a/1.png"')
    (source / "transforms.json").write_text(content)
    with pytest.raises(ValueError, match=r"1 pictures have masks .*1\.png.*: leave --cut-out out"):
        run_views(source, source / "out", ViewsOptions(cut_out=True))
