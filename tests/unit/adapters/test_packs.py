"""Packs of skills: found by entry points, imported by name, and flown by their own code."""

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rtshcua.adapters import packs
from rtshcua.adapters.vehicle import ardupilot as ardupilot
from rtshcua.adapters.vehicle import px4 as px4
from rtshcua.ground.language.load import load

Install = Callable[[str, str, str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    """Install a package with entry points and the source of one module, for this test."""
    site = tmp_path / "site"
    site.mkdir()
    monkeypatch.syspath_prepend(str(site))
    forget()
    for module in ("acme_code", "evil_code"):
        monkeypatch.delitem(sys.modules, module, raising=False)

    def install(name: str, points: str, module: str) -> None:
        info = site / f"{name}-1.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1\n", encoding="utf-8")
        (info / "entry_points.txt").write_text(points, encoding="utf-8")
        (site / f"{name}.py").write_text(module, encoding="utf-8")
        (site / name / "skills").mkdir(parents=True)
        (site / name / "skills" / "spray.rts").write_text("zone z = circle(47 N, 8 E, 50 m)\n", encoding="utf-8")

    yield install
    forget()


def forget() -> None:
    """Clear the cache of packs that were found."""
    packs.folder.cache_clear()
    packs.manoeuvres.cache_clear()


SKILLS = "[rtshcua.skills]\n{0} = {0}_code:folder\n"
FOLDER = "from pathlib import Path\ndef folder():\n    return Path(__file__).with_name({0!r})\n"
OWN = "def stages(command, seen, system):\n    return []\n"


def package(install: Install, name: str, points: str = "", more: str = "", pack: str | None = None) -> None:
    shelf = SKILLS.format(name) if pack is None else f"[rtshcua.skills]\n{pack} = {name}_code:folder\n"
    install(name, shelf + points, "")
    install(f"{name}_code", "", FOLDER.format(name) + more)


def test_shipped_packs_use_the_entry_point() -> None:
    shipped = packs.manoeuvres(frozenset())
    assert shipped == {"px4": px4.stages, "ardupilot": ardupilot.stages}
    folder = packs.folder("lib")
    assert folder is not None
    assert (Path(folder) / "skills" / "goto.rts").is_file()


def test_a_pack_is_imported_by_its_name(install: Install) -> None:
    package(install, "acme")
    read = {"m.rts": b'import "acme:skills/spray.rts"'}
    program = load(["m.rts"], lambda path: read.get(path) or Path(path).read_bytes(), packs=packs.folder)
    assert program.diagnostics == ()
    assert sorted(program.stable.values()) == ["acme:skills/spray.rts", "m.rts"]
    assert packs.packs_of(program.stable.values()) == {"acme"}


@pytest.mark.parametrize("path", ["acme:../other/x.rts", "acme:skills/../../x.rts", "acme:/etc/passwd", "acme:./x.rts"])
def test_imports_cannot_leave_a_pack(install: Install, path: str) -> None:
    package(install, "acme")
    read: list[str] = []

    def bytes_of(name: str) -> bytes:
        read.append(name)
        return f'import "{path}"'.encode()

    (found,) = load(["m.rts"], bytes_of, packs=packs.folder).diagnostics
    assert found.code.id == "E0109"
    assert found.message == f"`{path}` is not a direct path into the pack `acme`"
    assert read == ["m.rts"]


def test_a_pack_that_is_not_there() -> None:
    (found,) = load(["m.rts"], lambda _: b'import "nobody:skills/spray.rts"', packs=packs.folder).diagnostics
    assert found.code.id == "E0109"
    assert found.message == "`nobody:skills/spray.rts` is in the pack `nobody`, which is not installed"
    assert found.help == "install the package with the entry point `nobody` of `rtshcua.skills`"


def test_manoeuvres_come_only_from_packs_of_the_policy(install: Install) -> None:
    package(install, "acme", "[rtshcua.manoeuvres]\npx4.spray = acme_code:stages\n", OWN)
    assert set(packs.manoeuvres(frozenset({"lib"}))) == {"px4", "ardupilot"}
    own = packs.manoeuvres(frozenset({"lib", "acme"}))
    assert set(own) == {"px4", "ardupilot", "px4.spray"}
    assert own["px4.spray"](None, None, 1) == []  # type: ignore[arg-type]


def test_no_pack_replaces_how_everything_else_is_flown(install: Install) -> None:
    package(install, "acme", "[rtshcua.manoeuvres]\npx4 = acme_code:stages\n", OWN)
    assert packs.manoeuvres(frozenset({"acme"}))["px4"] is px4.stages


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("raise ValueError('no licence')", "cannot be loaded: no licence"),
        ("stages = 3", "is not a function"),
        ("", "cannot be loaded"),
    ],
)
def test_broken_manoeuvre_stops_a_flight_before_takeoff(install: Install, more: str, says: str) -> None:
    package(install, "acme", "[rtshcua.manoeuvres]\npx4.spray = acme_code:stages\n", more)
    with pytest.raises(packs.BrokenPack, match=says):
        packs.manoeuvres(frozenset({"acme"}))


def test_pack_of_two_packages_is_refused(install: Install) -> None:
    package(install, "acme")
    package(install, "evil", pack="acme")
    with pytest.raises(packs.BrokenPack, match=r"is provided by the package `\w+` and the package `\w+`"):
        packs.folder("acme")


def test_the_shipped_pack_cannot_be_claimed(install: Install) -> None:
    package(install, "evil", "[rtshcua.manoeuvres]\npx4 = evil_code:stages\n", OWN, pack="lib")
    with pytest.raises(packs.BrokenPack, match="is provided by two packages"):
        packs.manoeuvres(frozenset())
