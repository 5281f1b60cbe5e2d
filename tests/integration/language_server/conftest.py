"""One server for all tests of a process, because a start is dear; each test has texts of its own."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("pygls")

from virtual.editor import Editor


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("workspace")


@pytest.fixture(scope="session")
def editor(folder: Path) -> Iterator[Editor]:
    made = Editor()
    asyncio.set_event_loop(made.loop)
    found = made.run(made.start(folder))
    assert found.capabilities.position_encoding == "utf-16"
    yield made
    assert made.end() == 0
    assert made.shown == []
