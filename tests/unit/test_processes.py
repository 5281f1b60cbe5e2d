"""Tests in several processes: no test is lost, one process runs each file, and a dead process is a failure."""

import os
import subprocess
import sys
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace

import pytest

from processes import Worker, in_order, next_file

CONFTEST = """
import os
from processes import Processes

def ended():
    with open("ended", "a") as told:
        print("over", file=told)

def pytest_configure(config):
    config.pluginmanager.register(Processes(2, ended, float(os.environ.get("MOST_S", 0))))
"""
PASSES = """
import os, pytest, sys

KEPT = sys.stderr  # as libraries do when they are imported

@pytest.fixture(scope="module")
def process():
    return os.getpid()

@pytest.mark.parametrize("n", range(3))
def test_one_process_runs_a_file(process, n, tmp_path):
    with open(__file__ + ".ran", "a") as ran:
        print(n, file=ran)
    print("said to what was kept", file=KEPT)
    assert os.getpid() == process != os.getppid()
"""
FAILS = """
def test_fails():
    print("said before")
    assert 1 + 1 == 3
"""
DIES = """
import os, signal

def test_before():
    pass

def test_dies():
    os.kill(os.getpid(), signal.SIGKILL)

def test_after():
    pass
"""
LEAVES = """
import pytest

class Left:
    def __del__(self):
        raise RuntimeError("not let go of")

def test_leaves_garbage():
    left = Left()
    left.itself = left
"""
#: exits in the middle of a file, at its end, and during teardown, with a successful exit code
ENDS = """
import os

def test_before():
    pass

def test_ends():
    os._exit(0)
"""
ENDS_AFTER = """
import os, pytest

@pytest.fixture(scope="module", autouse=True)
def shared():
    yield
    os._exit(0)

def test_ends():
    pass
"""
SAYS_NOTHING = """
import pytest

@pytest.fixture(autouse=True)
def unheard(request):
    plugins = request.config.pluginmanager
    told = plugins.unregister(name="told")
    yield
    plugins.register(told, "told")  # this process may be given the other file too

def test_says_nothing():
    assert 1 + 1 == 3
"""
HANGS = """
import time

def test_hangs():
    time.sleep(1_000)

def test_after():
    pass
"""


def run(folder: Path, *words: str, **files: str) -> tuple[int, str]:
    """Run pytest on these files; return its exit code and output."""
    for name, text in {"conftest": CONFTEST, **files}.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    paths = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider"]
    done = subprocess.run(
        [*command, "--rootdir=.", "--basetemp=t", "-W", "error", *words], check=False, capture_output=True, cwd=folder,
        env={**os.environ, "PYTHONPATH": paths, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}, text=True, timeout=120,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


@pytest.mark.slow
def test_no_test_is_lost_and_failures_are_reported(tmp_path: Path) -> None:
    code, said = run(tmp_path, test_a=PASSES, test_b=FAILS, test_c=DIES, test_d=PASSES)
    assert code == 1, said
    assert "2 failed, 8 passed" in said, said
    assert "assert (1 + 1) == 3" in said
    assert "said before" in said
    assert "test_c.py::test_dies - its process ended with -9" in said, said
    for name in ("test_a", "test_d"):
        assert (tmp_path / f"{name}.py.ran").read_text(encoding="utf-8").split() == ["0", "1", "2"]
    assert (tmp_path / "ended").read_text(encoding="utf-8").split() == ["over"] * 2


def test_last_files_start_first_in_other_processes() -> None:
    files = [[0, 1], [2], [3, 4], [5], [6]]
    own, other = Pipe()
    with own, other:
        given = [next_file(Worker(number, 0, own), files) for number in (0, 1, 2, 3, 4, 5)]
    assert given == [[0, 1], [6], [5], [2], [3, 4], []]


def test_long_tests_are_given_one_by_one_at_the_end_where_flights_begin() -> None:
    def item(path: str, long: bool) -> SimpleNamespace:
        return SimpleNamespace(path=Path(path), get_closest_marker=lambda _: long or None)

    named = [
        ("attacks/test_a.py", True), ("attacks/test_a.py", True), ("attacks/test_a.py", False),
        ("attacks/test_a.py", False), ("integration/test_b.py", False), ("model/test_c.py", False),
        ("unit/test_d.py", False), ("unit/test_d.py", True),
    ]  # fmt: skip
    items = [item(*each) for each in named]
    assert in_order(items) == [[2, 3], [5], [6], [4], [0], [1], [7]]  # type: ignore[arg-type]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "files", "told"),
    [
        (("-x",), {f"test_{n}": FAILS for n in range(9)}, "stopping after 1 failures"),
        ((), {"test_left": LEAVES, "test_before": PASSES}, "1 failed, 4 passed"),
        ((), {"test_wrong": "import nothing_of_that_name"}, "1 error"),
    ],
)
def test_run_that_ends_early_says_why(tmp_path: Path, words: tuple[str, ...], files: dict[str, str], told: str) -> None:
    code, said = run(tmp_path, *words, **files)
    assert code != 0
    assert told in said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "told"),
    [
        (ENDS, ("test_it.py::test_ends - its process ended with 0", "1 failed, 4 passed")),
        (ENDS + "\n\ndef test_after():\n    assert 1 + 1 == 3\n", ("ended with 0", "test_after", "2 failed, 4 passed")),
        (ENDS_AFTER, ("test_it.py::test_ends - its process ended with 0",)),
        (SAYS_NOTHING, ("test_it.py::test_says_nothing - nothing was reported of it", "1 failed, 3 passed")),
        (HANGS, ("test_it.py::test_hangs - it took longer than 5 s", "1 failed, 4 passed", "in test_hangs")),
    ],
    ids=("ends", "ends-before-others", "ends-after", "says-nothing", "hangs"),
)
def test_process_that_leaves_tests_is_a_failure(
    tmp_path: Path, text: str, told: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if its exit code signals success."""
    if text is HANGS:
        monkeypatch.setenv("MOST_S", "5")
    code, said = run(tmp_path, test_it=text, test_other=PASSES)
    assert code == 1, said
    for each in told:
        assert each in said, said
