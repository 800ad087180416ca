"""Pictures with 8 bits a channel: exact round trips, and files that nobody has to clean up."""

import errno
import os

import pytest
import torch

from diff3ds.pictures.store import Store, all_known, as_bytes, byte_array, is_all_known, store_of


def test_every_value_comes_back():
    pixels = (torch.arange(2 * 128 * 1 * 4).remainder(256) / 255).reshape(2, 128, 1, 4)
    assert torch.equal(store_of(pixels).batch([1, 0]).pixels, pixels[[1, 0]])
    assert torch.equal(as_bytes(torch.tensor([-1.0, 0.4 / 255, 0.6 / 255, 2.0])), torch.tensor([0, 0, 1, 255]).byte())


def test_ink_is_black_and_colour_lies_over_white():
    ink = store_of(torch.tensor([0.2, 1.0]).reshape(1, 1, 2, 1)).batch([0])
    torch.testing.assert_close(ink.images[0, 0], torch.tensor([[0.8] * 3, [0.0] * 3]))
    torch.testing.assert_close(ink.alpha[0, 0], torch.tensor([0.2, 1.0]))
    red = store_of(torch.tensor([0.6, 0, 0, 0.6]).reshape(1, 1, 1, 4)).batch([0])
    torch.testing.assert_close(red.images[0, 0], torch.tensor([[1.0, 0.4, 0.4]]))
    torch.testing.assert_close(red.alpha[0, 0], torch.tensor([0.6]))


def test_a_pass_over_all_views_sees_each_once_and_few_at_a_time():
    pixels = torch.zeros((1, 1, 1, 1), dtype=torch.uint8).expand(50, 256, 256, 4)
    parts = list(Store(pixels, all_known(50, (256, 256))).chunks())
    assert torch.equal(torch.cat(parts), torch.arange(50))
    assert all(4 * 4 * 256 * 256 * len(part) <= 1 << 23 for part in parts)


def test_some_of_the_pictures_alone(tmp_path):
    pixels = torch.arange(5, dtype=torch.uint8).reshape(5, 1, 1, 1).expand(5, 4, 6, 4)
    known = torch.arange(5).reshape(5, 1, 1) % 2 == torch.zeros(1, 4, 6)
    for store in (Store(pixels, known, tmp_path), Store(pixels, all_known(5, (4, 6)))):
        some = store.chosen([3, 0])
        assert torch.equal(some.pixels, store.pixels[[3, 0]])
        assert torch.equal(some.known, store.known[[3, 0]])
        assert is_all_known(some.known) == is_all_known(store.known)
        assert store.chosen(range(5)) is store


def test_a_mask_that_is_true_takes_no_memory():
    mask = all_known(1000, (512, 512))
    assert mask.shape == (1000, 512, 512)
    assert mask[-1].all()
    assert mask.untyped_storage().nbytes() == 1
    assert is_all_known(mask)
    assert not is_all_known(torch.ones(2, 3, 4, dtype=torch.bool))


def test_a_file_without_a_name(tmp_path):
    array = byte_array((3, 5, 7), tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert torch.equal(array, torch.zeros(3, 5, 7, dtype=torch.uint8))
    array[1] = 9
    known = byte_array((4,), tmp_path).view(torch.bool)
    known[2] = True
    assert array.sum() == 9 * 35
    assert known.tolist() == [False, False, True, False]


def test_no_room(tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full, raising=False)
    with pytest.raises(OSError, match=r"no room for 6000 bytes of pictures .*No space.*; ask for smaller ones"):
        byte_array((60, 100), tmp_path)
