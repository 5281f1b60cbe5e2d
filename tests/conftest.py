"""Common setup of all tests: private user folders, a plain terminal, and reproducible property tests."""

import atexit
import gc
import os
import signal
import stat
import sys
import sysconfig
from collections.abc import Generator
from contextlib import suppress
from functools import cache
from importlib import import_module
from itertools import count
from pathlib import Path
from pkgutil import walk_packages
from shutil import rmtree
from tempfile import TemporaryDirectory, gettempdir
from typing import Any

import pytest
from _pytest.assertion import rewrite
from hypothesis import HealthCheck, Phase, given, is_hypothesis_test, settings
from hypothesis import strategies as st

from processes import Processes
from virtual import once
from virtual.forked import Forked, forked

CHECKOUT = Path(__file__).resolve().parents[1]

# No deadline, because elapsed time is meaningless on a shared machine. `make test` runs the same few examples each
# time; `make soak` runs many new ones. A test that needs more or fewer examples scales the profile's number:
# `@settings(max_examples=settings().max_examples * 2)`. `make mutate` needs the same examples for each mutation, and
# enough of them to detect it.
settings.register_profile("test", deadline=None, derandomize=True, max_examples=15)
settings.register_profile("mutate", deadline=None, derandomize=True, max_examples=100)
settings.register_profile("soak", deadline=None, max_examples=5_000)
settings.load_profile("test")


@settings(max_examples=20, database=None, derandomize=True, phases=[Phase.generate], suppress_health_check=HealthCheck)
@given(st.lists(st.integers(), min_size=30), st.text(min_size=1))
def have_hypothesis_ready(numbers: list[int], text: str) -> None:
    """Load Hypothesis' character table and the constants of loaded modules.

    Once, before processes are forked. In a new checkout it takes some seconds, which then count for no test.
    """


#: the tests that cover decision, wire and evidence; other tests run without tracing
COVERING = ("unit/decision", "unit/wire", "unit/evidence", "attacks/test_log_boundary.py")
#: the covered packages (also in `pyproject.toml`)
COVERED = ("rtshcua.decision", "rtshcua.evidence", "rtshcua.wire")


def measuring(config: pytest.Config) -> Any:
    """Return pytest-cov's controller; None without `--cov`."""
    return getattr(config.pluginmanager.getplugin("_cov"), "cov_controller", None)


#: the socket of the process that forks commands, in the run's folder
COMMANDS = "commands"
#: installed folders without imported modules
NOT_IMPORTED = ("__pycache__", "idlelib", "lib2to3", "pip", "site-packages", "test", "tests")


def pytest_addoption(parser: Any) -> None:
    group = parser.getgroup("processes")
    group._addoption("-n", dest="processes", type=int, default=0, help="run the tests in this many processes")
    group._addoption(
        "--most", type=float, default=1_800, help="of these, end one that is silent for so many s (0: none)"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Share a folder and byte code between all processes of a run."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as a shell starts what runs in the background
        signal.signal(signal.SIGINT, signal.default_int_handler)  # else commands would inherit it
    shared = TemporaryDirectory(prefix="rtshcua_once_")
    config.add_cleanup(shared.cleanup)
    os.environ[once.FOLDER] = shared.name
    if os.environ.pop("PYTHONDONTWRITEBYTECODE", ""):
        keep_byte_code(config)
    if config.option.processes and not config.option.usepdb:
        config.pluginmanager.register(
            Processes(config.option.processes, lambda: save_measured(config), config.option.most)
        )


def save_measured(config: pytest.Config) -> None:
    """Store the coverage of one process, to be combined later."""
    if controller := measuring(config):
        controller.cov.save()


def keep_byte_code(config: pytest.Config) -> None:
    """If no byte code may be written to the checkout, keep it in pytest's cache, or for this run only.

    Installed packages have byte code, which is linked; the first process compiles the rest.
    """
    cache = getattr(config, "cache", None)
    if cache is not None:
        folder = cache.mkdir("byte-code")
        for run in (folder / gettempdir().lstrip("/")).glob("pytest-of-*"):
            rmtree(run, ignore_errors=True)  # from modules that tests created in earlier runs
    else:
        temporary = TemporaryDirectory(prefix="rtshcua_byte_code_")
        config.add_cleanup(temporary.cleanup)
        folder = Path(temporary.name)
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix = str(folder)
    sys.dont_write_bytecode = False
    for installed in {sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")}:
        for path, folders, _ in os.walk(installed):
            folders[:] = [each for each in folders if each not in NOT_IMPORTED]
            kept = folder / path.lstrip("/")
            if kept.exists():
                continue
            kept.mkdir(parents=True)
            for each in Path(path, "__pycache__").glob(f"*.{sys.implementation.cache_tag}.pyc"):
                (kept / each.name).symlink_to(each)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session) -> Generator[None, object, object]:
    """Measure coverage of imports only for covered packages, not for hundreds of test files.

    Collected tests live as long as the process: garbage collection over them took a third of the collection time.
    Objects that exist before the tests are therefore frozen.
    """
    gc.disable()
    helper = rewriting_from_the_end(session.config)
    try:
        return (yield from collected(session))
    finally:
        if helper is not None:
            os.waitpid(helper, 0)
        gc.enable()
        gc.freeze()
        atexit.register(gc.unfreeze)  # at exit, libraries check for remaining objects and print them
        gc.set_threshold(20_000, 20, 20)


def rewriting_from_the_end(config: pytest.Config) -> int | None:
    """Start a process that rewrites the assertions of test files, from the last file to the first one with byte code.

    In a new checkout this takes half of the collection time; the main process starts with the first file.
    """
    folders = [Path(each) for each in config.args]
    if not config.option.processes or sys.dont_write_bytecode or not all(each.is_dir() for each in folders):
        return None
    if process := os.fork():
        return process
    with suppress(BaseException):  # the collecting process reports the same error
        if controller := measuring(config):
            controller.pause()
        for file in sorted((file for each in folders for file in each.rglob("test_*.py")), reverse=True):
            kept = rewrite.get_cache_dir(file.absolute()) / f"{file.stem}{rewrite.PYC_TAIL}"
            if kept.exists():
                break
            kept.parent.mkdir(parents=True, exist_ok=True)
            digest, code = rewrite._rewrite_test(file.absolute(), config)
            rewrite._write_pyc(config.stash[rewrite.assertstate_key], code, digest, kept)
    os._exit(0)


def collected(session: pytest.Session) -> Generator[None, object, object]:
    """Collect with coverage of the covered packages only."""
    controller = measuring(session.config)
    if controller is None:
        return (yield)
    for package in map(import_module, COVERED):
        for module in walk_packages(package.__path__, f"{package.__name__}."):
            import_module(module.name)
    controller.pause()
    session.config.pluginmanager.register(Measured(controller.cov))
    return (yield)


class Measured:
    """Measure covering tests and their fixtures, but not pytest.

    Starting and stopping is cheap; tracing pytest itself takes longer than most of these tests.
    """

    def __init__(self, coverage: Any) -> None:
        self._coverage = coverage
        self._wanted = False
        self._begun = False

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        self._wanted = item.get_closest_marker("unmeasured") is None

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self) -> Generator[None, object, object]:
        return (yield from self._measured())

    @pytest.hookimpl(wrapper=True)
    def pytest_pyfunc_call(self) -> Generator[None, object, object]:
        return (yield from self._measured())

    def _measured(self) -> Generator[None, object, object]:
        if self._begun or not self._wanted:  # a fixture may request another one
            return (yield)
        self._begun = True
        self._coverage.start()
        try:
            return (yield)
        finally:
            self._coverage.stop()
            self._begun = False


