"""`make setup` in a project with one package: it shows progress, is quiet when complete, and repairs damage."""

import hashlib
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.clients  # each set-up is some seconds of pip

CHECKOUT = Path(__file__).resolve().parents[2]
BACKEND = """
import zipfile

def build_editable(folder, config_settings=None, metadata_directory=None):
    name = "tiny-1.0-py3-none-any.whl"
    with zipfile.ZipFile(f"{folder}/{name}", "w") as made:
        made.writestr("tiny-1.0.dist-info/METADATA", "Metadata-Version: 2.1\\nName: tiny\\nVersion: 1.0\\n")
        made.writestr("tiny-1.0.dist-info/WHEEL", "Wheel-Version: 1.0\\nRoot-Is-Purelib: true\\nTag: py3-none-any\\n")
        made.writestr("tiny-1.0.dist-info/RECORD", "")
    return name
"""


def wheel(folder: Path) -> str:
    """A package of one module, as a requirement with its hash."""
    path = folder / "one-1.0-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as made:
        made.writestr("one.py", "value = 1\n" * 50)
        made.writestr("one-1.0.dist-info/METADATA", "Metadata-Version: 2.1\nName: one\nVersion: 1.0\n")
        made.writestr("one-1.0.dist-info/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        made.writestr("one-1.0.dist-info/RECORD", "")
    digest = hashlib.sha256(path.read_bytes()).digest()
    return f"one @ file://{path} --hash=sha256:{digest.hex()}\n"


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("project")
    shutil.copytree(CHECKOUT / ".make", folder / ".make")
    (folder / "Makefile").write_text("all:\n")
    (folder / "rtshcua").mkdir()
    (folder / "rtshcua" / "__init__.py").write_text("")
    (folder / "backend.py").write_text(BACKEND)
    (folder / "requirements").mkdir()
    (folder / "requirements" / "dev.txt").write_text(wheel(folder))
    (folder / "pyproject.toml").write_text(
        '[project]\nname = "tiny"\nversion = "1.0"\n'
        '[build-system]\nrequires = []\nbuild-backend = "backend"\nbackend-path = ["."]\n'
    )
    first = setup(folder)
    assert "there is no .venv yet" in first
    return folder


def setup(folder: Path) -> str:
    base = Path(sys.base_prefix) / "bin" / "python3"
    environment = {**os.environ, "PYTHON": str(base if base.exists() else sys.executable)}
    done = subprocess.run(
        ["sh", ".make/setup"], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def module(folder: Path) -> Path:
    (found,) = folder.glob(".venv/lib/python*/site-packages/one.py")
    return found


def test_setup_shows_progress_and_is_quiet_when_complete(project: Path) -> None:
    (project / ".venv" / "ready").unlink()
    said = setup(project)
    assert ".venv is half-made" in said
    assert "[##############################]   1 of 1 packages installed" in said
    assert max(map(len, said.splitlines())) <= 100
    assert setup(project) == ""


def test_added_file_is_kept(project: Path) -> None:
    added = module(project).parent / "mine.py"
    added.write_text("")
    (module(project).parent / "__pycache__").mkdir(exist_ok=True)
    assert setup(project) == ""
    assert added.exists()


def test_truncated_file_and_missing_list_are_detected(project: Path) -> None:
    check = [sys.executable, "-I", "-S", ".make/whole", "check"]
    before = module(project).read_text()
    module(project).write_text("")
    cut = subprocess.run(check, cwd=project, capture_output=True, text=True, check=False)
    module(project).write_text(before)
    assert (cut.returncode, cut.stdout.startswith("1 file missing or cut short, such as lib")) == (1, True)
    files = project / ".venv" / "files"
    kept = files.read_text()
    files.write_text("nonsense")
    assert subprocess.run(check, cwd=project, capture_output=True, check=False).returncode == 1
    files.write_text(kept)
    assert subprocess.run(check, cwd=project, capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize("how", ["gone", "python"])
def test_damage_is_named_and_repaired(project: Path, how: str) -> None:
    match how:
        case "gone":
            module(project).unlink()
        case "python":
            for name in ("python", "python3"):
                (project / ".venv" / "bin" / name).unlink()
                (project / ".venv" / "bin" / name).symlink_to("/nowhere/python3")
    said = setup(project)
    named = {"python": "does not start any more"}.get(how, "one.py")
    assert named in said
    assert "packages installed" in said
    assert module(project).read_text().startswith("value = 1")
    assert setup(project) == ""
