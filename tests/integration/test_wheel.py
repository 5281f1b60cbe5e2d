"""The wheel, installed outside the checkout, does what the checkout does.

The throw-away environment shares the dependencies that are installed already (so nothing is fetched), but not the
editable install: a path named in a .pth file is searched, its own .pth files are not read.
"""

import os
import platform
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Callable
from pathlib import Path
from zipfile import ZipFile

import pytest

pytestmark = pytest.mark.clients

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("outside")


@pytest.fixture(scope="module")
def python(place: Path) -> Path:
    """The Python of an environment with the wheel in it: the one for this machine, of two.

    The wheel for any machine is built by way of the sdist; it has the same, but for the boundary's program.
    """
    checkout = Path(__file__).resolve().parents[2]
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(place)]
    target = f"{platform.machine()}-linux-musl"
    for command, more in (
        ([*build, str(checkout)], {}),
        ([str(checkout / ".make/boundary"), sys.executable], {"TARGET": target}),
        ([*build, "--wheel", str(checkout)], {"RTSHCUA_TARGET": target}),
    ):
        environment = os.environ | more
        made = subprocess.run(command, cwd=place, env=environment, capture_output=True, text=True, check=False)
        assert made.returncode == 0, made.stdout + made.stderr
    without, including = sorted(place.glob("*.whl"), key=lambda path: "-any" not in path.name)
    apart = {*ZipFile(including).namelist()} ^ {*ZipFile(without).namelist()}
    assert "rtshcua/boundary/rtshcua-boundary" in apart
    assert all(name.startswith("rtshcua/boundary/") for name in apart)

    venv.create(place / "venv", with_pip=False, symlinks=True)
    python = place / "venv/bin/python"
    (site,) = (place / "venv/lib").glob("python*/site-packages")
    pip = [sys.executable, "-m", "pip", "--python", str(python), "--disable-pip-version-check"]
    made = subprocess.run(
        [*pip, "install", "--quiet", "--no-compile", "--no-deps", "--no-index", "--find-links", str(place), "rtshcua"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stdout + made.stderr
    shared = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    (site / "shared.pth").write_text("\n".join(sorted(shared)) + "\n", encoding="utf-8")
    return python


@pytest.fixture
def run(python: Path, place: Path) -> Run:
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}

    def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            [python.with_name(str(command[0])), *command[1:]],
            cwd=place,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done

    return run


@pytest.fixture
def library(run: Run) -> Path:
    return Path(run("python", "-c", "from rtshcua import library; print(library.root())").stdout.strip())


def test_wheel_contains_the_whole_library(library: Path, place: Path, checkout: Path) -> None:
    assert library.is_relative_to(place / "venv")
    for folder in ("grammar", "skills", "policies", "missions", "evaluation", "examples"):
        ours, shipped = (
            {
                file.relative_to(top): file.read_bytes()
                for file in (top / folder).rglob("*")
                if file.is_file() and "__pycache__" not in file.parts
            }
            for top in (checkout, library)
        )
        assert ours
        assert ours == shipped


def test_help_and_version(run: Run) -> None:
    assert "verify-log" in run("rtshcua", "--help").stdout
    assert run("rtshcua", "--version").stdout.startswith("rtshcua ")


def test_compile_and_show_a_shipped_mission(run: Run, library: Path, tmp_path: Path) -> None:
    bundle = tmp_path / "short.bundle"
    run("rtshcua", "keys", "init")
    run("rtshcua", "compile", library / "missions/short.rts", "-o", bundle, "--at", "2026-01-01T00:00:00Z")
    assert bundle.stat().st_size > 0
    assert run("rtshcua", "show", bundle).stdout


def test_new_project_passes_its_checks(run: Run, tmp_path: Path) -> None:
    run("rtshcua", "init", tmp_path / "riverside")
    run("rtshcua", "lint", tmp_path / "riverside")


def test_flight_with_the_boundary_of_the_wheel(run: Run, library: Path, place: Path, tmp_path: Path) -> None:
    asked = "from rtshcua.adapters.boundary.process import program; print(program())"
    program = Path(run("python", "-c", asked).stdout.strip())
    assert program.is_relative_to(place / "venv")
    assert os.access(program, os.X_OK)
    bundle, runs = tmp_path / "short.bundle", tmp_path / "runs"
    run("rtshcua", "keys", "init")
    run("rtshcua", "compile", library / "missions/short.rts", "-o", bundle)
    run("rtshcua", "run", bundle, "--mode", "process", "--speed", "10", "--runs", runs)
    (folder,) = runs.iterdir()
    run("rtshcua", "verify-log", "--audit", folder)


def test_demo_of_the_wheel(run: Run, place: Path) -> None:
    """As `pipx run rtshcua demo` and `uvx rtshcua demo` run it."""
    told = run("rtshcua", "demo").stdout
    assert "VERIFIED" in told
    assert (place / "rtshcua-demo/flight.html").is_file()
