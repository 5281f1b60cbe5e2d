"""A trust root, a key store, and a key file: never its secret."""

import json

from rtshcua.adapters.link_setup import SetUp, after_setup
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.app.wording import utc
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.cli.width import columns
from rtshcua.wire import cose, key_file
from rtshcua.wire.keys import ANY, Duty, VerificationKey
from rtshcua.wire.trust import LINK_ID_BYTES, MAX_ROOT, TrustRoot, open_root

#: how a key file begins
KEY_FILE = b"duty: "


def show_root(page: TextPage, data: bytes, now_us: int) -> dict[str, object]:
    """Adds a trust root to the page. Its own signature is checked; whose it is, only a pin can tell.

    Raises `Untrusted`.
    """
    kid = cose.unverified(data, limit=MAX_ROOT).kid
    root = open_root(data, pinned=kid, now_us=0)
    over = " (expired)" if now_us >= root.expires_at_us else ""
    page.head("Development root: its keys are not encrypted" if root.development else "Trust root")
    page.row("version", str(root.version))
    page.row("signed by", f"{kid.hex()}; compare it with the pin of the operator")
    page.row("valid", f"{utc(root.issued_at_us)} to {utc(root.expires_at_us)}{over}")
    page.head("Keys")
    for key in root.keys:
        page.row(key.duty, key.kid.hex(), width=9)
        page.row("", f"public {key.public.hex()}", width=9)
        page.row("", speaks(key), width=9)
    page.rows("revoked", [name.hex() for name in sorted(root.revocations)], width=9)
    if root.witness_threshold > 1:
        page.row("anchored", f"what {root.witness_threshold} witnesses cosigned", width=9)
    return {
        "kind": "root",
        "version": root.version,
        "development": root.development,
        "issued_at_us": root.issued_at_us,
        "expires_at_us": root.expires_at_us,
        "signed_by": kid.hex(),
        "witness_threshold": root.witness_threshold,
        "revoked": [name.hex() for name in sorted(root.revocations)],
        "keys": [as_object(key) for key in root.keys],
    }


def show_key(page: TextPage, data: bytes) -> dict[str, object]:
    """Adds a key file to the page. An encrypted one keeps its name to itself: the passphrase is not asked for.

    Raises `Untrusted`.
    """
    first = data.partition(b"\n")[0]
    duty = next((duty for duty in Duty if first == KEY_FILE + duty.encode()), None)
    if duty is None:
        raise key_file.KeyFileError("malformed", "a key file begins with the duty of its key")
    try:
        key = key_file.load_signing_key(data, duty=duty, passphrase=None)
    except key_file.KeyFileError as error:
        if error.slug != "passphrase-needed":
            raise
        page.head(f"Signing key of duty {duty}, encrypted")
        page.row("key", "named in the trust root beside it; `rtshcua keys list` shows the key store's")
        return {"kind": "key", "duty": duty, "encrypted": True}
    page.head(f"Signing key of duty {duty}, for development: not encrypted, its secret is not shown")
    page.row("key", key.kid.hex())
    page.row("public", key.public.hex())
    shown = {"duty": duty, "kid": key.kid.hex(), "public": key.public.hex(), "development": key.development}
    return {"kind": "key", "encrypted": False, **shown}


def as_object(key: VerificationKey) -> dict[str, object]:
    """A public key for a program."""
    return {
        "duty": key.duty,
        "kid": key.kid.hex(),
        "public": key.public.hex(),
        "roles": key.roles,
        "sources": key.sources,
        "vehicles": key.vehicles,
        "policies": key.policies,
        "expires_us": key.expires_us,
        "development": key.development,
    }


