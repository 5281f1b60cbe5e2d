"""The trust root that a vehicle accepted last: none older, and none that does not follow from it, is taken again.

    <state folder>/trust/vehicle-<identity>        the signed root

It is there from the first flight under a root that is not for development on, or from `rtshcua keys accept` on. That
the whole folder was put back to what it was earlier, or removed, is told by nothing here.
"""

from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from rtshcua.adapters.store.reading import read_if_there
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, replace
from rtshcua.wire import cose
from rtshcua.wire.trust import MAX_ROOT, RootError, TrustRoot, follow, open_root
from rtshcua.wire.untrusted import Untrusted


class RootStore:
    """The root of the vehicle called `vehicle` (its identity)."""

    def __init__(self, state: Path, vehicle: str) -> None:
        self.path = state / "trust" / f"vehicle-{quote(vehicle, safe='')}"

    def kept(self) -> bytes | None:
        """The signed root that was accepted last, if one was. Raises `RootError` (`damaged`) and OSError."""
        data = read_if_there(self.path, MAX_ROOT)
        try:
            if data is not None:
                opened(data)
        except Untrusted as error:
            raise RootError("damaged", f"the root that was accepted last, `{self.path}`, is damaged: {error}") from None
        return data

    def keep(self, signed: bytes) -> None:
        """Remembers a root, once it is on the disk. Raises OSError."""
        make_folder(self.path.parent, mode=PRIVATE_FOLDER)
        replace(self.path, signed, mode=PRIVATE_FILE)


def opened(signed: bytes) -> TrustRoot:
    """A root that is trusted for where it was found, expired or not. Raises `Untrusted`."""
    return open_root(signed, pinned=cose.unverified(signed, limit=MAX_ROOT).kid, now_us=0)


def in_force(kept: bytes | None, chain: Sequence[bytes], *, named: bool, now_us: int) -> bytes:
    """The root that counts, of what a vehicle accepted last and of roots from the oldest to the newest.

    Roots that are `named` must lead from the accepted one to a newer one, or be it; where nothing was accepted, the
    first is trusted for being named. A key store's, which nobody named, may lag behind. Raises `Untrusted`.
    """
    if kept is None:
        first, *newer = chain if named else chain[-1:]
        opened(first)
        return follow(newer, current=first, now_us=now_us)
    if not named and (not chain or opened(chain[-1]).version < opened(kept).version):
        chain = ()
    return follow(chain, current=kept, now_us=now_us)
