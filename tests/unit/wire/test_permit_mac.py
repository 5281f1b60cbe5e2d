"""The MAC of a permit is HMAC-SHA256 over its domain and body, whatever the length of the key."""

import hmac

from rtshcua.wire.permit import SIZE, Permit, open_permit, seal
from virtual.rows import rows

PERMIT = Permit(1, 2, -1, 77, 3, 4, 123_456_789)


@rows("octets", [1, 32, 63, 64, 65, 200])
def test_the_mac_is_that_of_rfc_2104(octets: int) -> None:
    key = bytes(range(octets))
    sealed = seal(PERMIT, key)
    assert len(sealed) == SIZE
    assert sealed[-32:] == hmac.digest(key, b"rtshcua/permit\x00" + sealed[:-32], "sha256")
    assert open_permit(sealed, key) == PERMIT
    assert open_permit(sealed, key + b"x") is None