def speaks(key: VerificationKey) -> str:
    """What a key may speak for."""
    if key.duty is Duty.ROOT:
        return "names the other keys"
    if key.duty is Duty.WITNESS:
        until = "" if key.expires_us is None else f", until {utc(key.expires_us)}"
        return f"cosigns logs of {_any(key.vehicles, 'vehicle')}{until}"
    if key.duty is Duty.BOUNDARY:
        until = "" if key.expires_us is None else f", until {utc(key.expires_us)}"
        return f"signs what was decided, on {_any(key.vehicles, 'vehicle')}{until}"
    if key.duty is Duty.APPROVAL:
        until = "" if key.expires_us is None else f", until {utc(key.expires_us)}"
        return f"{key.person} in person as {key.roles[0]}, on {_any(key.vehicles, 'vehicle')}{until}"
    who = f"{_any(key.roles, 'role')} through {' or '.join(key.sources)}, " if key.roles else ""
    until = "" if key.expires_us is None else f", until {utc(key.expires_us)}"
    under = f"under {_any(key.policies, 'policy')}, " if key.duty is Duty.MISSION else ""
    return f"{who}{under}on {_any(key.vehicles, 'vehicle')}{until}"


def _any(names: tuple[str, ...], what: str) -> str:
    return f"any {what}" if ANY in names else f"{what} {', '.join(names)}"


def show_store(store: KeyStore, root: TrustRoot, *, as_json: bool) -> None:
    """Prints the keys of a key store, and what its trust root trusts them for."""
    if as_json:
        out_json(json.dumps(_store_object(store, root), indent=2, ensure_ascii=False))
        return
    kind = "development root: not for production, its keys are not encrypted" if root.development else "trust root"
    out(kind, f"  folder   {store.folder}", f"  version  {root.version}")
    out(f"  valid    {utc(root.issued_at_us)} to {utc(root.expires_at_us)}", "")
    names = {kid: path.name for kid, path in store.paths(root).items()}
    wide = max(map(len, names.values()))
    rows = [("duty", "key", "file", "may sign for")]
    rows += ((key.duty, key.kid.hex(), names[key.kid], speaks(key)) for key in root.keys)
    for name in sorted(root.revocations):
        what = "link key" if len(name) == LINK_ID_BYTES else "revoked permanently"
        rows.append(("revoked", name.hex(), "", what))
    beside = 2 + 10 + 34 + wide + 2 + max(len(row[3]) for row in rows) <= columns()
    for duty, key_name, file, last in rows:
        first = f"  {duty:<9} {key_name:<33} {file:<{wide}}"
        out(*([f"{first}  {last}"] if beside else [first.rstrip(), f"  {'':<9} {last}"]))
    if root.witness_threshold > 1:
        out("", f"  {root.witness_threshold} witnesses must cosign a record for it to be anchored")


def _store_object(store: KeyStore, root: TrustRoot) -> dict[str, object]:
    paths = store.paths(root)
    return {
        "folder": str(store.folder),
        "root": str(store.root_path),
        "development": root.development,
        "version": root.version,
        "issued_at_us": root.issued_at_us,
        "expires_at_us": root.expires_at_us,
        "witness_threshold": root.witness_threshold,
        "revoked": sorted(name.hex() for name in root.revocations),
        "keys": [{**as_object(key), "file": str(paths[key.kid])} for key in root.keys],
    }


def link_lines(seen: SetUp) -> list[str]:
    """What was seen of a vehicle that was given the key of its link."""
    release = "of an unknown release" if seen.release is None else ".".join(map(str, seen.release))
    did = "has this key, so none was sent" if seen.already else "disarmed, on the ground; the key was sent"
    yes = {True: "yes", False: "no"}
    return [
        f"{seen.autopilot} {release}, system {seen.system}: {did}",
        f"  signs what it sends           {yes[seen.signs]}",
        f"  answers a signed request      {yes[seen.answers_signed]}",
        f"  answers an unsigned request   {yes[seen.answers_unsigned]}",
        *(f"  reported                      `{text}`" for text in seen.texts),
        f"  {after_setup(seen.autopilot, seen.release)}",
    ]
