"""Threat: another user writes the cache of `lint`, or makes `lint` write it to another place.

A checkout, possibly a foreign one, contains no cache and cannot configure its place. In the user's cache folder,
files that another user could have written are ignored.
"""

import json
import os
import shutil
from hashlib import sha256
from pathlib import Path

import pytest

from reference.lint_project import HABITS, MISSION, POLICY, UNUSED, Lint, put
from rtshcua.app.lint.cache import decoded
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    place = tmp_path / "checkout"
    place.mkdir()
    monkeypatch.chdir(place)
    put({"policy.rts": POLICY, "one.rts": MISSION, "two.rts": MISSION})
    return place


@pytest.fixture
def lint(capsys: pytest.CaptureFixture[str]) -> Lint:
    def run(*words: str) -> tuple[int, list[tuple[str, str]]]:
        code = main(["lint", *words, "--json"])
        answered = json.loads(capsys.readouterr().out)
        if "error" in answered:
            return code, [(answered["error"]["slug"], answered["error"]["message"])]
        return code, [(each["code"], (each["at"] or {"file": ""})["file"]) for each in answered["diagnostics"]]

    return run


def cache() -> Path:
    return Path(os.environ["RTSHCUA_DATA_DIR"], "cache/lint/3")


def entries() -> list[Path]:
    (checkout,) = cache().iterdir()
    return sorted(path for path in checkout.iterdir() if not path.name.startswith("."))


def forge(result: object) -> int:
    """Write another result into all entries, as an attacker with write access would."""
    for file in entries():
        data = json.dumps(json.loads(file.read_bytes().partition(b"\n")[2]) | {"result": result}).encode()
        file.write_bytes(sha256(data).hexdigest().encode() + b"\n" + data)
    return len(entries())


@pytest.mark.parametrize("folder", ["/abs", "../sibling", "inside", ".", "true"])
def test_configuration_cannot_move_the_cache(here: Path, lint: Lint, folder: str, tmp_path: Path) -> None:
    put({"rtshcua.toml": f'lint.cache = "{folder.replace("/abs", str(tmp_path / "abs"))}"'})
    before = sorted(tmp_path.rglob("*"))
    code, found = lint(".")
    assert (code, found[0][0]) == (ExitCode.INPUT, "configuration")
    assert "`cache` in `[lint]` is a string" in found[0][1]
    assert sorted(tmp_path.rglob("*")) == before


def test_cache_in_checkout_is_ignored(here: Path, lint: Lint) -> None:
    lint(".")
    assert forge([[], []]) == 3
    assert lint(".") == (ExitCode.OK, [])  # so it would be, if it were
    shutil.copytree(cache().parents[1], here / ".rtshcua_cache")
    shutil.copytree(cache(), here / ".rtshcua_cache/2")
    shutil.rmtree(cache())
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)


@pytest.mark.parametrize("above", [0, 1, 2, 3])
def test_cache_writable_by_others_is_ignored(here: Path, lint: Lint, above: int) -> None:
    lint(".")
    forge([[], []])
    place = entries()[0].parent
    for _ in range(above):
        place = place.parent
    place.chmod(0o777)
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)


@pytest.mark.parametrize("above", [0, 1, 2])
def test_no_link_is_followed_below_it(here: Path, lint: Lint, above: int, tmp_path: Path) -> None:
    lint(".")
    forge([[], []])
    place = entries()[0].parent
    for _ in range(above):
        place = place.parent
    place.rename(tmp_path / "elsewhere")
    place.symlink_to(tmp_path / "elsewhere")
    before = sorted(tmp_path.rglob("*"))
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert sorted(tmp_path.rglob("*")) == before


def test_symlink_or_pipe_as_cache_entry_is_ignored(here: Path, lint: Lint, tmp_path: Path) -> None:
    lint(".")
    forge([[], []])
    first, second, third = entries()
    for each in (first, third):
        each.rename(tmp_path / each.name)
        each.symlink_to(tmp_path / each.name)
    second.unlink()
    os.mkfifo(second)
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)
    assert all(each.is_file() and not each.is_symlink() for each in entries())


def test_fixes_never_come_from_cache(here: Path, lint: Lint) -> None:
    lint(".")
    start = POLICY.index("by role operator through agent when")
    fix = [["policy.rts", start, start + 39], "by any when", "do it", "safe"]
    forge([[], [["E1305", "x", ["policy.rts", start, start + 1], None, [], [fix], None]]])
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
def test_cache_entry_belongs_to_content_that_was_read(here: Path, lint: Lint, found: list[object]) -> None:
    """This includes our own entries, in case of a fault of ours."""
    lint(".")
    forge([[found], []])
    assert lint(".") == (ExitCode.DIAGNOSTICS, HABITS)


@pytest.mark.parametrize(
    "harm", [{"members": 1}, {"members": [1]}, {"reads": []}, {"reads": {"a": 1}}, {"packs": {"a": 1}}, {"result": 1}]
)
def test_malformed_cache_entry_is_ignored(harm: dict[str, object]) -> None:
    tree: dict[str, object] = {"mark": "m", "members": ["a"], "reads": {"a": "d"}, "packs": {}, "asked": {"a": None}}
    tree["result"] = [[], []]

    def held(tree: dict[str, object]) -> object:
        return decoded(json.dumps(tree).encode(), "m", {"a": None}, lambda _: "d", lambda _: None, lambda _: 5)

    assert held(tree) is not None
    assert held(tree | harm) is None
