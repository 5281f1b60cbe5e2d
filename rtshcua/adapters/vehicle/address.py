"""Link addresses as MAVLink tools write them: `udpin:HOST:PORT` listens, `udpout:HOST:PORT` sends first."""

import re
from ipaddress import ip_address
from typing import NamedTuple

_SHAPE = re.compile(r"(udpin|udpout):([^:\[\]\s]+):(\d{1,5})", re.ASCII)


class Address(NamedTuple):
    """Where a link goes: who begins it, the host, the UDP port."""

    way: str
    host: str
    port: int

    @property
    def is_loopback(self) -> bool:
        """Whether the host is this machine's own loopback."""
        try:
            return ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"

    def __str__(self) -> str:
        return f"{self.way}:{self.host}:{self.port}"


def parse(text: str) -> Address:
    """The address in a text. Raises ValueError with what is wrong, for a person."""
    match = _SHAPE.fullmatch(text)
    if match is None:
        raise ValueError(f"`{text}` is no address; one looks like `udpin:127.0.0.1:14550`")
    port = int(match[3])
    if not 1 <= port <= 65_535:
        raise ValueError(f"`{port}` is no UDP port; one is from 1 to 65535")
    return Address(match[1], match[2], port)
