"""The logs of a small fleet, an archive of them, and an empty archive."""

from collections.abc import Callable, Iterable
from pathlib import Path
from shutil import copytree

import pytest

from reference.archived import CHECK, write_fleet
from rtshcua.adapters.archive.adding import Done, VerificationOptions, add
from rtshcua.adapters.archive.folder import ArchiveFolder, LogSource
from rtshcua.adapters.archive.index import lay_out

Add = Callable[..., list[Done]]


@pytest.fixture(scope="session")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the fleet's logs."""
    folder = tmp_path_factory.mktemp("fleet")
    write_fleet(folder)
    return folder


@pytest.fixture(scope="session")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of an archive with empty tables, made once because the engine is slow to create them."""
    folder = ArchiveFolder(tmp_path_factory.mktemp("empty") / "archive", make=True)
    lay_out(folder)
    return folder.path


@pytest.fixture
def folder(empty: Path, tmp_path: Path) -> ArchiveFolder:
    """An empty archive."""
    return ArchiveFolder(Path(copytree(empty, tmp_path / "archive")), make=True)


@pytest.fixture
def take(folder: ArchiveFolder) -> Add:
    """A function that adds logs to that archive."""

    def take(logs: Iterable[Path], check: VerificationOptions = CHECK) -> list[Done]:
        return list(add(folder, map(LogSource, logs), check))

    return take


@pytest.fixture(scope="session")
def filled(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> ArchiveFolder:
    """The archive of the whole fleet, for read-only tests."""
    folder = ArchiveFolder(tmp_path_factory.mktemp("filled") / "archive", make=True)
    list(add(folder, map(LogSource, sorted(fleet.glob("*.jsonl"))), CHECK))
    return folder
