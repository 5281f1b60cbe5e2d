"""Threat: a bundle changes on its way to the vehicle. Whatever byte flips, wherever it is cut, it does not open."""

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

from rtshcua.wire import bundle
from rtshcua.wire.untrusted import Untrusted


def _case() -> ModuleType:
    path = Path(__file__).parents[1] / "unit" / "wire" / "test_bundle.py"
    spec = importlib.util.spec_from_file_location("bundle_case", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CASE = _case()
SEALED: bytes = CASE.sealed()


def opens(data: bytes) -> bool:
    try:
        bundle.open_bundle(data, root=CASE.root(), vehicle="quad-07", now_us=CASE.NOW)
    except Untrusted:
        return False
    return True


def test_the_bundle_opens_untouched() -> None:
    assert opens(SEALED)


@pytest.mark.parametrize("bit", range(8))
def test_no_flipped_bit_passes(bit: int) -> None:
    for at in range(len(SEALED)):
        changed = bytearray(SEALED)
        changed[at] ^= 1 << bit
        assert not opens(bytes(changed)), at


def test_no_cut_and_no_addition_passes() -> None:
    assert not any(opens(SEALED[:length]) for length in range(len(SEALED)))
    assert not opens(SEALED + b"\0")
