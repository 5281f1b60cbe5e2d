"""Threat: a bundle changes on its way to the vehicle. Whatever byte flips, wherever it is cut, it does not open."""

import pytest

from reference.bundle_case import NOW, root, sealed
from rtshcua.wire import bundle
from rtshcua.wire.untrusted import Untrusted

SEALED = sealed()


def opens(data: bytes) -> bool:
    try:
        bundle.open_bundle(data, root=root(), vehicle="quad-07", now_us=NOW)
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
