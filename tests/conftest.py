"""What every test gets: a user's folders that are its own, a plain terminal, and repeatable property tests."""

import os
from collections.abc import Generator
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

import pytest
from hypothesis import settings

CHECKOUT = Path(__file__).resolve().parents[1]

# Wall time says nothing on a shared machine, so no deadline. `make test` tries the same examples everywhere;
# `make soak` looks further, with new ones each time.
# CI, with ten minutes for all, tries half as many.
settings.register_profile("test", deadline=None, derandomize=True, max_examples=50 if os.environ.get("CI") else 100)
settings.register_profile("soak", deadline=None, max_examples=20_000)
settings.load_profile("test")

#: the tests that cover decision, wire and evidence in full; the others run without the price of being traced
COVERING = ("unit/decision", "unit/wire", "unit/evidence", "unit/onboard", "attacks")
#: and of those, the ones that take long and cover nothing more: on whole logs and flights
NOT_COVERING = ("test_log_", "test_link_", "test_frames_", "test_agent_", "test_permit_", "test_tampered_")


#: what they cover (`pyproject.toml` names it too)
COVERED = ("rtshcua.decision", "rtshcua.evidence", "rtshcua.wire")


def measuring(config: pytest.Config) -> Any:
    """What starts and stops measuring in pytest-cov; None without `--cov`."""
    return getattr(config.pluginmanager.getplugin("_cov"), "cov_controller", None)


@pytest.hookimpl(tryfirst=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """pytest-cov begins twice in a test process of xdist; what it measures first, nobody reads. End that one.

    It would take over wherever a test is not to be measured, so that all were traced, at three times the price.
    """
    controller = measuring(session.config)
    if hasattr(session.config, "workerinput") and controller is not None:
        controller.cov.stop()


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Generator[None, object, object]:
    """Importing is measured for what is covered, not for hundreds of test files."""
    controller = measuring(session.config)
    if controller is None:
        return (yield)
    for package in map(import_module, COVERED):
        for module in walk_packages(package.__path__, f"{package.__name__}."):
            import_module(module.name)
    controller.pause()
    try:
        return (yield)
    finally:
        controller.resume()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Coverage is measured by the tests that are for it, and among these by the cases that somebody chose.

    What only a random example reaches is covered by luck: it gets a case of its own.
    """
    folders = tuple(CHECKOUT / "tests" / folder for folder in COVERING)
    for item in items:
        chosen = not getattr(getattr(item, "obj", None), "is_hypothesis_test", False)
        chosen = chosen and not (item.path.parent.name == "attacks" and item.path.name.startswith(NOT_COVERING))
        if not (chosen and any(item.path.is_relative_to(folder) for folder in folders)):
            item.add_marker("no_cover")


@pytest.fixture
def checkout() -> Path:
    """The top of the checkout."""
    return CHECKOUT


@pytest.fixture(scope="session", autouse=True)
def byte_code(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Where no byte code may be kept, processes that tests start share what they compile, away from the checkout."""
    if os.environ.pop("PYTHONDONTWRITEBYTECODE", ""):
        os.environ["PYTHONPYCACHEPREFIX"] = str(tmp_path_factory.getbasetemp() / "byte_code")


@pytest.fixture(autouse=True)
def own_world(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """No test sees or touches the keys, the replay state or the terminal settings of whoever runs it."""
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(tmp_path_factory.mktemp("data")))
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("TZ", "UTC")
    for name in ("FORCE_COLOR", "GITHUB_ACTIONS", "RTSHCUA_DEBUG"):
        monkeypatch.delenv(name, raising=False)
