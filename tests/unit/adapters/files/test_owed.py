"""What is kept of parameters that are to be put back."""

from pathlib import Path

import pytest

from rtshcua.adapters.files.owed import OwedParameters
from rtshcua.cli.debts import Debts
from rtshcua.mavlink.parameters import bits_of
from rtshcua.onboard.enforcement.preparation import Owed
from virtual.rows import rows


def owed(before: float, value: float) -> Owed:
    found = bits_of(before), bits_of(value)
    assert found[0] is not None
    assert found[1] is not None
    return Owed(found[0], found[1])


def test_what_is_kept_is_read_again_to_the_last_bit(tmp_path: Path) -> None:
    kept = OwedParameters(tmp_path, "quad/07")
    assert kept.read() == {}
    for each in ({"FENCE_RADIUS": owed(0.1, 1 / 3), "GF_ACTION": owed(2, 3)}, {"RTL_ALT": owed(-1e-30, 1e30)}, {}):
        kept.write(each)
        assert OwedParameters(tmp_path, "quad/07").read() == each
        assert Debts(tmp_path, "quad/07").left == each
    assert OwedParameters(tmp_path, "another").read() == {}
    assert kept.path.stat().st_mode & 0o077 == 0


@rows("text", [
    "", "[]", "{", '{"A": 1}', '{"A": ["1"]}', '{"A": ["1", "x"]}', '{"A": ["nan", "1"]}', '{"A": [1, 2]}',
    '{"a b": ["1", "2"]}', "[" * 5_000,
])  # fmt: skip
def test_a_file_that_says_something_else_is_damage(text: str, tmp_path: Path) -> None:
    kept = OwedParameters(tmp_path, "quad")
    kept.write({})
    kept.path.write_text(text)
    with pytest.raises(ValueError, match="is damaged"):
        kept.read()
    debts = Debts(tmp_path, "quad")
    assert debts.left == {}
    assert "is damaged" in (debts.trouble or "")


def test_a_file_that_cannot_be_read_is_said_so(tmp_path: Path) -> None:
    kept = OwedParameters(tmp_path, "quad")
    kept.path.mkdir(parents=True)
    assert "it is not known which parameters" in (Debts(tmp_path, "quad").trouble or "")
