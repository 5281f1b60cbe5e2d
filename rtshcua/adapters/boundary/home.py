"""The homes of the boundary outside of the runtime: a common interface, and the first message of each."""

from collections.abc import Sequence
from pathlib import Path
from struct import Struct
from typing import Final
from urllib.parse import quote

from rtshcua.onboard.enforcement.ahead import MOST
from rtshcua.onboard.enforcement.isolated import MAX_PART
from rtshcua.wire.keys import PUBLIC_BYTES

#: the time to start, and to load a bundle with its whole mission, in s;
PATIENCE_S: Final = 20.0
#: the time for any other answer: a boundary that does not answer counts as lost, while the vehicle flies
ANSWER_S: Final = 1.0
#: the first message (boundary/home/common.h): measures in force, name of the link's key, public halves of the log's
#: key and of its own, whether its clock counts
_GREETING: Final = Struct(f"<I8s{PUBLIC_BYTES}s{PUBLIC_BYTES}s?")
GREETING_BYTES: Final = _GREETING.size


class BoundaryError(Exception):
    """A boundary did not start: `missing`, `in-use`, `damaged`, `not-kept`, `untrusted`, `not-begun`."""

    def __init__(self, slug: str, text: str, help: str = "") -> None:
        super().__init__(text)
        self.slug = slug
        self.help = help


def kept_file(state: Path, vehicle: str) -> Path:
    """The file of a boundary's state for a vehicle, in a state folder."""
    return state / "boundary" / f"vehicle-{quote(vehicle, safe='')}.kept"


class BoundaryHome:
    """A boundary outside of the runtime, with the content of its first message."""

    #: the name of the link's key, and the public halves of the log's key and of its own, None for those it has not
    link_name: bytes | None
    log_public: bytes | None
    own_public: bytes | None
    #: whether it decides by its own clock; otherwise the caller's time counts, as for a vehicle that runs faster
    own_clock: bool
    #: octets of a bundle or a document in one call, and frames that are signed ahead in one
    part = MAX_PART
    most_ahead = MOST

    def call(self, octets: bytes) -> bytes:
        """Make one call. Raises OSError without an answer; an empty answer means that the boundary is lost."""
        raise NotImplementedError

    def close(self) -> None:
        """End it."""
        raise NotImplementedError

    @property
    def missing(self) -> Sequence[str]:
        """The measures of isolation that are not in force, as texts."""
        return ()

    def _read_greeting(self, greeting: bytes) -> int:
        """Read the first message; returns the measures in force."""
        measures, link, log, own, self.own_clock = _GREETING.unpack(greeting)
        self.link_name, self.log_public, self.own_public = (each if any(each) else None for each in (link, log, own))
        return int(measures)
