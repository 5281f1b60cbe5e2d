"""The trust root under which a vehicle flies: the last accepted one, or a successor of it."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua.adapters.store.keystore import KeyStore, read_root
from rtshcua.adapters.store.vehicle_records import RootStore, opened_root, root_in_force
from rtshcua.app.exit_codes import code_of, exit_code_of, untrusted, words_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.wire import cose
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, open_root
from rtshcua.wire.untrusted import Untrusted

REVOKED: Final = "revoked-key"
#: slugs of expiry: a flight that began before may still be brought down
LAPSED: Final = ("expired", "key-expired")
#: the help for a refused root, by slug
HELPS = {
    "version-gap": "also pass the roots in between, the oldest first: `root-N.trust` of the key store",
    "rollback": "the vehicle accepted a newer root: leave `--root` out, or pass the newer one",
    "fork": "a holder of the root key signed two roots of one version: find out who, and replace the key",
    "unknown-key": "a root key of the previous root must sign it; for another fleet's root, use another `--state-dir`",
    REVOKED: "sign it again with the replacement key; `rtshcua keys list` shows the trusted keys",
    "superseded": "run the command again: it uses the root that the vehicle has now",
    "damaged": "restore `trust/` in the state folder; without it, any root that is named is trusted",
}


class Trusted(NamedTuple):
    """The trust root of a flight and its signed octets. `others` are its predecessors, newest first. `store` keeps the
    vehicle's accepted root, which was `accepted`; `keeps`: this root is stored from this flight on, and `news` is the
    note about that.

    `distrust` is the reason why no new flight may begin under it; a vehicle in the air is brought down.
    """

    root: TrustRoot
    signed: bytes
    others: tuple[bytes, ...] = ()
    store: RootStore | None = None
    accepted: bytes | None = None
    keeps: bool = False
    news: str = ""
    distrust: Refusal | None = None

    def before(self, refused: Refusal) -> Iterator["Trusted"]:
        """The roots under which the flight may have begun, if the bundle was `refused` for a revocation or expiry."""
        if refused.slug in (REVOKED, *LAPSED):
            for signed in (self.signed, *self.others):
                with suppress(Untrusted):
                    yield Trusted(opened_root(signed), signed, distrust=self.distrust or refused)

    def superseded(self) -> Refusal | None:
        """The refusal if the vehicle has accepted another root since, which may revoke keys."""
        if self.store is None:
            return None
        try:
            accepted = self.store.kept()
        except (Untrusted, OSError) as error:
            return _refusal(error)
        if accepted not in (self.accepted, self.signed):
            text = f"the vehicle's trust root changed meanwhile: it is no longer version {self.root.version}"
            return Refusal("root-superseded", text, HELPS["superseded"], ExitCode.UNTRUSTED)
        return None

    def settle(self, *, resumed: bool) -> str | Refusal:
        """Store the root as accepted, unless the flight is `resumed`; return a note for the user. Raises OSError if it
        cannot be stored.
        """
        if resumed:
            return f"{self.distrust.text}; the vehicle is brought down anyway" if self.distrust is not None else ""
        refusal = self.distrust or self.superseded()
        if refusal is not None:
            return refusal
        if self.store is not None and self.keeps:
            self.store.keep(self.signed)
        return self.news


def trust(roots: Sequence[Path], data: Path, state: Path, vehicle: str | None, now_us: int) -> Trusted:
    """Select the trust root for a vehicle, from the named roots or else the key store.

    A damaged accepted root, a root that does not follow from it, and an expired root are reported as `distrust`. Raises
    `Untrusted` and OSError for other errors.
    """
    store = None if vehicle is None else RootStore(state, vehicle)
    kept, distrust = None, None
    try:
        kept = None if store is None else store.kept()
    except (Untrusted, OSError) as error:
        distrust = _refusal(error)
    chain = _read_roots(roots, data, needed=kept is None)
    try:
        signed = root_in_force(kept, chain, named=bool(roots), now_us=now_us)
        _open(signed, now_us)
    except Untrusted as error:
        if error.slug in LAPSED:
            signed = root_in_force(kept, chain, named=bool(roots), now_us=0)
            distrust = distrust or untrusted(error)
        elif kept is None or not chain:
            raise
        else:
            signed, distrust = chain[-1], _refusal(error)
    root = opened_root(signed)
    others = tuple(each for each in (*reversed(chain), kept) if each not in (None, signed))
    keeps = store is not None and signed != kept and not (kept is None and root.development)
    news = succession_note(opened_root(kept), root) if distrust is None and keeps and kept is not None else ""
    return Trusted(root, signed, others, store, kept, keeps, news, distrust)


def _read_roots(roots: Sequence[Path], data: Path, *, needed: bool) -> list[bytes]:
    """Read the named roots, else those of the key store if it exists or is needed."""
    if roots:
        return [_read_root_file(path) for path in roots]
    store = KeyStore(data)
    return store.chain() if needed or store.exists() else []


def _read_root_file(path: Path) -> bytes:
    """Read a root from a file and check its form only. Raises `Untrusted` with the file's name, and OSError."""
    signed = read_root(path)
    try:
        cose.unverified(signed, limit=MAX_ROOT)
    except Untrusted as error:
        raise Untrusted(error.slug, f"`{path}` is no trust root: {error}") from None
    return signed


def _refusal(error: Untrusted | OSError) -> Refusal:
    if isinstance(error, OSError):
        return Refusal("unread", f"{words_of(error)}: `{error.filename}`", HELPS["damaged"], exit_code_of(error))
    help = HELPS.get(error.slug) or untrusted(error).help
    return Refusal(f"root-{error.slug}", str(error), help, code_of(error.slug))


def _open(signed: bytes, now_us: int) -> TrustRoot:
    return open_root(signed, pinned=cose.unverified(signed, limit=MAX_ROOT).kid, now_us=now_us)


def succession_note(before: TrustRoot, root: TrustRoot) -> str:
    """The note that a vehicle accepted `root` in place of `before`."""
    gone = len(root.revocations - before.revocations)
    revoked = f"; it revokes {gone} more key{'s' * (gone > 1)}" if gone else ""
    return f"trust root version {root.version} replaces version {before.version}{revoked}"
