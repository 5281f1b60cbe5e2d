"""Link addresses."""

import pytest

from rtshcua.adapters.vehicle.address import Address, parse
from virtual.rows import rows


@pytest.mark.parametrize(("text", "loopback"), [
    ("udpin:127.0.0.1:14550", True), ("udpin:0.0.0.0:14550", False), ("udpout:localhost:1", True),
    ("udpin:drone.example:65535", False),
])  # fmt: skip
def test_good_ones(text: str, loopback: bool) -> None:
    made = parse(text)
    assert str(made) == text
    assert made.is_loopback is loopback


def test_parts() -> None:
    assert parse("udpin:10.0.0.7:14551") == Address("udpin", "10.0.0.7", 14551)


@rows("text", [
    "", "udpin", "udpin:", "udpin:14550", "udpin::14550", "udpin:h:0", "udpin:h:65536", "udpin:h:-1", "udpin:h:1x",
    "tcp:h:1", "udpin:h h:1", "udpin:h:١", "udpin:[::1]:14550",
])  # fmt: skip
def test_bad_ones(text: str) -> None:
    with pytest.raises(ValueError, match="is no "):
        parse(text)
