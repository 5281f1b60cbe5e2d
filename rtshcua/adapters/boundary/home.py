"""The homes of the boundary outside of the runtime: a common interface, and the first message of each."""

import time
from collections.abc import Sequence
from errno import ENOSPC
from hashlib import sha256
from pathlib import Path
from struct import Struct
from typing import Final
from urllib.parse import quote

from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, create_whole, lock, make_folder
from rtshcua.onboard.enforcement.ahead import MOST
from rtshcua.onboard.enforcement.isolated import MAX_PART
from rtshcua.wire.keys import PUBLIC_BYTES

#: the time to start, and to load a bundle with its whole mission, in s;
PATIENCE_S: Final = 20.0
#: the time for any other answer: a boundary that does not answer counts as lost, while the vehicle flies
ANSWER_S: Final = 1.0
#: the time for the boundary of a killed run to write its state and end
ENDING_S: Final = 2.0
_FIRST: Final = Struct(f"<Qq{PUBLIC_BYTES}s")
_FIRST_LAYOUT: Final = 0x7274736863756100
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


def first_kept(since_us: int = 0, public: bytes = bytes(PUBLIC_BYTES)) -> bytes:
    """The initial content of a boundary's file (`rt_kept_first` of boundary/enforcement/kept.h); an empty file is
    damage. It opens no mission that was issued before `since_us` (UTC), and belongs to a boundary with this public key,
    or to any.
    """
    said = _FIRST.pack(_FIRST_LAYOUT, since_us, public)
    return said + sha256(said).digest()


def hold_kept(state: Path, vehicle: str) -> int:
    """Make the file of a vehicle's state at the first start, and lock it: one boundary has a vehicle, in any home.

    Returns the open file. The boundary of a run that was killed is awaited. Raises BoundaryError and OSError.
    """
    place = kept_file(state, vehicle)
    make_folder(place.parent, mode=PRIVATE_FOLDER)
    try:
        create_whole(place, first_kept(), mode=PRIVATE_FILE)
    except OSError as error:
        if error.errno == ENOSPC:
            raise not_kept(f"`{place}`") from None
        raise
    until_s = time.monotonic() + ENDING_S
    while True:
        try:
            return lock(place)
        except BlockingIOError:
            if time.monotonic() > until_s:
                text = f"another run's boundary has locked the records of `{vehicle}`"
                raise BoundaryError("in-use", text, "wait until that run ends") from None
            time.sleep(0.02)


def not_kept(kept: str, help: str = "") -> BoundaryError:
    """The error when the state of a vehicle cannot be kept; `kept` names it."""
    return BoundaryError("not-kept", f"{kept} cannot be read or written, or the disk is full", help)


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
