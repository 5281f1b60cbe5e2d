"""Run folders of flights."""

from pathlib import Path

import pytest

from virtual import flight_reports


@pytest.fixture(scope="session")
def completed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flight_reports.completed(tmp_path_factory.mktemp("completed") / "run")


@pytest.fixture(scope="session")
def turned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flight_reports.turned(tmp_path_factory.mktemp("turned") / "run")