def pytest_collection_finish(session: pytest.Session) -> None:
    """Start the process that forks commands, if a test needs it: it loads while the first tests run.

    Cache typer's parser of a command that is called often in one process: it takes a tenth of such tests.
    """
    if any(is_hypothesis_test(getattr(item, "obj", None)) for item in session.items):
        have_hypothesis_ready()
    if (typer := sys.modules.get("typer.main")) is not None:
        typer.get_command = cache(typer.get_command)  # type: ignore[attr-defined]
    wanted = any("commands" in getattr(item, "fixturenames", ()) for item in session.items)
    if wanted and not session.config.option.collectonly:
        beginning = forked(Path(os.environ[once.FOLDER], COMMANDS))
        beginning.__enter__()
        session.config.add_cleanup(lambda: beginning.__exit__(None, None, None))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Coverage counts only the tests for it, and among these only chosen cases.

    Code that only a random example reaches needs its own case.
    """
    covering = tuple(CHECKOUT / "tests" / folder for folder in COVERING)

    @cache
    def covers(path: Path) -> bool:
        return any(path.is_relative_to(folder) for folder in covering)

    for item in items:
        if not covers(item.path) or is_hypothesis_test(getattr(item, "obj", None)):
            item.add_marker("unmeasured")


@pytest.fixture
def checkout() -> Path:
    """The root of the checkout."""
    return CHECKOUT


@pytest.fixture(scope="session")
def commands() -> Forked:
    """Run `rtshcua` in forked processes that have loaded it already."""
    return Forked(Path(os.environ[once.FOLDER], COMMANDS))


class Worlds:
    """A data folder for each test; an unused one is reused."""

    def __init__(self, top: Path) -> None:
        self._new = (top / str(number) for number in count())
        self._folder: Path | None = None

    def enter(self) -> None:
        """Hide the keys, the replay state and the terminal settings of the user who runs the tests."""
        folder = self._folder
        if folder is None or not as_made(folder):
            folder = self._folder = next(self._new)
            folder.mkdir(mode=0o700)
        os.environ.update(PLAIN, RTSHCUA_DATA_DIR=str(folder))
        for name in NOT_SET:
            os.environ.pop(name, None)


def as_made(folder: Path) -> bool:
    """Return whether a folder still exists, is private, and is empty."""
    try:
        return os.lstat(folder).st_mode == stat.S_IFDIR | 0o700 and next(folder.iterdir(), None) is None
    except OSError:
        return False


#: the terminal of every test, wide enough for messages on one line; `tests/unit/front/cli/test_width.py` checks 80
#: columns
PLAIN = {"COLUMNS": "400", "NO_COLOR": "1", "TZ": "UTC"}
NOT_SET = ("FORCE_COLOR", "GITHUB_ACTIONS", "RTSHCUA_DEBUG")


@pytest.fixture(scope="session")
def worlds(tmp_path_factory: pytest.TempPathFactory) -> Worlds:
    return Worlds(tmp_path_factory.mktemp("data"))


@pytest.fixture(autouse=True)
def own_world(worlds: Worlds) -> None:
    """Isolate tests from the keys, the replay state and the terminal settings of the user.

    All tests use this fixture, so it must be cheap: a test restores its own changes of the environment.
    """
    worlds.enter()
