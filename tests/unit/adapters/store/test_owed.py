"""The stored values of parameters that must be restored."""

from pathlib import Path

import pytest

from rtshcua.adapters.store.vehicle_records import OwedParameters
from rtshcua.mavlink.parameters import bits_of
from rtshcua.onboard.enforcement.preparation import Owed
from virtual.rows import rows


def owed(before: float, value: float) -> Owed:
    found = bits_of(before), bits_of(value)
    assert found[0] is not None
    assert found[1] is not None
    return Owed(found[0], found[1])


WIDER = {"FENCE_RADIUS": owed(50, 300)}


def test_owed_values_round_trip_exactly(tmp_path: Path) -> None:
    kept = OwedParameters(tmp_path, "quad/07")
    assert (kept.left, kept.trouble) == ({}, None)
    for each in ({"FENCE_RADIUS": owed(0.1, 1 / 3), "GF_ACTION": owed(2, 3)}, {"RTL_ALT": owed(-1e-30, 1e30)}, {}):
        kept.keep(each)
        assert OwedParameters(tmp_path, "quad/07").left == each
    assert OwedParameters(tmp_path, "another").left == {}
    assert kept.path.stat().st_mode & 0o077 == 0


@rows("text", [
    "", "[]", "{", '{"GF_ACTION": 1}', '{"GF_ACTION": ["1"]}', '{"GF_ACTION": ["1", "x"]}', "[" * 5_000,
    '{"GF_ACTION": ["nan", "1"]}', '{"GF_ACTION": [1, 2]}', '{"a b": ["1", "2"]}', '{"ARMING_CHECK": ["0", "1"]}',
])  # fmt: skip
def test_a_file_that_says_something_else_is_damage(text: str, tmp_path: Path) -> None:
    kept = OwedParameters(tmp_path, "quad")
    kept.keep(WIDER)
    kept.path.write_text(text)
    found = OwedParameters(tmp_path, "quad", sets=True)
    assert found.left == {}
    assert "is damaged" in (found.trouble or "")


def test_a_file_that_cannot_be_read_is_said_so(tmp_path: Path) -> None:
    OwedParameters(tmp_path, "quad").path.mkdir(parents=True)
    found = OwedParameters(tmp_path, "quad")
    assert "the parameters to restore are not known" in (found.trouble or "")


@pytest.mark.parametrize("first", [True, False], ids=["it sets", "something is left to it"])
def test_parameters_owed_by_living_run_are_left_to_it(first: bool, tmp_path: Path) -> None:
    one = OwedParameters(tmp_path, "quad.07", sets=True) if first else None
    OwedParameters(tmp_path, "quad.07").keep(WIDER)
    one = one or OwedParameters(tmp_path, "quad.07", sets=False)
    for sets in (True, False):
        other = OwedParameters(tmp_path, "quad.07", sets=sets)
        assert other.left == {}
        assert "another run" in (other.trouble or "")
        other.close()
    assert OwedParameters(tmp_path, "quad.07").left == WIDER, "whoever looks is told"
    assert OwedParameters(tmp_path, "quad.08", sets=True).trouble is None
    one.close()
    after = OwedParameters(tmp_path, "quad.07", sets=False)
    assert (after.left, after.trouble) == (WIDER, None)
    after.close()


def test_a_run_that_neither_sets_nor_puts_back_holds_nothing(tmp_path: Path) -> None:
    OwedParameters(tmp_path, "quad", sets=False)
    assert list(tmp_path.iterdir()) == []
