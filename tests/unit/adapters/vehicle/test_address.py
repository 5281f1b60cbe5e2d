"""Link addresses: accepted forms, and the error for each bad one."""

import pytest

from rtshcua.adapters.vehicle.address import Address, AddressError, LinkCarrier, parse


@pytest.mark.parametrize(("text", "loopback", "capacity"), [
    ("udpin:127.0.0.1:14550", True, None), ("udpin:0.0.0.0:14550", False, None), ("udpout:localhost:1", True, None),
    ("udpin:drone.example:65535", False, None), ("tcp:10.0.0.7:5760", False, None),
    ("tcpin:127.0.0.1:5760", True, None),
    ("serial:/dev/ttyAMA0:921600", False, 92_160), ("serial:/dev/serial/by-id/usb-a:b-if00:57600", False, 5_760),
    ("fd:3", False, None), ("fd:1048575", False, None),
])  # fmt: skip
def test_good_ones(text: str, loopback: bool, capacity: int | None) -> None:
    made = parse(text)
    assert str(made) == text
    assert made.is_loopback is loopback
    assert made.capacity == capacity, "ten bits an octet"


def test_parts() -> None:
    assert parse("udpin:10.0.0.7:14551") == Address(LinkCarrier.UDP_IN, "10.0.0.7", 14551)
    assert parse("serial:/dev/ttyUSB0:57600") == Address(LinkCarrier.SERIAL, "/dev/ttyUSB0", 57_600)
    assert parse("fd:7") == Address(LinkCarrier.INHERITED, "", 7)


@pytest.mark.parametrize(("text", "marked", "says", "accepted"), [
    ("", "", "is empty", "udpin:0.0.0.0:14550"),
    ("udpin", "", "host and port of the link are missing", "udpin:0.0.0.0:14550"),
    ("udpin:", "", "host and port", "udpin:0.0.0.0:14550"),
    ("udpin:14550", "", "port of the link is missing", "udpin:0.0.0.0:14550"),
    ("udpin::14550", "", "host of the link is missing", "udpin:0.0.0.0:14550"),
    ("udpin:h:0", "0", "is not a port", "from 1 to 65535"),
    ("udpin:h:65536", "65536", "is not a port", "from 1 to 65535"),
    ("udpin:h:-1", "-1", "is not a port", "is a number"),
    ("udpin:h:1x", "1x", "is not a port", "udpin:0.0.0.0:14550"),
    ("udpin:h:", "", "port of the link is missing", "udpin:0.0.0.0:14550"),
    ("tcp:h h:1", "h h", "not a host name", "tcp:192.168.1.10:5760"),
    ("udpin:h:\u0661", "\u0661", "is not a port", "is a number"),
    ("udpin:[::1]:14550", "[::1]", "not a host name", "IPv6 is not supported"),
    ("serail:/dev/ttyAMA0:57600", "serail", "not a kind of link", "did you mean `serial`"),
    ("http:h:1", "http", "not a kind of link", "serial:/dev/ttyAMA0:921600"),
    ("/dev/ttyAMA0", "/dev/ttyAMA0", "not a kind of link", "serial:/dev/ttyAMA0:921600"),
    ("serial:/dev/ttyAMA0", "", "baud rate of the link is missing", "serial:/dev/ttyAMA0:921600"),
    ("serial:ttyAMA0:57600", "ttyAMA0", "not the path of a device", "absolute path"),
    ("serial:/dev/ttyAMA0:fast", "fast", "is not a baud rate", "is a number"),
    ("fd", "", "descriptor of the link is missing", "fd:3"),
    ("fd:", "", "descriptor of the link is missing", "from 3 on"),
    ("fd:2", "2", "is not an inherited descriptor", "from 3 on"),
    ("fd:1048576", "1048576", "is not an inherited descriptor", "from 3 on"),
    ("fd:x:3", "x:3", "is not an inherited descriptor", "from 3 on"),
    ("serial:/dev/ttyAMA0:57601", "57601", "not a baud rate of this system", "the nearest is 57600"),
])  # fmt: skip
def test_bad_address_is_marked_and_explained(text: str, marked: str, says: str, accepted: str) -> None:
    with pytest.raises(AddressError, match=says) as error:
        parse(text)
    assert text[error.value.start : error.value.end] == marked
    assert accepted in error.value.help


def test_unsupported_carrier_is_distinguished_from_an_unknown_one() -> None:
    with pytest.raises(AddressError, match="cannot be used here") as error:
        parse("tcp:127.0.0.1:5760", (LinkCarrier.UDP_OUT,))
    assert error.value.help == "write `udpout:127.0.0.1:14550`"
