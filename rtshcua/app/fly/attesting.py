"""The boundary's key and its sessions, for a flight: what it signs its own evidence with."""

from collections.abc import Callable
from contextlib import suppress
from errno import ENOSPC
from pathlib import Path

from rtshcua.adapters.store.boundary import BoundaryStore, DamagedState
from rtshcua.app.exit_codes import code_of, untrusted
from rtshcua.app.fly.refused import Refused
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.onboard.ports import BoundaryKey
from rtshcua.wire.boundary_chain import START
from rtshcua.wire.keys import Duty, SigningKey, key_id
from rtshcua.wire.trust import TrustRoot, key_refusal
from rtshcua.wire.untrusted import Untrusted

_HELP = "`--boundary-key` gives one that it names; `rtshcua keys boundary` makes it"
#: what is said of a flight that nothing inside signs
UNNAMED = "the trust root names no boundary key for it: what is decided is not signed inside (`rtshcua keys boundary`)"


def boundary_key(
    root: TrustRoot, vehicle: str, now_us: int, unlock: Callable[[Duty, Path | None], SigningKey], path: Path | None
) -> SigningKey | None:
    """The key that the boundary signs with; None where the root asks for none. Raises `Refused`."""
    good = _named(root, vehicle, now_us)
    if not good:
        return None
    try:
        key = unlock(Duty.BOUNDARY, path)
    except Untrusted as error:
        raise Refused(code_of(error.slug), *untrusted(error)) from None
    except FileNotFoundError as error:
        text = f"the trust root asks for what the boundary signs, and its key is not here: `{error.filename}`"
        raise Refused(ExitCode.INPUT, "no-boundary-key", text, _HELP) from None
    _expect_named(key.kid, good, vehicle)
    return key


class Elsewhere:
    """In place of the boundary's key: the boundary's process has it, and nobody here."""


def elsewhere(root: TrustRoot, vehicle: str, now_us: int, public: bytes | None) -> Elsewhere | None:
    """What stands for the key of a boundary that listens, of which it said the public half, None where it has none;
    None where the root asks for none. Raises `Refused`.
    """
    good = _named(root, vehicle, now_us)
    if not good:
        return None
    if public is None:
        text = "the trust root asks for what the boundary signs, and the boundary has no key"
        raise Refused(
            ExitCode.INPUT, "no-boundary-key", text, "`boundary.seed` of its folder; `rtshcua keys provision`"
        )
    _expect_named(key_id(Duty.BOUNDARY, public), good, vehicle)
    return Elsewhere()


def _named(root: TrustRoot, vehicle: str, now_us: int) -> set[bytes]:
    """The boundary keys that the root trusts for a vehicle now."""
    named = root.keys_for(Duty.BOUNDARY)
    return {kid for kid, key in named.items() if key_refusal(key, vehicle=vehicle, now_us=now_us) is None}


def _expect_named(kid: bytes, good: set[bytes], vehicle: str) -> None:
    if kid not in good:
        text = f"the trust root names no boundary key {kid.hex()} for `{vehicle}`: nobody could verify the log"
        raise Refused(ExitCode.UNTRUSTED, "unknown-key", text, _HELP)


class BoundarySession:
    """One flight's session of a boundary, with or without a key. `note` is what there is to tell of it."""

    def __init__(self, store: BoundaryStore, key: SigningKey | Elsewhere | None, *, aloft: bool) -> None:
        """Raises `Refused`, and OSError, where nobody knows which session came before; but not for a vehicle that is
        `aloft`, which comes down whatever the state folder says.
        """
        self.note = ""
        self._store = store
        self._aloft = aloft
        held = key if isinstance(key, SigningKey) else None
        self.key = None if key is None else BoundaryKey(held, *self._next())
        self._session = 0 if self.key is None else self.key.session

    def _next(self) -> tuple[int, bytes]:
        try:
            kept = self._store.kept()
        except (DamagedState, OSError) as error:
            if self._aloft:
                self.note = f"{error}; it is brought down all the same"
                return 0, START
            if isinstance(error, OSError):
                raise
            help = "without that file the boundary begins to count anew, and no log shows that it did not before"
            raise Refused(ExitCode.INPUT, "damaged", str(error), help) from None
        return kept.session + 1, kept.digest

    def begun(self, digest: bytes, session: int | None) -> None:
        """The session began, under this number: a boundary of its own process counts itself. Raises OSError where none
        began, or that cannot be kept; not for a vehicle that is `aloft`.
        """
        if self.key is not None and session is None and not self._aloft:
            raise OSError(ENOSPC, "the boundary's process cannot keep that its session begins")
        if self.key is not None and session is not None and session != self._session:
            self.note = (
                f"the state folder counts {max(0, self._session - 1)} sessions of the boundary, its own process "
                f"{session - 1}: the folder was put back to what it was, or lost"
            )
            self._session = session
        try:
            self._keep(digest)
        except OSError:
            if not self._aloft:
                raise

    def ended(self, digest: bytes) -> None:
        """It ended in order. Where that cannot be kept, the next one takes it for broken off."""
        with suppress(OSError):
            self._keep(digest)

    def _keep(self, digest: bytes) -> None:
        if self.key is not None and self.key.session:  # what is damaged stays so, for a person to see
            self._store.keep(self._session, digest)
