"""What every test gets: a user's folders that are its own, a plain terminal, and repeatable property tests."""

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

# Wall time says nothing on a shared machine, so no deadline. `make test` tries the same few examples each time;
# `make soak` tries many in every property test, and new ones each time. A test that needs more or fewer than others
# takes a share of the profile's: `@settings(max_examples=settings().max_examples * 2)`. `make mutate` needs
# the same examples for each change, and enough of them to notice it.
settings.register_profile("test", deadline=None, derandomize=True, max_examples=15)
settings.register_profile("mutate", deadline=None, derandomize=True, max_examples=100)
settings.register_profile("soak", deadline=None, max_examples=5_000)
settings.load_profile("test")


@settings(max_examples=20, database=None, derandomize=True, phases=[Phase.generate], suppress_health_check=HealthCheck)
@given(st.lists(st.integers(), min_size=30), st.text(min_size=1))
def have_hypothesis_ready(numbers: list[int], text: str) -> None:
    """Let Hypothesis read what it draws from: the table of all characters, and the constants in what is loaded.

    Once, before processes are forked. In a new checkout it takes some seconds, which no test then has to answer for.
    """


#: the tests that cover decision, wire and evidence in full; the others run without the price of being traced
COVERING = ("unit/decision", "unit/wire", "unit/evidence", "attacks/test_log_boundary.py")
#: what they cover (`pyproject.toml` names it too)
COVERED = ("rtshcua.decision", "rtshcua.evidence", "rtshcua.wire")


def measuring(config: pytest.Config) -> Any:
    """What starts and stops measuring in pytest-cov; None without `--cov`."""
    return getattr(config.pluginmanager.getplugin("_cov"), "cov_controller", None)


#: the socket, in the folder of a run, of the process from which commands are forked
COMMANDS = "commands"
#: folders of what is installed that no process imports from
NOT_IMPORTED = ("__pycache__", "idlelib", "lib2to3", "pip", "site-packages", "test", "tests")


def pytest_addoption(parser: Any) -> None:
    group = parser.getgroup("processes")
    group._addoption("-n", dest="processes", type=int, default=0, help="run the tests in this many processes")
    group._addoption(
        "--most", type=float, default=1_800, help="of these, end one that is silent for so many s (0: none)"
    )


def pytest_configure(config: pytest.Config) -> None:
    """All processes of a run share a folder, and byte code."""
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
    """Keep what one of several processes measured, for the one that adds it up."""
    if controller := measuring(config):
        controller.cov.save()


def keep_byte_code(config: pytest.Config) -> None:
    """Where no byte code may be kept in the checkout, keep it in pytest's cache, or for this run alone.

    What is installed has its byte code, and is linked to it; the rest is compiled by whoever comes first.
    """
    cache = getattr(config, "cache", None)
    if cache is not None:
        folder = cache.mkdir("byte-code")
        for run in (folder / gettempdir().lstrip("/")).glob("pytest-of-*"):
            rmtree(run, ignore_errors=True)  # of modules that tests made in runs before
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
    """Importing is measured for what is covered, not for hundreds of test files.

    What is collected stays for as long as the process: looking for garbage in it, time and again, took a third of
    collecting. What the tests make is looked through as ever, but for that in it that was there before them.
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
        atexit.register(gc.unfreeze)  # libraries look at the end whether anything of theirs is left, and print what is
        gc.set_threshold(20_000, 20, 20)


def rewriting_from_the_end(config: pytest.Config) -> int | None:
    """Begin a process that rewrites the assertions of test files, from the last one to the first that has byte code.

    In a new checkout this takes half of the time of collecting, which one process does, from the first file on.
    """
    folders = [Path(each) for each in config.args]
    if not config.option.processes or sys.dont_write_bytecode or not all(each.is_dir() for each in folders):
        return None
    if process := os.fork():
        return process
    with suppress(BaseException):  # whoever collects meets the same fault, and tells it
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
    """Collect, measuring no more than what is covered."""
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
    """Measures tests that cover, and the fixtures that are made for them, but not what runs them.

    To begin and to end is cheap; pytest itself, traced, takes longer than most of these tests.
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
        if self._begun or not self._wanted:  # a fixture may ask for another one
            return (yield)
        self._begun = True
        self._coverage.start()
        try:
            return (yield)
        finally:
            self._coverage.stop()
            self._begun = False


def pytest_collection_finish(session: pytest.Session) -> None:
    """Begin the process from which commands are forked, if a test asks for it: it loads while the first tests run.

    Of a command that is called many times in a process, typer makes its parser once: it takes a tenth of such tests.
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
    """Coverage is measured by the tests that are for it, and among these by the cases that somebody chose.

    What only a random example reaches is covered by luck: it gets a case of its own.
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
    """The top of the checkout."""
    return CHECKOUT


@pytest.fixture(scope="session")
def commands() -> Forked:
    """`rtshcua` in processes that need not load it first."""
    return Forked(Path(os.environ[once.FOLDER], COMMANDS))


class Worlds:
    """A data folder for each test; one that a test left empty is the next one's too."""

    def __init__(self, top: Path) -> None:
        self._new = (top / str(number) for number in count())
        self._folder: Path | None = None

    def enter(self) -> None:
        """From here on nobody sees the keys, the replay state or the terminal settings of whoever runs the tests."""
        folder = self._folder
        if folder is None or not as_made(folder):
            folder = self._folder = next(self._new)
            folder.mkdir(mode=0o700)
        os.environ.update(PLAIN, RTSHCUA_DATA_DIR=str(folder))
        for name in NOT_SET:
            os.environ.pop(name, None)


def as_made(folder: Path) -> bool:
    """Whether a folder is still there, still its owner's alone, and empty."""
    try:
        return os.lstat(folder).st_mode == stat.S_IFDIR | 0o700 and next(folder.iterdir(), None) is None
    except OSError:
        return False


#: what the terminal of every test is like
#: so wide that tests find what is said in one line; `tests/unit/front/cli/test_width.py` holds it to 80 columns
PLAIN = {"COLUMNS": "400", "NO_COLOR": "1", "TZ": "UTC"}
NOT_SET = ("FORCE_COLOR", "GITHUB_ACTIONS", "RTSHCUA_DEBUG")


@pytest.fixture(scope="session")
def worlds(tmp_path_factory: pytest.TempPathFactory) -> Worlds:
    return Worlds(tmp_path_factory.mktemp("data"))


@pytest.fixture(autouse=True)
def own_world(worlds: Worlds) -> None:
    """No test sees or touches the keys, the replay state or the terminal settings of whoever runs it.

    All tests have this, so it costs next to nothing: what a test changes of the environment, it puts back itself.
    """
    worlds.enter()
