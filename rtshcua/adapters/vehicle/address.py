"""Link addresses as MAVLink tools write them.

| address | the link |
|---|---|
| `udpin:HOST:PORT` | waits for UDP datagrams that come to this address |
| `udpout:HOST:PORT` | sends UDP datagrams to that address first |
| `tcp:HOST:PORT` | connects to that address |
| `tcpin:HOST:PORT` | waits for a connection to this address |
| `serial:DEVICE:BAUD` | opens a serial device, at so many bits a second |
"""

import re
import termios
from collections.abc import Collection
from enum import StrEnum
from ipaddress import ip_address
from typing import Final, NamedTuple

from rtshcua.diagnostics.suggest import nearest


class LinkCarrier(StrEnum):
    """What carries a link, and who begins it."""

    UDP_IN = "udpin"
    UDP_OUT = "udpout"
    TCP = "tcp"
    TCP_IN = "tcpin"
    SERIAL = "serial"


#: bits a second that the system's serial driver knows, of those that telemetry uses
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
}
_HOST: Final = re.compile(r"[^:\[\]\s]+", re.ASCII)
_NUMBER: Final = re.compile(r"\d{1,9}", re.ASCII)


class AddressError(ValueError):
    """A text that is no address. `start` and `end` are the part that is wrong; `help` says what is accepted."""

    def __init__(self, text: str, address: str, start: int, end: int, help: str) -> None:
        super().__init__(text)
        self.text, self.address, self.start, self.end, self.help = text, address, start, end, help


class Address(NamedTuple):
    """Where a link goes: what carries it and who begins it, then host and port, or serial device and baud rate."""

    way: LinkCarrier
    host: str
    port: int

    @property
    def is_loopback(self) -> bool:
        """Whether the other end is on this machine, by its loopback interface."""
        if self.way is LinkCarrier.SERIAL:
            return False
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    @property
    def capacity(self) -> int | None:
        """Octets a second that the link carries each way; None where the address does not say."""
        return self.port // BITS_OF_AN_OCTET if self.way is LinkCarrier.SERIAL else None

    def __str__(self) -> str:
        return f"{self.way}:{self.host}:{self.port}"


def parse(text: str, ways: Collection[LinkCarrier] = tuple(LinkCarrier)) -> Address:
    """The address in a text, in one of the `ways` that are accepted here. Raises AddressError."""
    accepted = " or ".join(f"`{_EXAMPLES[way]}`" for way in LinkCarrier if way in ways)
    if not text:
        raise AddressError("the address is empty", text, 0, 0, f"write {accepted}")
    word, colon, rest = text.partition(":")
    if word not in [way.value for way in ways]:
        near = nearest(word, [way.value for way in ways])
        found = f"`{word}` is no way to connect here" if word in list(LinkCarrier) else f"`{word}` is no kind of link"
        help = f"did you mean `{near}`?" if near and word not in list(LinkCarrier) else f"write {accepted}"
        raise AddressError(found, text, 0, len(word), help)
    way, begin = LinkCarrier(word), len(word) + 1
    serial = way is LinkCarrier.SERIAL
    place, number = ("device", "baud rate") if serial else ("host", "port")
    example = f"write it as `{_EXAMPLES[way]}`"
    host, second, port = rest.rpartition(":")
    if not colon or not second:
        missing = f"{number} of the link is missing" if rest else f"{place} and {number} of the link are missing"
        raise AddressError(f"the {missing}", text, len(text), len(text), example)
    end = begin + len(host)
    if not host:
        raise AddressError(f"the {place} of the link is missing", text, begin, begin, example)
    if serial:
        if not host.startswith("/") or "\0" in host:
            found = f"`{host}` is no path of a device"
            raise AddressError(found, text, begin, end, f"a device is an absolute path: {example}")
    elif _HOST.fullmatch(host) is None:
        found = f"`{host}` is no host name and no IPv4 address"
        raise AddressError(found, text, begin, end, f"IPv6 is not supported; {example}")
    if _NUMBER.fullmatch(port) is None:
        found = f"`{port}` is no {number}" if port else f"the {number} of the link is missing"
        raise AddressError(found, text, end + 1, len(text), f"a {number} is a number: {example}")
    value = int(port)
    if serial and value not in BAUDS:
        close = min(BAUDS, key=lambda baud: abs(baud - value))
        known = ", ".join(map(str, BAUDS))
        found = f"`{port}` is no baud rate of this system"
        raise AddressError(found, text, end + 1, len(text), f"the nearest is {close}; accepted are {known}")
    if not serial and not 1 <= value <= 65_535:
        raise AddressError(f"`{port}` is no port", text, end + 1, len(text), "a port is from 1 to 65535")
    return Address(way, host, value)
