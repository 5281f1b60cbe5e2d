"""A cache that somebody else has written to: nothing of it is believed, nothing is written where it leads."""

import json
import os
import shutil
from hashlib import sha256
from pathlib import Path

import pytest

from reference.lint_project import HABITS, POLICY, UNUSED, Lint, put
from rtshcua.adapters.files import lint_cache
from rtshcua.adapters.files.lint_cache import LintCache
from rtshcua.cli.linting.examined import decoded
from rtshcua.diagnostics.exits import ExitCode
from virtual.rows import rows

FOLDER = Path(".rtshcua_cache")


def entries() -> list[Path]:
    return sorted(path for path in (FOLDER / "2").iterdir() if not path.name.startswith("."))


def forge(result: object, sign: bool, own: Path) -> int:
    """Write another result into all entries; signed as this user would, or as anybody can."""
    cache = LintCache(Path(), str(FOLDER), lint_cache.lint_secret(own))
    for file in entries():
        tree = json.loads(file.read_bytes().partition(b"\n")[2]) | {"result": result}
        data = json.dumps(tree).encode()
        if sign:
            cache.put(file.name, data)
        else:
            file.write_bytes(sha256(data).hexdigest().encode() + b"\n" + data)
    return len(entries())


@pytest.fixture
def own() -> Path:
    return Path(os.environ["RTSHCUA_DATA_DIR"])


def test_a_forged_entry_is_none(here: Path, lint: Lint, own: Path) -> None:
    lint(".")
    assert forge([[], []], False, own) == 3
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert forge([[], []], True, own) == 3  # it is the secret that keeps others out
    assert lint(".") == (ExitCode.OK, [])


def test_a_cache_of_somebody_else_is_none(here: Path, lint: Lint, own: Path) -> None:
    lint(".")
    forge([[], []], True, own)
    (secret,) = own.rglob("lint.secret")
    assert secret.stat().st_mode & 0o777 == 0o600
    assert len(secret.read_bytes()) == 32
    secret.unlink()
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)


def test_an_entry_in_the_place_of_another_is_none(here: Path, own: Path) -> None:
    cache = LintCache(Path(), str(FOLDER), lint_cache.lint_secret(own))
    cache.put("a", b"entry")
    assert cache.get("a") == b"entry"
    (FOLDER / "2" / "a").rename(FOLDER / "2" / "b")
    assert cache.get("b") is None


@pytest.mark.parametrize("harm", ["read by all", "cut", "a link", "a folder"])
def test_a_secret_that_is_none_is_made_anew(own: Path, harm: str) -> None:
    first = lint_cache.lint_secret(own)
    (file,) = own.rglob("lint.secret")
    assert lint_cache.lint_secret(own) == first
    if harm == "read by all":
        file.chmod(0o644)
    elif harm == "cut":
        file.write_bytes(b"x")
    else:
        file.rename(own / "elsewhere")
        (file.mkdir if harm == "a folder" else lambda: file.symlink_to(own / "elsewhere"))()
    second = lint_cache.lint_secret(own)
    if harm == "a folder":
        assert second is None
    else:
        assert second not in (None, first)
        assert lint_cache.lint_secret(own) == second
        assert file.stat().st_mode & 0o777 == 0o600


def test_without_a_secret_there_is_no_cache(here: Path, lint: Lint, own: Path) -> None:
    shutil.rmtree(own)
    own.write_text("I am a file")
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert not FOLDER.exists()


def test_fixes_are_of_a_fresh_examination_alone(here: Path, lint: Lint, own: Path) -> None:
    lint(".")
    start = POLICY.index("by role operator through agent when")
    fix = [["policy.rts", start, start + 39], "by any when", "do it", "safe"]
    forge([[], [["E1305", "x", ["policy.rts", start, start + 1], None, [], [fix], None]]], True, own)
    assert lint(".", "--fix") == (ExitCode.DIAGNOSTICS, [HABITS[0], HABITS[2]])
    assert Path("policy.rts").read_text() == POLICY.replace(f"{UNUSED}\n", "")


