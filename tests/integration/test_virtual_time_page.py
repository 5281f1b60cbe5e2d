"""docs/flying/virtual-time.md as written: pytest runs its test in a project of `rtshcua init`."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from rtshcua.front.cli import app

CHECKOUT = Path(__file__).resolve().parents[2]
PAGE = (CHECKOUT / "docs/flying/virtual-time.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_page_tests_pass_in_a_new_project(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(tmp_path / "keys"))
    monkeypatch.setenv("PYTHONPATH", str(CHECKOUT))
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # a user need not have ours
    (tmp_path / "project").mkdir()
    monkeypatch.chdir(tmp_path / "project")
    for words in ("init", *re.findall(r"`rtshcua ((?:keys|compile) [^`]+)`", PAGE)):
        assert app.main(words.split()) == 0, capsys.readouterr()
    (example,) = re.findall(r"^```python\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    Path("test_flights.py").write_text(example, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", "/dev/null", "test_flights.py"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert "3 passed" in run.stdout
