"""A redacted picture: what is removed is nowhere in the page, and what is embedded has no record of it."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import bound_run
from reference.forgery import edit, signed
from rtshcua.app.flights.left_over import LeftOver
from rtshcua.app.flights.redaction import REDACTABLE, _no_place, redaction_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.merkle import MerkleTree, leaf_hash
from rtshcua.evidence.note import octets
from rtshcua.front.cli.app import main
from rtshcua.ground.flight.embedding import embed, extract
from rtshcua.ground.flight.flight_content import FlightReport, as_plain
from rtshcua.ground.flight.flight_page import page
from rtshcua.model.flat.signal import NUMBER, Signal, SignalSource
from rtshcua.model.flat.zone import Projection
from virtual import case, run_folder
from virtual.flight_reports import report_of
from virtual.once import once

NAMES = ["quad-07", "inspect_bridge_a", "bridge_a", "openclaw", "bridge_inspection", "policies/bridge.rts", "school"]
#: a number that a text of others has, and a word
MARK = "47.39774 sentinel_of_others"
HOME = case.policy().projection


def places(text: str, home: Projection = HOME) -> Iterator[str]:
    """The numbers within a tenth of a degree of home, in degrees or in 1e-7 degree."""
    for found in re.finditer(r"-?\d+\.\d{3,}|-?\d{7,10}", text):
        value = float(found[0]) * (1e7 if "." in found[0] else 1)
        if any(abs(value - at) < 1_000_000 for at in (home.latitude, home.longitude)):
            yield found[0]


def shown(report: FlightReport) -> str:
    """The text of a redacted page, its data and its embedded records, without scripts, times and digests."""
    text = re.sub(
        r"<(style|script)(?! type=.application/json).*?</\1>", "", page(report.without_log()), flags=re.DOTALL
    )
    lines = json.loads(extract(report.log))["lines"] if report.log else []
    return text + "".join(re.sub(r'"(\w*_us|bytes)":\d+', "", line) for _, line in lines)


def texts(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for each in value.values():
            yield from texts(each)
    elif isinstance(value, list):
        for each in value:
            yield from texts(each)


def failing(completed: Path, at: Path) -> None:
    lines = (completed / "log.jsonl").read_bytes()
    (at / "log.jsonl").write_bytes(lines.replace(b'"admitted"', b'"admitteD"', 1))


def incomplete(completed: Path, at: Path) -> None:
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    (at / "log.jsonl").write_bytes(b"".join(lines[:-3]))


def never_flown(completed: Path, at: Path) -> None:
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    first = next(number for number, line in enumerate(lines) if b'"type":"decision"' in line)
    (at / "log.jsonl").write_bytes(b"".join(lines[:first]))


def talkative(completed: Path, at: Path) -> None:
    """Every text of others in the log says where the vehicle is, and who flies it."""
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    changed = []
    for line in lines:
        if b'"type":"effect"' in line:
            line = edit(line, detail=f"quad-07 {MARK}")
        elif b'"type":"decision"' in line:
            line = edit(line, clause=f"`quad-07` {MARK}", target=f"`{MARK}")
        changed.append(line)
    (at / "log.jsonl").write_bytes(b"".join(signed(changed)))


def bound(_: Path, at: Path) -> None:
    run = bound_run.run_folder(at)
    file = bound_run.with_log(run, "quad-07_over_school.ulg")
    assert main(bound_run.bind_words(run, file)) == ExitCode.OK


@pytest.mark.parametrize("removed", [("position",), ("names",), REDACTABLE])
@pytest.mark.parametrize("make", [failing, incomplete, never_flown, talkative, bound])
def test_every_kind_of_log(
    make: Callable[[Path, Path], None], removed: tuple[str, ...], completed: Path, tmp_path: Path
) -> None:
    make(completed, tmp_path)
    found = report_of(tmp_path, *removed)
    assert found.redaction is not None
    assert found.redaction.left(page(found.report)) is None
    text = shown(found.report) + json.dumps(as_plain(found.report.without_log()._replace(begun_utc_us=0)))
    assert "sentinel_of_others" not in text
    assert ".ulg" not in text
    if "names" in removed:
        assert [name for name in NAMES if name in text] == []
    if "position" in removed:
        assert list(places(shown(found.report))) == []
        assert not re.search(r"\d m (?:across|from)|bearing|above the sea", text)


@pytest.mark.parametrize("run", ["completed", "turned"])
def test_names_are_gone(run: str, request: pytest.FixtureRequest) -> None:
    folder: Path = request.getfixturevalue(run)
    whole = page(report_of(folder).report)
    assert [name for name in NAMES if name not in whole] == []
    text = shown(report_of(folder, "names").report)
    assert [name for name in NAMES if name in text] == []
    assert "not a record" in text
    assert "`" not in text


@pytest.mark.parametrize("run", ["completed", "turned"])
def test_positions_are_gone(run: str, request: pytest.FixtureRequest) -> None:
    folder: Path = request.getfixturevalue(run)
    found = report_of(folder, "position")
    assert list(places(page(report_of(folder).report)))
    assert list(places(shown(found.report))) == []
    assert found.report.site.zones == ()
    assert found.report.way.steps == ()
    assert {each.series.name for each in found.report.signals} <= {"battery", "height", "link.quality", "gps.fix"}


def test_heights_and_times_stay(completed: Path) -> None:
    whole, redacted = report_of(completed).report, report_of(completed, "position", "names").report
    assert redacted.highest == whole.highest
    assert [each.t_us for each in redacted.decisions] == [each.t_us for each in whole.decisions]
    assert [each.outcome for each in redacted.decisions] == [each.outcome for each in whole.decisions]
    assert whole.track is not None
    assert redacted.track is not None
    assert redacted.track.places == ()
    assert redacted.site.elevation is None
    assert [each.above_home for each in redacted.track.points] == [each.above_home for each in whole.track.points]
    assert {each.above_ground for each in redacted.track.points} == {None}
    data = json.loads(page(redacted).partition('id="flight-data">')[2].partition("</script>")[0])
    assert (data["track"]["x"], data["track"]["y"], data["map"], data["home"]) == ([], [], None, None)
    assert any(data["track"]["up"])


def placed(number: int, message: str, field: str, dimension: str) -> Signal:
    return Signal(f"s{number}", 0, NUMBER, dimension, 1, (), (SignalSource(message, (field,), 1, 1, ()),))


@pytest.mark.parametrize(
    ("message", "field", "dimension", "stays"),
    [
        ("GLOBAL_POSITION_INT", "relative_alt", "altitude", True),
        ("GLOBAL_POSITION_INT", "alt", "altitude", False),
        ("GLOBAL_POSITION_INT", "alt", "count", False),
        ("GLOBAL_POSITION_INT", "vx", "speed", False),
        ("GLOBAL_POSITION_INT", "vz", "speed", True),
        ("GLOBAL_POSITION_INT", "hdg", "angle", False),
        ("GPS_RAW_INT", "lat", "ratio", False),
        ("GPS_RAW_INT", "fix_type", "GPS_FIX_TYPE", True),
        ("ALTITUDE", "altitude_amsl", "length", False),
        ("ALTITUDE", "altitude_relative", "length", True),
        ("NAV_CONTROLLER_OUTPUT", "wp_dist", "length", False),
        ("HOME_POSITION", "altitude", "length", False),
        ("BATTERY_STATUS", "battery_remaining", "ratio", True),
        ("A_MESSAGE_OF_TOMORROW", "value", "count", False),
    ],
)
def test_signals_stay_by_what_they_are_read_from(message: str, field: str, dimension: str, stays: bool) -> None:
    signal = placed(1, message, field, dimension)
    assert _no_place(signal) is stays
    assert not _no_place(replace(signal, sources=()))


@pytest.mark.parametrize("removed", [("position",), ("names",), REDACTABLE])
def test_leaves_are_those_of_the_log(completed: Path, removed: tuple[str, ...]) -> None:
    document = json.loads(extract(report_of(completed, *removed).report.log))
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    tree = MerkleTree()
    for line, leaf in zip(lines, document["leaves"], strict=True):
        assert octets(leaf) == leaf_hash(line)
        tree.push(leaf_hash(line))
    assert octets(document["root"]) == tree.root()
    for number, text in document["lines"]:
        assert text.encode() + b"\n" == lines[number]
        assert json.loads(text)["type"] not in ("genesis", "decision")
    assert bool(document["checkpoints"]) == ("names" not in removed)


LEFT = ["quad-07", "47.3977418", "inspect_bridge_a", "QUAD_07", "x-Quad 07-y", "quad%2D07", "inspect-bridge-a.html"]


@pytest.mark.parametrize("left", LEFT)
def test_page_with_something_left_is_refused(left: str, completed: Path) -> None:
    found = report_of(completed, "position", "names")
    assert found.redaction is not None
    text = page(found.report)
    assert found.redaction.left(text) is None
    document = json.loads(extract(found.report.log))
    effect = next(number for number, line in enumerate(document["lines"]) if '"effect"' in line[1])
    line = document["lines"][effect][1]
    changed = {
        "visible": text.replace("<main", f"<p>{left}</p><main"),
        "attribute": text.replace("<main", f'<main title="{left}"', 1),
        "comment": text.replace("<main", f"<!-- {left} --><main"),
        "style": text.replace("</style>", f"/* {left} */</style>", 1),
        "script": text.replace("</body>", f"<script>'{left}'</script></body>"),
        "in a script": text.replace("</script>\n</body>", f"// {left}\n</script>\n</body>"),
        "data": text.replace('"signals":[', f'"signals":["{left}",', 1),
        "key": text.replace('"signals":', f'"{left}":1,"signals":', 1),
        "embedded": with_document(text, found.report.log, {**document, "more": left}),
        "detail": with_document(
            text, found.report.log,
            {**document, "lines": [[0, line.replace('"detail":""', f'"detail":"{left}"')]]},
        ),
        "genesis": with_document(
            text, found.report.log, {**document, "lines": [[0, (completed / "log.jsonl").read_text().split("\n")[0]]]}
        ),
    }  # fmt: skip
    missed = [where for where, each in changed.items() if each == text or found.redaction.left(each) is None]
    assert missed == []
    refused = found.redaction.left(changed["visible"])
    assert isinstance(refused, Refusal)
    assert refused.code == ExitCode.FAULT


def with_document(text: str, log: str, document: dict[str, object]) -> str:
    return text.replace(log, embed(json.dumps(document).encode()))


def test_places_in_the_data_are_refused(completed: Path) -> None:
    found = report_of(completed, "position")
    assert found.redaction is not None
    text = page(found.report)
    for old, new in [('"x":[]', '"x":[1]'), ('"map":null', '"map":{"scale":1}'), ('"home":null', '"home":4880')]:
        assert old in text
        assert isinstance(found.redaction.left(text.replace(old, new)), Refusal)


#: ordinary words, words of closed lists, names within names, letters of other scripts, a word of the language
WORDS = {"city": "allow", "bridge_a": "decided", "school": "schoolyard"}


@pytest.fixture(scope="module")
def strangely_named(tmp_path_factory: pytest.TempPathFactory) -> Path:
    policy, mission = case.policy(), case.mission(case.short_steps())
    policy = replace(
        policy,
        name="standard",
        zones=tuple(replace(each, name=WORDS.get(each.name, each.name)) for each in policy.zones),
        signals=tuple(replace(each, name="acme.link") if each.name == "link.quality" else each
                      for each in policy.signals),
        roles=tuple(f"zurich_{each}" for each in policy.roles),
    )  # fmt: skip
    mission = replace(mission, name="short", proposer="way", policy="standard", phases=("log", "laeuft", "verified"))
    flown = once("flight-report-named", lambda: run_folder.fly(mission, case.simulated("px4"), policy))
    return run_folder.folder(tmp_path_factory.mktemp("named") / "run", flown)


def test_words_of_lists_and_ordinary_words_may_be_names(strangely_named: Path) -> None:
    whole, found = report_of(strangely_named).report, report_of(strangely_named, "names")
    assert found.redaction is not None
    text = page(found.report)
    assert found.redaction.left(text) is None
    assert {each.lane for each in found.report.timeline} == {each.lane for each in whole.timeline}
    assert [each.outcome for each in found.report.decisions] == [each.outcome for each in whole.decisions]
    assert found.report.verdict == whole.verdict
    assert [each.series.dimension for each in found.report.signals] == [each.series.dimension for each in whole.signals]
    assert [each.name for each in found.report.site.zones[:3]] == ["zone 1", "zone 2", "zone 3"]
    assert found.report.summary[0].answer.startswith("Mission `the mission`, proposed by `a proposer`")
    assert "acme" in page(whole)
    for gone in ("acme", "schoolyard", "zurich", "laeuft"):
        assert gone not in text
    for left in ("Acme.Link", "ZURICH-operator", "l%61euft", "2026_schoolyard_1.html"):
        assert isinstance(found.redaction.left(text.replace("<main", f"<p>{left}</p><main")), Refusal), left


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("Zürich", "ZU\u0308RICH"), ("straße", "STRASSE"), ("李明", "(李明)"), ("Łódź", "x/%C5%81%C3%B3d%C5%BA.html"),
        ("O'Hara", "o'hara"), ("a.b-c", "A_B C"), ("quad-07", "quad\u00ad-\u200b07"),
    ],
)  # fmt: skip
def test_names_are_found_in_every_shape(name: str, text: str) -> None:
    search = LeftOver((name,), set(), lambda _: True, None)
    assert search.in_page(f"<p>before {text} after</p>") == name
    assert search.in_page(f"<p title='{text.replace(chr(39), '&#39;')}'>x</p>") == name
    assert search.in_page("<p>before after</p>") is None


def test_decimal_group_of_a_digest_is_no_place() -> None:
    search = LeftOver((), set(), lambda _: True, (473_977_000, 85_456_000))
    groups = ["b90614d4", "1a3301a1", "b949935c", "77547e1f", "52ec8c77", "3c18f63c", "82353210"]

    def shown(each: list[str]) -> str:
        return " ".join(f"<span>{group}</span>" for group in each)

    assert search.in_page(f"<p>digest</p>{shown([*groups, '00ff00ff'])}<p>more</p>") is None
    for places in (["82353210"], ["473977000", "85456000"], groups):
        assert search.in_page(f"<p>at</p>{shown(places)}<p>more</p>") in places


def test_word_of_every_page_may_be_a_name(completed: Path, tmp_path: Path) -> None:
    genesis, *rest = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "log.jsonl").write_bytes(b"".join(signed([edit(genesis, mission="timeline"), *rest])))
    found = report_of(tmp_path, "names")
    assert found.redaction is not None
    assert found.redaction.left(page(found.report)) is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [(None, ()), ("names", ("names",)), ("names,position", ("position", "names")), ("position, names", REDACTABLE)],
)
def test_what_is_named(text: str | None, expected: tuple[str, ...]) -> None:
    assert redaction_of(text) == expected


@given(st.text(max_size=20).filter(lambda text: not {each.strip() for each in text.split(",")} <= set(REDACTABLE)))
def test_anything_else_is_refused(text: str) -> None:
    found = redaction_of(text)
    assert isinstance(found, Refusal)
    assert (found.slug, found.code) == ("usage", ExitCode.USAGE)


def test_every_text_of_the_report_is_changed(completed: Path) -> None:
    found = texts(as_plain(report_of(completed, "names").report.without_log()))
    assert [text for text in found if "quad-07" in text] == []
