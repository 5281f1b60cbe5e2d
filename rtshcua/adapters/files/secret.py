"""`log.secret`: 32 random octets beside a log, without which no record of it can be shown in part.

Its owner alone may read it: with it the fields that were withheld can be guessed (docs/log-format.md, section 6).
"""

from collections.abc import Iterable, Iterator
from pathlib import Path

from rtshcua.adapters.files.logs import lines
from rtshcua.adapters.store.reading import exposed, open_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE, write_new
from rtshcua.evidence.proofs.disclosure import SECRET_BYTES, disclosure_root
from rtshcua.wire.untrusted import Untrusted

SECRET = "log.secret"


class SecretError(Untrusted):
    """A secret that does not serve: `exposed`, `malformed`."""


def write_secret(folder: Path, secret: bytes) -> None:
    """Keep the secret of the log that is about to begin in this folder. Raises FileExistsError and OSError."""
    write_new(folder / SECRET, secret, mode=PRIVATE_FILE)


def read_secret(path: Path, root: Path | None = None) -> bytes:
    """The secret in a file that its owner alone may read. Raises `SecretError` and OSError, as `open_regular`."""
    with open_regular(path, root) as file:
        if mode := exposed(file):
            raise SecretError("exposed", f"others may read the secret `{path}`: its mode is {mode}")
        data = file.read(SECRET_BYTES + 1)
    if len(data) != SECRET_BYTES:
        raise SecretError("malformed", f"`{path}` is no secret of a log: it has not {SECRET_BYTES} bytes")
    return data


def disclosure_of(log: Path, records: int, before: Iterable[bytes] | None = None) -> bytes | None:
    """The disclosure root for the close of a log that stands on the disk with so many records, unless its lines are
    given otherwise; None where it does not, or its folder has no usable secret.
    """
    try:
        with open_regular(log) as file:
            counted = _Counted(lines(file) if before is None else before)
            root = disclosure_root(counted, read_secret(log.parent / SECRET, log.parent))
    except (OSError, ValueError):  # an `Untrusted` is a ValueError too
        return None
    return root if counted.count == records else None


class _Counted:
    def __init__(self, lines: Iterable[bytes]) -> None:
        self.count = 0
        self._lines = lines

    def __iter__(self) -> Iterator[bytes]:
        for line in self._lines:
            self.count += 1
            yield line
