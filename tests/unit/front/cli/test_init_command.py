"""`rtshcua init`: its project is valid under any name, and it never removes files."""

import json
import re
import subprocess
from pathlib import Path

import pytest

from rtshcua.front.cli import app
from rtshcua.front.cli.commands.init import EXAMPLE, FILES, project
from rtshcua.library import root

Said = pytest.CaptureFixture[str]


def everything(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_example_project_is_named_after_its_folder(tmp_path: Path, capsys: Said) -> None:
    folder = tmp_path / "sub/River-Side 2"
    assert app.main(["init", str(folder)]) == 0
    assert everything(folder) == project("river_side_2")
    assert "policy river_side_2 version 1" in (folder / "policies/rules.rts").read_text("utf-8")
    out = capsys.readouterr().out
    assert out.startswith("created river_side_2 in ")
    assert all(f"\n  {file}\n" in out for file in FILES)


def test_the_files_of_the_example_are_all_of_them() -> None:
    place = root() / "examples" / EXAMPLE
    tracked = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "."]
    listed = subprocess.run(tracked, cwd=place, capture_output=True, text=True, check=False)
    if listed.returncode == 0 and listed.stdout:
        assert {*listed.stdout.split()} == {*FILES}
    assert all((place / file).is_file() for file in FILES)


def test_no_other_name_is_left_in_it() -> None:
    assert not [file for file, data in project("riverside").items() if re.search(EXAMPLE.encode(), data)]
    assert project(EXAMPLE) == {file: (root() / "examples" / EXAMPLE / file).read_bytes() for file in FILES}


def test_default_project_folder_is_the_current_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said
) -> None:
    (tmp_path / "2 farms").mkdir()
    monkeypatch.chdir(tmp_path / "2 farms")
    Path(".git").mkdir()
    assert app.main(["init", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    renamed = said.pop("renamed")
    assert said == {"name": "site_2_farms", "folder": ".", "files": [*FILES], "kept": []}
    assert "`2 farms`" in renamed
    assert "`site_2_farms`" in renamed


def test_renamed_policy_is_reported_with_the_name_option(tmp_path: Path, capsys: Said) -> None:
    assert app.main(["init", str(tmp_path / "a b" / "ü")]) == 0
    said = capsys.readouterr().out
    assert "`ü` is not a valid policy name, so the policy is named `site`; choose another with `--name`" in said
    for words in (["--name", "own"], []):  # nothing to say where it was chosen, or is the folder's
        assert app.main(["init", str(tmp_path / "x" / ("ü" if words else "fields")), *words]) == 0
        assert "--name" not in capsys.readouterr().out


def test_a_long_name_is_cut(tmp_path: Path) -> None:
    assert app.main(["init", str(tmp_path / ("abcdefghi-" * 9))]) == 0
    assert "policy abcdefghi_abcdefghi_abcdefghi_abcdefghi version 1" in (
        next(tmp_path.iterdir()) / "policies/rules.rts"
    ).read_text("utf-8")


def test_existing_files_require_force(tmp_path: Path, capsys: Said) -> None:
    for name in ("README.md", "notes.txt"):
        (tmp_path / name).write_text("mine")
    assert app.main(["init", str(tmp_path), "--name", "a", "--json"]) == 3
    out, err = capsys.readouterr()
    assert json.loads(out)["error"]["slug"] == "exists"
    assert f"`{tmp_path}/README.md`" in err
    assert "--force" in err
    assert everything(tmp_path) == {"README.md": b"mine", "notes.txt": b"mine"}
    assert app.main(["init", str(tmp_path), "--name", "a", "--force"]) == 0
    assert everything(tmp_path) == project("a") | {"notes.txt": b"mine"}


def test_keep_keeps_the_files_of_a_new_repository(tmp_path: Path, capsys: Said) -> None:
    mine = {"README.md": b"mine", "LICENSE": b"mine", ".gitignore": b"mine", ".git/HEAD": b"mine"}
    for name, data in mine.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(data)
    assert app.main(["init", str(tmp_path), "--name", "a"]) == 3
    assert "--keep" in capsys.readouterr().err
    assert app.main(["init", str(tmp_path), "--name", "a", "--keep"]) == 0
    assert everything(tmp_path) == project("a") | mine
    out = capsys.readouterr().out
    assert "kept unchanged: README.md, .gitignore\n" in out
    assert "\n  README.md\n" not in out
    assert app.main(["lint", str(tmp_path), "--no-cache"]) == 0


def test_to_keep_and_to_replace_is_a_contradiction(tmp_path: Path) -> None:
    assert app.main(["init", str(tmp_path / "x"), "--keep", "--force"]) == 2
    assert not (tmp_path / "x").exists()


def test_a_folder_in_the_way_is_not_kept(tmp_path: Path, capsys: Said) -> None:
    (tmp_path / "README.md").mkdir()
    assert app.main(["init", str(tmp_path), "--name", "a", "--keep"]) == 3
    assert f"in the way: `{tmp_path}/README.md`" in capsys.readouterr().err


def test_unwritable_folder_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Said) -> None:
    make = Path.mkdir

    def refused(self: Path, *given: object, **named: object) -> None:
        if self.is_relative_to(tmp_path):
            raise PermissionError(13, "Permission denied", str(self))
        make(self, *given, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(Path, "mkdir", refused)
    assert app.main(["init", str(tmp_path / "x")]) == 74
    assert "permission denied" in capsys.readouterr().err


def test_a_file_in_the_way_is_refused_even_with_force(tmp_path: Path, capsys: Said) -> None:
    (tmp_path / "policies").write_text("mine")
    assert app.main(["init", str(tmp_path), "--name", "a", "--force"]) == 3
    assert f"in the way: `{tmp_path}/policies`" in capsys.readouterr().err
    assert everything(tmp_path) == {"policies": b"mine"}
    assert app.main(["init", str(tmp_path / "policies"), "--name", "a"]) == 3


@pytest.mark.parametrize("name", ["Farm", "2", "a b", "", "größe", "../x", "a" * 41])
def test_invalid_name_is_refused(tmp_path: Path, name: str, capsys: Said) -> None:
    assert app.main(["init", str(tmp_path / "x"), "--name", name]) == 2
    assert "is not a valid policy name" in capsys.readouterr().err
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("name", ["permit", "version", "roof", "scout", "hover", "look_around"])
def test_a_name_that_means_something_else_is_refused_or_works(tmp_path: Path, name: str, capsys: Said) -> None:
    code = app.main(["init", str(tmp_path / "x"), "--name", name])
    err = capsys.readouterr().err
    if code == 0:
        assert app.main(["check", str(tmp_path / "x"), "--deny-warnings"]) == 0
    else:
        assert code == 2
        assert err.startswith(f"error[name]: `{name}` cannot be the name of the project: ")
        assert not (tmp_path / "x").exists()
