"""The root key that an auditor trusts: named on the command line, or the key store's own."""

import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore, read_root
from rtshcua.app.exit_codes import remedy
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.audit.revoked_keys import RevokedKeys
from rtshcua.wire import cose
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, open_root
from rtshcua.wire.untrusted import Untrusted

_KEY = re.compile(r"[0-9a-fA-F]{64}|[0-9a-fA-F]{32}")
_TEXT = 200  # bytes of a file that may hold a key as text


class Pin(NamedTuple):
    """The public key of a root or its `kid`, and its origin as text. `roots` are signed trust roots found with it."""

    key: bytes
    source: str
    roots: tuple[bytes, ...] = ()


def pin(given: str | None) -> Pin:
    """The pin for `--root GIVEN`: a key or `kid` in hexadecimal, a file with one, or a signed trust root.

    Without one it is the key store's root. Raises `Untrusted` (`no-keys`, `no-pin`, ...) and OSError.
    """
    if given is None:
        store = KeyStore(data_folder())
        root = open_root(store.root(), pinned=store.pin(), now_us=0)
        return Pin(store.pin(), f"{_kind(root)} of your key store, {store.root_path}", tuple(store.chain()))
    if _KEY.fullmatch(given):
        return Pin(bytes.fromhex(given), "the key on the command line")
    path = Path(given)
    data = read_root(path)
    text = data[:_TEXT].decode("ascii", "replace").strip()
    if len(data) < _TEXT and _KEY.fullmatch(text):
        return Pin(bytes.fromhex(text), f"the key in {path}")
    try:
        kid = cose.unverified(data, limit=MAX_ROOT).kid
        root = open_root(data, pinned=kid, now_us=0)
    except Untrusted as error:
        if data.startswith(b"duty: root"):
            raise Untrusted("no-pin", f"`{path}` is its secret half: give `{path.with_suffix('.trust')}`") from None
        raise Untrusted("no-pin", f"`{path}` is neither a root key nor a trust root: {error}") from None
    return Pin(kid, f"{_kind(root)} in {path}", (data,))


def trusted(given: str | None, revocations: Iterable[Path] = ()) -> Pin | Refusal:
    """The pin for `--root GIVEN`, with the trust roots in `revocations`; a refusal if there is no usable root. Raises
    OSError.
    """
    try:
        found = pin(given)
        roots = (*found.roots, *map(read_root, revocations))
        RevokedKeys(roots)
    except Untrusted as error:
        help = (
            "name the trust root of the flight's operator, or its public key, with `--root`"
            if error.slug == "no-keys"
            else ""
        )
        return Refusal(error.slug, f"no root to trust: {error}", help or remedy(error))
    return found._replace(roots=roots)


def _kind(root: TrustRoot) -> str:
    return "the development root" if root.development else "the trust root"
