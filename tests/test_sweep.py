"""Sweeps check every case and name all that fail."""

import pytest
from sweep import sweep


def test_every_case_is_checked_and_all_that_fail_are_named(tmp_path):
    seen = []

    @sweep(("number", "expected"), [(1, 1), (2, 3), (4, 4), ("x", 5)])
    def square_of_one(number, expected, tmp_path):
        seen.append(number)
        with pytest.raises(ValueError, match="x"):
            raise ValueError(f"x{tmp_path}" if number == expected else "other")

    with pytest.raises(BaseExceptionGroup, match="2 of 4 cases fail") as caught:
        square_of_one(tmp_path=tmp_path)
    assert seen == [1, 2, 4, "x"]
    notes = [failure.__notes__ for failure in caught.value.exceptions]
    assert notes == [["case: {'number': 2, 'expected': 3}"], ["case: {'number': 'x', 'expected': 5}"]]


@sweep("letter", "ab")
def test_fixtures_come_to_every_case(letter, tmp_path):
    assert letter in "ab"
    assert tmp_path.is_dir()
