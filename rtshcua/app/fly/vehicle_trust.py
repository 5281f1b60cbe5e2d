"""Under which trust root a vehicle flies: the one that it accepted last, or one that follows from it."""

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
#: why what was good once is not any more: what began to fly under it comes down all the same
LAPSED: Final = ("expired", "key-expired")
#: what to do where a root is refused, by slug
HELPS = {
    "version-gap": "give the roots between too, from the oldest to the newest: `root-N.trust` of the key store",
    "rollback": "the vehicle accepted a newer root: leave `--root` out, or give that one",
    "fork": "whoever has the root key signed two roots of one version: find out who, and change it",
    "unknown-key": "a root follows from the one before; another fleet's root takes another `--state-dir`",
    REVOKED: "sign it again, with the key that took its place; `rtshcua keys list` shows what is trusted",
    "superseded": "begin again: the run goes by the root that the vehicle has now",
    "damaged": "put `trust/` of the state folder right; without it, whatever root is named is trusted",
}


class Trusted(NamedTuple):
    """The root to fly under, with its signed bytes, and the `others` that lead to it or were accepted before it, newest
    first. `store` is where the vehicle keeps what it accepted, `accepted` what lay there, and `keeps` says that this
    one is to be kept there from this flight on; `news` is what there is to tell then.

    `distrust` says why nothing may fly under it that is not in the air already.
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
        """The roots under which the bundle may have begun to fly, where something was revoked or has expired since."""
        if refused.slug in (REVOKED, *LAPSED):
            for signed in (self.signed, *self.others):
                with suppress(Untrusted):
                    yield Trusted(opened_root(signed), signed, distrust=self.distrust or refused)

    def superseded(self) -> Refusal | None:
        """Why nothing new flies under it: the vehicle accepted another root since, which may revoke keys."""
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
        """What there is to tell. The vehicle accepts the root, unless it is in the air and comes down as it began.
        Raises OSError where that cannot be kept.
        """
        if resumed:
            return f"{self.distrust.text}; it is brought down all the same" if self.distrust is not None else ""
        refusal = self.distrust or self.superseded()
        if refusal is not None:
            return refusal
        if self.store is not None and self.keeps:
            self.store.keep(self.signed)
        return self.news


def trust(roots: Sequence[Path], data: Path, state: Path, vehicle: str | None, now_us: int) -> Trusted:
    """The trust root for a vehicle, of those that were named, else of the key store's.

    Raises `Untrusted` and OSError; but what is the matter with the root that was accepted last, what does not follow
    from it, and what has expired, is `distrust`.
    """
    store = None if vehicle is None else RootStore(state, vehicle)
    kept, distrust = None, None
    try:
        kept = None if store is None else store.kept()
    except (Untrusted, OSError) as error:
        distrust = _refusal(error)
    chain = _given(roots, data, needed=kept is None)
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
    news = told(opened_root(kept), root) if distrust is None and keeps and kept is not None else ""
    return Trusted(root, signed, others, store, kept, keeps, news, distrust)


def _given(roots: Sequence[Path], data: Path, *, needed: bool) -> list[bytes]:
    """The roots that were named, else those of the key store, if it is there or needed."""
    if roots:
        return [_named(path) for path in roots]
    store = KeyStore(data)
    return store.chain() if needed or store.exists() else []


def _named(path: Path) -> bytes:
    """The root in a file, of which only the form is looked at. Raises `Untrusted`, naming the file, and OSError."""
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


def told(before: TrustRoot, root: TrustRoot) -> str:
    """What a vehicle accepted, in a line."""
    gone = len(root.revocations - before.revocations)
    revoked = f"; it revokes {gone} key{'s' * (gone > 1)} more" if gone else ""
    return f"trust root version {root.version} is accepted in the place of version {before.version}{revoked}"
