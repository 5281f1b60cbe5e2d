"""Only the owner may write created files, with any umask, and only the owner may read secret ones."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from rtshcua.front.cli import app

CHECKOUT = Path(__file__).resolve().parents[2]
#: parts of the paths of what nobody else may read
SECRET = ("keys", "state", "link.key")
#: how many files all commands make together, at least
MOST = 30


@pytest.fixture(params=[0o000, pytest.param(0o077, marks=pytest.mark.soak)], ids=["000", "077"])
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


def made(folder: Path) -> dict[str, int]:
    """The mode of each file, folder and socket below a folder, which it is not itself."""
    found = {str(each.relative_to(folder)): each.lstat() for each in sorted(folder.rglob("*"))}
    return {name: stat.S_IMODE(each.st_mode) for name, each in found.items() if not stat.S_ISLNK(each.st_mode)}


@pytest.mark.slow
def test_created_files_are_writable_by_the_owner_only(
    umask: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    place = tmp_path / "here"
    place.mkdir(mode=0o755)
    for name in ("DATA", "STATE", "CACHE", "CONFIG"):
        monkeypatch.setenv(f"XDG_{name}_HOME", str(place / name.lower()))
    monkeypatch.chdir(place)
    policy, mission = CHECKOUT / "policies/bridge_inspection.rts", CHECKOUT / "missions/short.rts"
    proposal = CHECKOUT / "missions/proposal.json"
    lines = (
        "keys init", f"compile {mission} -o short.bundle", f"compile {proposal} --with {policy} -o base.bundle",
        "init project", f"docs {policy} -o policy.html", f"schema --policy {policy}", "lint project", "fmt project",
        f"agent-bundle --bundle base.bundle --to s.sock --with {policy} plugin/made",
        "test project --junit junit.xml", f"test {policy} --generate -o generated.rts",
        "keys link link.key",
        "run short.bundle --speed 10 --runs runs --plain --state-dir state --agent-socket agent.sock",
    )  # fmt: skip
    for line in lines[: len(lines) - (umask > 0)]:  # one flight is enough
        code = app.main(line.split())
        late = line.startswith("run") and code == 5  # the computer was busy: what was made is looked at all the same
        assert code == 0 or late, (line, code, capfd.readouterr())
    found = made(place)
    assert {name: oct(mode) for name, mode in found.items() if mode & 0o022 or (umask and mode & 0o077)} == {}
    secret = {name: oct(mode) for name, mode in found.items() if set(SECRET) & set(Path(name).parts) and mode & 0o077}
    assert secret == {}
    assert len(found) >= MOST
