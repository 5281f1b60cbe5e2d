"""The cache of `lint`: with any content, the result is that of a run without a cache."""

import os
import subprocess
import sys
from hashlib import sha256
from pathlib import Path
from random import Random

import pytest

from reference.lint_project import HABITS, MISSION, POLICY, UNUSED, Lint, put
from rtshcua.adapters.store.folders import cache_folder
from rtshcua.app.lint import examine
from rtshcua.diagnostics.exits import ExitCode


def folder() -> Path:
    """Return the user's cache folder of this program."""
    return Path(os.environ["RTSHCUA_DATA_DIR"], "cache")


@pytest.fixture
def examined(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Record the programs that are checked again, by their first file."""
    names: list[str] = []
    plain = examine.find

    def watched(program, *rest):  # type: ignore[no-untyped-def]
        names.append(program.units[0].file)
        return plain(program, *rest)

    monkeypatch.setattr(examine, "find", watched)
    return names


def entries() -> list[Path]:
    (checkout,) = (folder() / "lint/3").iterdir()
    return sorted(path for path in checkout.iterdir() if not path.name.startswith("."))


def test_only_changed_programs_are_checked_again(here: Path, lint: Lint, examined: list[str]) -> None:
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert examined == ["one.rts", "two.rts"]
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert examined == ["one.rts", "two.rts"]
    put({"two.rts": MISSION.replace("Look", "look")})
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS[:2])
    assert examined == ["one.rts", "two.rts", "two.rts"]
    put({"policy.rts": POLICY.replace(f"{UNUSED}\n", "")})
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS[:1])
    assert examined[3:] == ["one.rts", "two.rts"]
    lint(".", "--no-cache")
    assert examined[5:] == ["one.rts", "two.rts"]


def test_changed_geojson_file_invalidates_the_entry(here: Path, lint: Lint, examined: list[str]) -> None:
    square = [[[8.5450, 47.3970], [8.5462, 47.3970], [8.5462, 47.3985], [8.5450, 47.3985], [8.5450, 47.3970]]]
    shape = f'{{"type": "Polygon", "coordinates": {square}}}'
    put({"policy.rts": POLICY.replace("\npolicy", '\nzone pad from "pad.geojson"\npolicy'), "pad.geojson": shape})
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    put({"pad.geojson": shape.replace("8.5462", "8.5450")})
    assert "E0113" in {code for code, _ in lint(".")[1]}
    put({"pad.geojson": shape})
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)


def test_missing_file_is_not_cached(here: Path, lint: Lint) -> None:
    put({"one.rts": MISSION.replace("policy.rts", "polices.rts").replace("Look", "look")})
    for _ in range(2):
        assert lint("one.rts") == (ExitCode.DIAGNOSTICS, [("E0108", "one.rts")])
    put({"polices.rts": POLICY})
    assert lint("one.rts") == (ExitCode.OK, [])
    Path("polices.rts").unlink()
    assert lint("one.rts") == (ExitCode.DIAGNOSTICS, [("E0108", "one.rts")])


@pytest.mark.parametrize("harm", ["cut", "flipped", "emptied", "swapped", "a folder", "no entry"])
def test_damaged_cache_is_ignored(here: Path, lint: Lint, harm: str) -> None:
    lint(".")
    first, second = entries()[:2]
    data = bytearray(first.read_bytes())
    if harm == "flipped":
        for place in Random(harm).sample(range(len(data)), 20):
            data[place] ^= 1
    elif harm in ("cut", "emptied"):
        del data[len(data) // 2 if harm == "cut" else 0 :]
    elif harm == "swapped":
        data[:] = second.read_bytes()
    elif harm == "no entry":
        data[:] = sha256(b'{"mark": []}').hexdigest().encode() + b'\n{"mark": []}'
    if harm == "a folder":
        first.unlink()
        first.mkdir()
    else:
        first.write_bytes(data)
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)


def test_other_files_or_another_version_invalidate_the_entry(
    here: Path, lint: Lint, examined: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert lint("one.rts") == (ExitCode.DIAGNOSTICS, [("E1302", "one.rts")])
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)  # now the policy is linted too
    count = len(examined)
    monkeypatch.setattr("rtshcua.app.lint.session.mark", lambda: "another")
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert len(examined) == count + 2


def test_unwritable_cache_is_ignored(here: Path, lint: Lint) -> None:
    folder().write_text("I am a file")
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert folder().read_text() == "I am a file"


def test_cache_is_outside_the_project_with_one_folder_a_project(here: Path, lint: Lint) -> None:
    before = sorted(here.rglob("*"))
    lint(".")
    assert sorted(here.rglob("*")) == before
    assert (folder() / "lint/CACHEDIR.TAG").read_text().startswith("Signature: 8a477f597d28d172789f06886806bc55")
    put({".git/HEAD": "", "sub/rtshcua.toml": "", "sub/three.rts": MISSION.replace('"policy', '"../policy')})
    lint("sub")
    assert len(list((folder() / "lint/3").iterdir())) == 2
    put({"sub/rtshcua.toml": "lint.cache = false"})
    for entry in (folder() / "lint/3").rglob("*"):
        if entry.is_file():
            entry.unlink()
    lint("sub")
    assert not any(entry.is_file() for entry in (folder() / "lint/3").rglob("*"))


def test_cache_is_in_the_users_cache_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RTSHCUA_DATA_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "rtshcua"


def test_relative_cache_folder_is_ignored(here: Path, lint: Lint, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RTSHCUA_DATA_DIR", "data")
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert not (here / "data").exists()


def test_moved_cache_entry_is_ignored(here: Path, lint: Lint, examined: list[str]) -> None:
    lint(".")
    first, second = entries()[:2]
    first.replace(second)
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert len(examined) > 2


@pytest.mark.slow
def test_concurrent_runs_agree(here: Path) -> None:
    words = [sys.executable, "-m", "rtshcua", "lint", ".", "--format", "github"]
    runs = [subprocess.Popen(words, stdout=subprocess.PIPE, cwd=here) for _ in range(2)]
    said = {run.communicate()[0] for run in runs}
    assert len(said) == 1
    assert said.pop().count(b"::warning") == len(HABITS)


def test_cached_run_does_not_import_the_parser(here: Path, lint: Lint) -> None:
    lint(".")
    heavy = [
        "pydantic",
        "shapely",
        "lark",
        "typer",
        "cryptography",
        "rtshcua.ground.language.parse",
        "rtshcua.decision",
    ]
    program = (
        "import sys; from rtshcua.front.cli.app import main\n"
        f"code = main(['lint', '.']); print(code, [name for name in {heavy} if name in sys.modules])"
    )
    words = [sys.executable, "-c", program]
    done = subprocess.run(words, check=True, capture_output=True, text=True, cwd=here)
    assert done.stdout == "1 []\n", done.stderr
