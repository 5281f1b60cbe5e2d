"""Signing keys for commands: from the key store or a file, with a passphrase asked for only where one is needed."""

import sys
from getpass import getpass
from pathlib import Path

from rtshcua.adapters.files.keystore import KeyStore, read_key
from rtshcua.wire.key_file import KeyFileError
from rtshcua.wire.keys import Duty, SigningKey


def unlock(store: KeyStore, duty: Duty, *, path: Path | None = None, passphrase_file: Path | None = None) -> SigningKey:
    """The key of a duty, from `path` or else the store.

    An encrypted key is opened with the content of `passphrase_file` without its line ending, or with what a person
    types at the terminal. Raises `Untrusted` (`no-keys`, `exposed`, `passphrase-needed`, ...) and OSError.
    """
    given = None if passphrase_file is None else read_passphrase(passphrase_file)
    try:
        return _load(store, duty, path, given)
    except KeyFileError as error:
        if error.slug != "passphrase-needed" or given is not None or not _terminal():
            raise
    return _load(store, duty, path, getpass(f"passphrase of the `{duty}` key: ").encode())


def read_passphrase(path: Path) -> bytes:
    """The passphrase in a file: its content without the line ending."""
    return path.read_bytes().rstrip(b"\r\n")


def _load(store: KeyStore, duty: Duty, path: Path | None, passphrase: bytes | None) -> SigningKey:
    if path is not None:
        return read_key(path, duty, passphrase=passphrase)
    return store.signing_key(duty, passphrase=passphrase)


def _terminal() -> bool:
    return sys.stdin is not None and sys.stdin.isatty()
