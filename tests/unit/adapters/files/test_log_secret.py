"""`log.secret`, and the root for the close of a log that stands on the disk."""

from pathlib import Path

import pytest

from reference.sealed_log import SECRET, sealed_log
from rtshcua.adapters.files import logs
from rtshcua.adapters.files.logs import SecretError, disclosure_of, read_secret, write_secret
from rtshcua.evidence.proofs.disclosure import disclosure_root

LINES = sealed_log().lines[:-1]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    (tmp_path / "log.jsonl").write_bytes(b"".join(LINES))
    return tmp_path / "log.jsonl"


def test_its_owner_alone_reads_it(log: Path) -> None:
    write_secret(log.parent, SECRET)
    path = log.parent / logs.SECRET
    assert path.stat().st_mode & 0o777 == 0o600
    assert read_secret(path) == SECRET
    path.chmod(0o640)
    with pytest.raises(SecretError, match="others may read"):
        read_secret(path)
    with pytest.raises(FileExistsError):
        write_secret(log.parent, SECRET)


def test_a_secret_of_another_length_is_none(tmp_path: Path) -> None:
    for length in (0, 31, 33, 4_096):
        folder = tmp_path / str(length)
        folder.mkdir()
        write_secret(folder, bytes(length))
        with pytest.raises(SecretError, match="has not 32 bytes"):
            read_secret(folder / logs.SECRET)


def test_the_root_of_a_log_on_the_disk(log: Path) -> None:
    assert disclosure_of(log, len(LINES)) is None
    write_secret(log.parent, SECRET)
    assert disclosure_of(log, len(LINES)) == disclosure_root(LINES, SECRET)
    assert disclosure_of(log, len(LINES) + 1) is None  # the disk did not take all of it
    log.write_bytes(b"".join(LINES)[:-9])
    assert disclosure_of(log, len(LINES)) is None
    log.unlink()
    assert disclosure_of(log, len(LINES)) is None
