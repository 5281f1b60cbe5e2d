"""Signing keys for commands: from the key store or a file, with a passphrase asked for only where one is needed."""

import sys
from collections.abc import Iterable
from contextlib import suppress
from getpass import getpass
from pathlib import Path

from rtshcua.adapters.store.keystore import PROPOSERS, KeyStore, KeyStoreError, read_key, whose
from rtshcua.adapters.store.reading import exposed
from rtshcua.app.exit_codes import untrusted
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.interrupts import breakable
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire.bundle import BundleError, check_proposer
from rtshcua.wire.key_file import KeyFileError
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey
from rtshcua.wire.trust import TrustRoot, key_refusal, open_root
from rtshcua.wire.untrusted import Untrusted

#: octets of a passphrase, in a file
_LONGEST = 4096


def unlock(
    store: KeyStore, duty: Duty, *, path: Path | None = None, passphrase_file: Path | None = None, whose: str = ""
) -> SigningKey:
    """The key of a duty, from `path` or else the store; of several of a duty the one of `whose`.

    An encrypted key is opened with the content of `passphrase_file` without its line ending, or with what a person
    types at the terminal. Raises `Untrusted` (`no-keys`, `exposed`, `passphrase-needed`, ...) and OSError.
    """
    given = None if passphrase_file is None else read_passphrase(passphrase_file)
    try:
        return _load(store, duty, path, given, whose)
    except KeyFileError as error:
        if error.slug != "passphrase-needed" or given is not None or not terminal():
            raise
    with breakable():  # the terminal shows again what is typed
        typed = getpass(f"passphrase of the `{duty}` key: ").encode()
    return _load(store, duty, path, typed, whose)


def unlock_for(
    store: KeyStore,
    mission: Mission,
    *,
    path: Path | None = None,
    passphrase_file: Path | None = None,
    policy: Policy | None = None,
) -> SigningKey:
    """The mission key that is for what this mission's source proposes; under a `policy`, the first of the store's keys
    that may sign it, if one may.
    """
    if path is None and policy is not None:
        path = _fitting(store, policy, mission)
    source = next((SourceKind(each.source).name.lower() for each in mission.invocations), PROPOSERS[0])
    return unlock(store, Duty.MISSION, path=path, passphrase_file=passphrase_file, whose=source)


def _fitting(store: KeyStore, policy: Policy, mission: Mission) -> Path | None:
    if not store.exists():
        return None
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    paths = store.paths(root)
    for kid, key in root.keys_for(Duty.MISSION).items():
        if kid in paths and paths[kid].is_file():
            with suppress(BundleError):
                check_proposer(key, policy, mission.invocations, now_us=0)
                return paths[kid]
    return None


def unlock_person(
    store: KeyStore,
    person: str | None,
    role: str | None,
    *,
    path: Path | None = None,
    passphrase_file: Path | None = None,
) -> SigningKey:
    """The approval key of a person (None: of the only one) in a role (None: in whatever one), from `path` or the store.

    Raises `Untrusted` (`no-approver`, `several-approvers`, ...) and OSError.
    """
    if path is not None:
        return unlock(store, Duty.APPROVAL, path=path, passphrase_file=passphrase_file)
    key = person_key(store, person, role)
    return unlock(store, Duty.APPROVAL, whose=whose(key), passphrase_file=passphrase_file)


def person_key(store: KeyStore, person: str | None, role: str | None) -> VerificationKey:
    """Which approval key of the store that is, without opening it: whoever is asked to sign should know it before.

    Raises `Untrusted` (`no-approver`, `several-approvers`, ...) and OSError.
    """
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    keys = [
        key
        for key in root.keys_for(Duty.APPROVAL).values()
        if person in (None, key.person) and role in (None, *key.roles)
    ]
    who = f"{person or 'anybody'} as {role or 'anything'}"
    if not keys:
        raise KeyStoreError("no-approver", _no_approver(root, person, role, who))
    if len({key.person for key in keys}) > 1:
        names = ", ".join(f"`{each}`" for each in sorted({key.person for key in keys}))
        raise KeyStoreError("several-approvers", f"there are approval keys of {names}: `--as NAME` says whose to use")
    return keys[0]


def _no_approver(root: TrustRoot, person: str | None, role: str | None, who: str) -> str:
    """That there is no such approval key, or that the person's may sign for other roles, in words."""
    own = {one for key in root.keys_for(Duty.APPROVAL).values() if person == key.person for one in key.roles}
    if person is None or not own:
        return f"there is no approval key of {who}: `rtshcua keys approver` makes one"
    may = ", ".join(f"`{one}`" for one in sorted(own))
    return f"the key of {person} may not sign as {role}, but as {may}: `rtshcua keys approver` makes another"


def check_trusted(store: KeyStore, key: SigningKey, policy: Policy, mission: Mission) -> None:
    """Whether the store's trust root, if it names the key, lets it sign this mission: who flies it would ask.

    Raises `BundleError`.
    """
    if not store.exists():
        return
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    named = root.keys_for(Duty.MISSION).get(key.kid)
    if named is not None:
        check_proposer(named, policy, mission.invocations, now_us=0)


def strangers(store: KeyStore, keys: Iterable[SigningKey], vehicle: str, now_us: int) -> list[str]:
    """Which keys the store's trust root, if there is one, does not let speak for the vehicle, in words: with this root
    no run takes what they sign. The vehicle may have another one.
    """
    if not store.exists():
        return []
    root = open_root(store.root(), pinned=store.pin(), now_us=0)
    told = []
    for key in keys:
        named = root.keys_for(key.duty).get(key.kid)
        refusal = None if named is None else key_refusal(named, vehicle=vehicle, now_us=now_us)
        if key.kid in root.revocations:
            why = "revokes it"
        elif named is None:
            why = f"names no {key.duty} key of this name"
        elif refusal is not None:
            why = f"does not let it speak for `{vehicle}` now ({refusal})"
        else:
            continue
        told.append(
            f"the trust root of this key store {why}: {key.kid.hex()}; `run` with this root refuses the bundle, and "
            "takes it with one that names the key (`--root`)"
        )
    return told


def another_key(error: Untrusted, policy: Policy, mission: Mission) -> Refusal:
    """Why a mission key may not sign a mission, with what makes one that may."""
    if error.slug not in ("wrong-source", "wrong-role", "key-other-policy") or not mission.invocations:
        return untrusted(error)
    first = mission.invocations[0]
    source, role = SourceKind(first.source).name.lower(), policy.roles[first.role]
    make = f"`rtshcua keys mission {source} --role {role} --policy {policy.name}` makes one that may"
    return Refusal(error.slug, str(error), make)


def read_passphrase(path: Path) -> bytes:
    """The passphrase in a file, or from a pipe, that nobody else may read: its content without the line ending.

    Raises `KeyStoreError` (`exposed`, `too-large`) and OSError.
    """
    with path.open("rb") as file:
        if why := exposed(file):
            raise KeyStoreError("exposed", f"others may read the passphrase in `{path}`: {why}")
        data = file.read(_LONGEST + 1)
    if len(data) > _LONGEST:
        raise KeyStoreError("too-large", f"`{path}` is longer than any passphrase, {_LONGEST} octets")
    return data.rstrip(b"\r\n")


def _load(store: KeyStore, duty: Duty, path: Path | None, passphrase: bytes | None, whose: str) -> SigningKey:
    if path is not None:
        return read_key(path, duty, passphrase=passphrase)
    return store.signing_key(duty, passphrase=passphrase, whose=whose)


def terminal() -> bool:
    """Whether a person can be asked."""
    return sys.stdin is not None and sys.stdin.isatty()
