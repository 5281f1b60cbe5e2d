"""Permits that the boundary did not issue, or that were changed, are refused."""

from hypothesis import given
from hypothesis import strategies as st

from reference.world import SESSION_KEY, START, allowed, loaded
from rtshcua.onboard.enforcement.executor import FORGED
from rtshcua.wire.permit import Permit, seal

AT = START.monotonic_us


def test_no_bit_may_change() -> None:
    of = loaded()
    permit = allowed(of)
    for bit in range(8 * len(permit)):
        changed = bytearray(permit)
        changed[bit // 8] ^= 1 << bit % 8
        assert of.executor.dispatch(bytes(changed), AT) is FORGED


@given(st.binary(max_size=100))
def test_random_bytes_are_not_a_permit(data: bytes) -> None:
    assert loaded_once.executor.dispatch(data, AT) is FORGED


def test_permit_under_another_key_is_refused() -> None:
    sealed = seal(Permit(0, 0, -1, 99, 1, 3, 1 << 60), bytes(32))
    assert bytes(32) != SESSION_KEY
    assert loaded().executor.dispatch(sealed, AT) is FORGED


def test_combined_parts_of_permits_are_refused() -> None:
    of = loaded()
    first, second = allowed(of), allowed(of, step=1)
    assert of.executor.dispatch(first[:24] + second[24:], AT) is FORGED


loaded_once = loaded()
