"""Threat: a bundle changes on its way to the vehicle. It does not open after any flipped byte or any truncation."""

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


def flipped(at: int, bit: int) -> bytes:
    return SEALED[:at] + bytes([SEALED[at] ^ 1 << bit]) + SEALED[at + 1 :]


def test_bundle_with_flipped_bit_in_any_byte_is_refused() -> None:
    """One bit in each byte; all bits in soak."""
    assert [at for at in range(len(SEALED)) if opens(flipped(at, at % 8))] == []


@pytest.mark.soak
@pytest.mark.parametrize("bit", range(8))
def test_bundle_with_flipped_bit_is_refused(bit: int) -> None:
    assert [at for at in range(len(SEALED)) if opens(flipped(at, bit))] == []


def test_truncated_or_extended_bundle_is_refused() -> None:
    assert not any(opens(SEALED[:length]) for length in range(len(SEALED)))
    assert not opens(SEALED + b"\0")
