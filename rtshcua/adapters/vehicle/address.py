"""Link addresses as MAVLink tools write them.

| address | the link |
|---|---|
| `udpin:HOST:PORT` | waits for UDP datagrams that come to this address |
| `udpout:HOST:PORT` | sends UDP datagrams to that address first |
| `tcp:HOST:PORT` | connects to that address |
| `tcpin:HOST:PORT` | waits for a connection to this address |
| `serial:DEVICE:BAUD` | opens a serial device, at so many bits a second |
| `fd:N` | uses an inherited descriptor: one end of a pair of datagram sockets (`socketpair`), for programs |
"""

import re
import termios
from collections.abc import Collection
from enum import StrEnum
from ipaddress import ip_address
from typing import Final, NamedTuple

from rtshcua.diagnostics.suggest import nearest


class LinkCarrier(StrEnum):
    """The transport of a link, and which side begins it."""

    UDP_IN = "udpin"
    UDP_OUT = "udpout"
    TCP = "tcp"
    TCP_IN = "tcpin"
    SERIAL = "serial"
    INHERITED = "fd"


#: baud rates of the system's serial driver, as far as telemetry uses them
BAUDS: Final = tuple(
    baud
    for baud in (
        9_600, 19_200, 38_400, 57_600, 115_200, 230_400, 460_800, 500_000, 576_000, 921_600, 1_000_000, 1_152_000,
        1_500_000, 2_000_000, 2_500_000, 3_000_000, 3_500_000, 4_000_000,
    )
    if hasattr(termios, f"B{baud}")
)  # fmt: skip
#: a start bit, eight bits of data, a stop bit
BITS_OF_AN_OCTET: Final = 10

_EXAMPLES: Final = {
    LinkCarrier.UDP_IN: "udpin:0.0.0.0:14550",
    LinkCarrier.UDP_OUT: "udpout:127.0.0.1:14550",
    LinkCarrier.TCP: "tcp:192.168.1.10:5760",
    LinkCarrier.TCP_IN: "tcpin:0.0.0.0:5760",
    LinkCarrier.SERIAL: "serial:/dev/ttyAMA0:921600",
    LinkCarrier.INHERITED: "fd:3",
}
#: the descriptors that a program may have inherited besides its standard streams
_DESCRIPTORS: Final = range(3, 1 << 20)
_HOST: Final = re.compile(r"[^:\[\]\s]+", re.ASCII)
_NUMBER: Final = re.compile(r"\d{1,9}", re.ASCII)


class AddressError(ValueError):
    """A text that is not an address. `start` and `end` mark the wrong part; `help` says what is accepted."""

    def __init__(self, text: str, address: str, start: int, end: int, help: str) -> None:
        super().__init__(text)
        self.text, self.address, self.start, self.end, self.help = text, address, start, end, help


class Address(NamedTuple):
    """The address of a link: its carrier, then host and port, or serial device and baud rate, or nothing and an
    inherited descriptor.
    """

    way: LinkCarrier
    host: str
    port: int

    @property
    def is_loopback(self) -> bool:
        """Whether the other end is on this machine, over its loopback interface. Unknown, so False, for an inherited
        descriptor: the program at its other end may have any link to the vehicle.
        """
        if self.way in (LinkCarrier.SERIAL, LinkCarrier.INHERITED):
            return False
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @property
    def capacity(self) -> int | None:
        """Octets a second each way; None where the address does not determine it."""
        return self.port // BITS_OF_AN_OCTET if self.way is LinkCarrier.SERIAL else None

    def __str__(self) -> str:
        return f"{self.way}:{self.port}" if self.way is LinkCarrier.INHERITED else f"{self.way}:{self.host}:{self.port}"


def parse(text: str, ways: Collection[LinkCarrier] = tuple(LinkCarrier)) -> Address:
    """Return the address in a text; its kind has to be one of `ways`. Raises AddressError."""
    word, _, rest = text.partition(":")
    host, colon, number = rest.rpartition(":")
    way = _carrier(text, word, ways)
    if way is LinkCarrier.INHERITED:
        return _inherited(text, rest)
    place, value = ("device", "baud rate") if way is LinkCarrier.SERIAL else ("host", "port")
    example, begin, end = f"write it as `{_EXAMPLES[way]}`", len(word) + 1, len(word) + 1 + len(host)
    if not colon:
        missing = f"{value} of the link is missing" if rest else f"{place} and {value} of the link are missing"
        raise AddressError(f"the {missing}", text, len(text), len(text), example)
    if not host:
        raise AddressError(f"the {place} of the link is missing", text, begin, begin, example)
    fault = _fault_of_place(way, host)
    if fault is not None:
        raise AddressError(fault[0], text, begin, end, f"{fault[1]}{example}")
    if _NUMBER.fullmatch(number) is None:
        found = f"`{number}` is not a {value}" if number else f"the {value} of the link is missing"
        raise AddressError(found, text, end + 1, len(text), f"a {value} is a number: {example}")
    fault = _fault_of_number(way, int(number))
    if fault is not None:
        raise AddressError(f"`{number}` {fault[0]}", text, end + 1, len(text), fault[1])
    return Address(way, host, int(number))


def _inherited(text: str, number: str) -> Address:
    begin, help = len("fd:"), f"a descriptor is a number from 3 on: write it as `{_EXAMPLES[LinkCarrier.INHERITED]}`"
    if not number:
        raise AddressError("the descriptor of the link is missing", text, len(text), len(text), help)
    if _NUMBER.fullmatch(number) is None or int(number) not in _DESCRIPTORS:
        raise AddressError(f"`{number}` is not an inherited descriptor", text, begin, len(text), help)
    return Address(LinkCarrier.INHERITED, "", int(number))


def _carrier(text: str, word: str, ways: Collection[LinkCarrier]) -> LinkCarrier:
    accepted = " or ".join(f"`{_EXAMPLES[way]}`" for way in LinkCarrier if way in ways)
    if not text:
        raise AddressError("the address is empty", text, 0, 0, f"write {accepted}")
    if word in ways:
        return LinkCarrier(word)
    if word in list(LinkCarrier):
        raise AddressError(f"`{word}` cannot be used here", text, 0, len(word), f"write {accepted}")
    near = nearest(word, [way.value for way in ways])
    help = f"did you mean `{near}`?" if near else f"write {accepted}"
    raise AddressError(f"`{word}` is not a kind of link", text, 0, len(word), help)


def _fault_of_place(way: LinkCarrier, host: str) -> tuple[str, str] | None:
    """What is wrong with a device or a host, and what is accepted; None for a valid one."""
    if way is LinkCarrier.SERIAL:
        valid = host.startswith("/") and "\0" not in host
        return None if valid else (f"`{host}` is not the path of a device", "a device is an absolute path: ")
    valid = _HOST.fullmatch(host) is not None
    return None if valid else (f"`{host}` is not a host name or an IPv4 address", "IPv6 is not supported; ")


def _fault_of_number(way: LinkCarrier, value: int) -> tuple[str, str] | None:
    """What is wrong with a baud rate or a port, and what is accepted; None for a valid one."""
    if way is not LinkCarrier.SERIAL:
        return None if 1 <= value <= 65_535 else ("is not a port", "a port is a number from 1 to 65535")
    if value in BAUDS:
        return None
    close = min(BAUDS, key=lambda baud: abs(baud - value))
    help = f"the nearest is {close}; accepted are {', '.join(map(str, BAUDS))}"
    return "is not a baud rate of this system", help
