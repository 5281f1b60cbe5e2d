"""Load signing keys for commands from the key store or a file; prompt for a passphrase only if the key has one."""

import sys
from getpass import getpass
from pathlib import Path

from rtshcua.adapters.store.keystore import PROPOSERS, KeyStore, KeyStoreError, read_key, whose
from rtshcua.adapters.store.reading import exposed
from rtshcua.app.signing_keys import fitting_key, person_key
from rtshcua.front.cli.interrupts import breakable
from rtshcua.model.flat.contract import SourceKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.wire.key_file import KeyFileError
from rtshcua.wire.keys import Duty, SigningKey

#: limit of a passphrase file, bytes
_LONGEST = 4096


def unlock(
    store: KeyStore, duty: Duty, *, path: Path | None = None, passphrase_file: Path | None = None, whose: str = ""
) -> SigningKey:
    """Return the key of a duty from `path` or the store; `whose` selects one of several keys of the duty.

    An encrypted key is decrypted with the content of `passphrase_file`, without its line ending, or with a passphrase
    typed at the terminal. Raises `Untrusted` (`no-keys`, `exposed`, `passphrase-needed`, ...) and OSError.
    """
    given = None if passphrase_file is None else read_passphrase(passphrase_file)
    try:
        return _load(store, duty, path, given, whose)
    except KeyFileError as error:
        if error.slug != "passphrase-needed" or given is not None or not terminal():
            raise
    with breakable():  # Ctrl-C raises, so that getpass restores the terminal's echo
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
    """Return the mission key for the mission's source; with `policy`, the first key of the store that may sign it."""
    if path is None and policy is not None:
        path = fitting_key(store, policy, mission)
    source = next((SourceKind(each.source).name.lower() for each in mission.invocations), PROPOSERS[0])
    return unlock(store, Duty.MISSION, path=path, passphrase_file=passphrase_file, whose=source)


def unlock_person(
    store: KeyStore,
    person: str | None,
    role: str | None,
    *,
    path: Path | None = None,
    passphrase_file: Path | None = None,
) -> SigningKey:
    """Return the approval key of a person (None: the only one) in a role (None: any) from `path` or the store.

    Raises `Untrusted` (`no-approver`, `several-approvers`, ...) and OSError.
    """
    if path is not None:
        return unlock(store, Duty.APPROVAL, path=path, passphrase_file=passphrase_file)
    key = person_key(store, person, role)
    return unlock(store, Duty.APPROVAL, whose=whose(key), passphrase_file=passphrase_file)


def read_passphrase(path: Path) -> bytes:
    """Return the passphrase in a file or pipe that no other user may read, without its line ending.

    Raises `KeyStoreError` (`exposed`, `too-large`) and OSError.
    """
    with path.open("rb") as file:
        if why := exposed(file):
            raise KeyStoreError("exposed", f"other users can read the passphrase in `{path}`: {why}")
        data = file.read(_LONGEST + 1)
    if len(data) > _LONGEST:
        raise KeyStoreError("too-large", f"the passphrase in `{path}` exceeds {_LONGEST} bytes")
    return data.rstrip(b"\r\n")


def _load(store: KeyStore, duty: Duty, path: Path | None, passphrase: bytes | None, whose: str) -> SigningKey:
    if path is not None:
        return read_key(path, duty, passphrase=passphrase)
    return store.signing_key(duty, passphrase=passphrase, whose=whose)


def terminal() -> bool:
    """Return whether a person can be prompted."""
    return sys.stdin is not None and sys.stdin.isatty()
