"""A file of a wrong kind is reported with the command for its kind."""

from pathlib import Path

import pytest

from rtshcua.front.cli import app

CHECKOUT = Path(__file__).resolve().parents[2]
FILES = {
    "survey.plan": (
        b'{"fileType":"Plan","groundStation":"QGroundControl","mission":{},"version":1}',
        "a QGroundControl plan",
    ),
    "area.geojson": (b'{"type":"FeatureCollection","features":[]}', "GeoJSON"),
    "zones.json": (b'{"features":[{"geometry":[{"horizontalProjection":{"type":"Circle"}}]}]}', "(ED-269)"),
    "README.md": (b"# Read me\n\nAll about drones.\n", "a Markdown document"),
    "a.waypoints": (b"QGC WPL 110\n0\t1\t0\t16\t0\t0\t0\t0\t47.3\t8.5\t488\t1\n", "waypoints"),
    "a.kml": (b'<?xml version="1.0"?><kml xmlns="http://www.opengis.net/kml/2.2"></kml>', "KML"),
    "proposal.json": ((CHECKOUT / "missions/proposal.json").read_bytes(), "a mission specification"),
    "short.rts": ((CHECKOUT / "missions/short.rts").read_bytes(), "a source"),
    "log.jsonl": ((CHECKOUT / "tests/vectors/log/sealed.jsonl").read_bytes(), "a flight log"),
    "a.bundle": (b"\x83nrtshcua/bundle\x01\x82\x40\x40", "a compiled bundle"),
}
#: commands by the accepted kinds of files, and their command lines
COMMANDS = {
    "check {}": ("proposal.json", "short.rts"), "fmt --check {}": ("proposal.json", "short.rts", "zones.json"),
    "lint {}": ("proposal.json", "short.rts", "zones.json"), "test {}": ("proposal.json", "short.rts", "zones.json"),
    "compile {} -o made.bundle": ("proposal.json", "short.rts", "a.bundle"), "run --dry-run {}": ("a.bundle",),
    "show {}": ("a.bundle", "log.jsonl"), "verify-log {}": ("log.jsonl",), "verify-proof {}": (),
    "why {}": ("proposal.json", "short.rts", "log.jsonl", "a.bundle"),
    "recall {} --output made.recall": ("a.bundle",), "doctor --bundle {} --connect udpin:127.0.0.1:0": tuple(FILES),
}  # fmt: skip


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wrong")
    for name, (data, _) in FILES.items():
        (folder / name).write_bytes(data)
    return folder


@pytest.mark.parametrize("command", COMMANDS)
def test_file_of_another_kind_is_named(
    command: str, place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(place)
    assert app.main(["keys", "init"]) == 0
    wrong = {}
    for name, (_, words) in FILES.items():
        if name in COMMANDS[command]:
            continue
        code = app.main(command.format(name).split())
        told = "".join(capsys.readouterr())
        if code not in (1, 3, 9, 13) or " ".join(words.split()) not in " ".join(told.split()) or "Traceback" in told:
            wrong[name] = (int(code), told[:300])
    assert wrong == {}


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("chek x", "no such command: `chek`|did you mean `rtshcua check`?"),
        ("keys lst", "no such command: `keys lst`|did you mean `rtshcua keys list`?"),
        ("archive ad x", "no such command: `archive ad`|did you mean `rtshcua archive add`?"),
        ("keys frobnicate", "no such command: `keys frobnicate`|run `rtshcua keys --help` for a list of commands"),
        ("sim --fault batery,at=3s", "no such fault: `batery`; did you mean `battery`?"),
        ("sim --fault quantum,at=3s", "no such fault: `quantum`; expected one of battery, "),
    ],
)
def test_unknown_word_suggests_the_nearest(line: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(line.split()) == 2
    told = "".join(capsys.readouterr())
    assert [each for each in words.split("|") if each not in told] == []