@pytest.mark.parametrize(
    "found",
    [
        ["E1303", 1, ["policy.rts", "a", "b"], None, [], [], None],
        ["E1303", "x", ["/etc/passwd", 0, 5], None, [], [], None],
        ["E1303", "x", ["policy.rts", 0, 1 << 40], None, [], [], None],
        ["E1303", "x", ["policy.rts", 0, 1], None, [[["/etc/passwd", 0, 5], "here"]], [], None],
        ["E1303", "x", ["policy.rts", 0, 1], None, [], [[["/etc/passwd", 0, 5], "", "x", "safe"]], None],
    ],
)  # fmt: skip
def test_what_is_remembered_is_about_what_was_read(here: Path, lint: Lint, own: Path, found: list[object]) -> None:
    """Even of what bears our own mark, as an earlier fault of ours would."""
    lint(".")
    forge([[found], []], True, own)
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)


@rows(
    "harm", [{"members": 1}, {"members": [1]}, {"reads": []}, {"reads": {"a": 1}}, {"packs": {"a": 1}}, {"result": 1}]
)
def test_a_tree_of_another_shape_is_none(harm: dict[str, object]) -> None:
    tree: dict[str, object] = {"mark": "m", "members": ["a"], "reads": {"a": "d"}, "packs": {}, "asked": {"a": None}}
    tree["result"] = [[], []]

    def held(tree: dict[str, object]) -> object:
        return decoded(json.dumps(tree).encode(), "m", {"a": None}, lambda _: "d", lambda _: None, lambda _: 5)

    assert held(tree) is not None
    assert held(tree | harm) is None


@pytest.mark.parametrize("linked", [".", "2"])
def test_a_folder_that_is_a_link_is_not_written_through(here: Path, lint: Lint, linked: str) -> None:
    (here / "elsewhere").mkdir()
    if linked == "2":
        lint(".")
        shutil.rmtree(FOLDER / "2")
    (FOLDER if linked == "." else FOLDER / "2").symlink_to(here / "elsewhere")
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert list((here / "elsewhere").iterdir()) == []


def test_a_link_in_it_is_not_followed(here: Path, lint: Lint) -> None:
    FOLDER.mkdir()
    (FOLDER / ".gitignore").symlink_to("../victim")
    (FOLDER / "CACHEDIR.TAG").symlink_to("../victim")
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert not Path("victim").exists()
    shutil.rmtree(FOLDER)
    lint(".")
    first = entries()[0]
    first.rename("moved")
    first.symlink_to(here / "moved")
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)


def test_a_folder_of_other_things_is_not_made_a_cache(here: Path, lint: Lint) -> None:
    put({"work/notes.txt": "mine", "rtshcua.toml": 'lint.cache = "work"'})
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert [path.name for path in Path("work").iterdir()] == ["notes.txt"]


@pytest.mark.parametrize("folder", [".", "./", "..", "../..", "a/..", "/", "a\\u0000b"])
def test_a_folder_that_cannot_be_one_is_refused(here: Path, lint: Lint, folder: str) -> None:
    put({"rtshcua.toml": f'lint.cache = "{folder}"'})
    code, found = lint(".")
    assert (code, found[0][0]) == (ExitCode.INPUT, "configuration")
    assert "rtshcua.toml:1" in found[0][1]
    assert not Path(".gitignore").exists()


def test_a_folder_above_it_that_is_a_link_is_not_written_through(here: Path, lint: Lint) -> None:
    put({"rtshcua.toml": 'lint.cache = "build/cache"'})
    (here / "elsewhere/cache").mkdir(parents=True)
    Path("build").symlink_to(here / "elsewhere")
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert list((here / "elsewhere/cache").iterdir()) == []


def test_a_pipe_in_it_is_not_waited_for(here: Path, lint: Lint) -> None:
    lint(".")
    first = entries()[0]
    first.unlink()
    os.mkfifo(first)
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert first.is_file()
