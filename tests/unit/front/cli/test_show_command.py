"""`rtshcua show`: the contents of a file, for a person and for a program."""

import json
import time
from base64 import b64encode
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference.attested_flight import attested
from reference.forgery import edit, flight, other_flight, read
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.writing import write_new
from rtshcua.app.telling import prose
from rtshcua.app.telling.record_prose import detail_of
from rtshcua.app.wording import shorten, utc
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.front.cli.render.showing.policy import show_policy
from rtshcua.model.flat.contract import CHOICE, MotionKind, Parameter
from rtshcua.model.flat.mission import OnInadmissible, Plan
from rtshcua.model.flat.policy import LeftOut, Monitor, MonitorKind, Policy
from rtshcua.model.flat.zone import CIRCLE, Zone
from rtshcua.wire import key_file
from rtshcua.wire.bundle import envelopes
from rtshcua.wire.keys import Duty
from virtual import case


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    path = tmp_path / "x.bundle"
    path.write_bytes(case.seal(case.mission()))
    return path


def shown(path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    assert app.main(["show", str(path)]) == ExitCode.OK
    return capsys.readouterr().out


def test_a_bundle(bundle: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    out = shown(bundle, capsys)
    policy, mission = case.policy(), case.mission()
    for rule in policy.rules:
        assert rule.text in out
    for zone in policy.zones:
        assert zone.name in out
    for signal in policy.signals:
        assert signal.name in out
    for phase in mission.phases:
        assert f"Phase {phase}" in out
    for contract in policy.contracts:
        for clause in (*contract.require, *contract.assume, *contract.maintain):
            assert clause.text in out
    assert case.KEYS[Duty.POLICY].kid.hex() in out
    assert case.KEYS[Duty.MISSION].kid.hex() in out
    assert "holds no keys" in " ".join(out.split())  # a long path wraps the line
    assert "inspect_area(area = bridge_a, altitude = 20 m, pattern = grid, speed = 4 m/s)" in out
    monkeypatch.delenv("COLUMNS")
    lines = shown(bundle, capsys).splitlines()
    assert max(len(line) for line in lines if not line.strip().startswith("`/")) <= 80  # a path is never broken


def test_every_field_of_a_contract_is_visible_where_nobody_wrote_it(
    bundle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = shown(bundle, capsys)
    hover = out[out.index("  hover(") :]
    for line in (
        "motion     hold",
        "class      tactical",
        "deadline   2 s after release",
        "valid      for 30 min after issue, in any phase",
        "lasts      at most 5 min",
        "grace      500 ms: how long a signal may be unknown while the step runs",
        "assume     nothing",
        "maintain   nothing",
        "energy     at most 1 %",
        "record     decision",
    ):
        assert line in hover


def test_a_bundle_that_the_key_store_trusts(bundle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = KeyStore(data_folder())
    store.folder.mkdir(parents=True)
    store.root_path.write_bytes(case.root(issued_at_us=time.time_ns() // 1000)[1])
    assert "verified under the development root of your key store" in shown(bundle, capsys)


def test_a_step_that_is_held_to_more(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, *others = case.short_steps()
    tight = replace(first, contract=replace(first.contract, deadline_us=1_000_000), on_inadmissible=OnInadmissible.SKIP)
    (tmp_path / "x").write_bytes(case.seal(case.mission((tight, *others))))
    out = shown(tmp_path / "x", capsys)
    assert "contract   tighter than the skill's in:" in out
    assert "deadline   1 s after release" in out
    assert "otherwise  skip" in out


def test_a_bundle_as_json(bundle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.main(["show", str(bundle), "--json"]) == ExitCode.OK
    whole = json.loads(capsys.readouterr().out)
    assert whole["kind"] == "bundle"
    assert whole["trusted"] is False
    assert whole["mission"]["invocations"][0]["contract"]["deadline_us"] == 2_000_000
    assert whole["policy"]["vehicle"]["identity"] == "quad-07"
    assert len(whole["mission"]["invocations"][0]["binding"]) == 64


def test_a_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "log.jsonl").write_bytes(b"".join(other_flight()))
    out = shown(tmp_path, capsys)
    assert "not verified" in out
    assert "allow     step 1 `takeoff(" in out, "what is bound, whatever the text says"
    assert "· violated" in out
    assert f"closed after {len(other_flight()) - 1} records: aborted" in out
    assert sum("  · dispatched" in line for line in out.splitlines()) == 3
    assert "s after the mission was issued" in out


def test_a_log_as_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "x").write_bytes(b"".join(flight()))
    assert app.main(["show", str(tmp_path / "x"), "--json"]) == ExitCode.OK
    whole = json.loads(capsys.readouterr().out)
    assert (whole["kind"], whole["verified"], whole["stopped"]) == ("log", False, None)
    assert [record["seq"] for record in whole["records"]] == list(range(len(flight())))
    assert "bundle" not in whole["records"][0]


def test_damaged_log_is_shown_up_to_the_damage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = list(flight())
    lines[0] = edit(lines[0], bundle=b64encode(b"no bundle").decode(), before="ab" * 32)
    at = 1 + next(number for number, line in enumerate(lines) if b'"type":"decision"' in line)
    lines[at] = lines[at].replace(b'"seq"', b'"\\u0073eq"')
    (tmp_path / "x").write_bytes(b"".join(lines))
    out = shown(tmp_path / "x", capsys)
    assert "allow     step 1: admitted" in out
    assert "follows" in out
    assert "The rest is not shown" in out
    assert f"line {at + 1} is not a record" in out


@pytest.mark.parametrize("link", [-2, 0, 99])
@pytest.mark.parametrize("kind", [0, 1, 2, 3])
def test_log_may_name_items_missing_in_its_bundle(
    kind: int, link: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = [flight()[0], *(edit(line, kind=kind, step=99, link=link) for line in flight()[2:4])]
    (tmp_path / "x").write_bytes(b"".join(lines))
    shown(tmp_path / "x", capsys)


def test_a_root_and_a_key(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    app.main(["keys", "init"])
    capsys.readouterr()
    store = KeyStore(data_folder())
    root = shown(store.root_path, capsys)
    for duty in set(Duty) - {Duty.MISSION, Duty.APPROVAL}:
        assert store.signing_key(duty).kid.hex() in root
    for source in ("agent", "operator"):
        assert store.signing_key(Duty.MISSION, whose=source).kid.hex() in root
        assert f"role operator through {source}, under any policy, on any vehicle" in root
    assert "expired" not in root
    (tmp_path / "old").write_bytes(case.root()[1])
    assert "(expired)" in shown(tmp_path / "old", capsys)
    key = shown(store.key_path(Duty.LOG), capsys)
    assert "Signing key of duty log" in key
    assert store.signing_key(Duty.LOG).public.hex() in key
    assert store.signing_key(Duty.LOG).private.private_bytes_raw().hex() not in key


def test_an_encrypted_key(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(key_file, "COST", key_file.COSTS[0])
    write_new(tmp_path / "passphrase", b"correct horse battery", mode=0o600)
    app.main(["keys", "init", "--encrypted", "--policy", "field", "--passphrase-file", str(tmp_path / "passphrase")])
    capsys.readouterr()
    assert "Signing key of duty log, encrypted" in shown(KeyStore(data_folder()).key_path(Duty.LOG), capsys)


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", ExitCode.INPUT),
        (b"mission short {}", ExitCode.INPUT),
        (b"\x00" * 5000, ExitCode.INPUT),
        (b"\xd2", ExitCode.INPUT),
        (b"duty: log\nnonsense", ExitCode.INPUT),
        (b"duty: cook\n", ExitCode.INPUT),
        (b"duty: \xff\n", ExitCode.INPUT),
        (b"\x83nrtshcua/bundle\x01\x80", ExitCode.INPUT),
        (b"\x83nrtshcua/bundle\x02\x80", ExitCode.UNTRUSTED),
    ],
)
def test_unsupported_files_are_refused(
    data: bytes, code: ExitCode, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "x").write_bytes(data)
    assert app.main(["show", str(tmp_path / "x")]) == code
    err = capsys.readouterr().err
    assert err.startswith("error[")
    assert "internal fault" not in err


@pytest.mark.parametrize(("number", "said"), [(0, "evidence land: "), (1, "evidence refuse: "), (7, "evidence: 7?")])
def test_unlogged_actions_are_shown(number: int, said: str) -> None:
    page = TextPage()
    show_policy(page, replace(case.policy(), without_evidence=number))
    assert any(row.split()[:1] == ["without"] and said in row for row in str(page).splitlines())


@pytest.mark.parametrize(
    ("silence_us", "then", "said"),
    [
        (30_000_000, 1, "link for 30 s contingency: "),
        (90_000_000, 0, "link for 90 s continue: "),
        (1, 7, "link for 1 us 7?"),
    ],
)
def test_flight_after_a_silence_is_shown(silence_us: int, then: int, said: str) -> None:
    page = TextPage()
    show_policy(page, replace(case.policy(), silence_us=silence_us, after_silence=then))
    assert any(row.split()[:1] == ["without"] and said in row for row in str(page).splitlines())


def test_the_sensors_that_a_vehicle_lacks_and_the_clauses_left_out() -> None:
    policy = case.policy()
    vehicle = replace(policy.vehicle, without=("rain", "snow"))
    clause = LeftOut(0, "assume", "rain < 3 m/s", 0, 0, 1)
    page = TextPage()
    show_policy(page, replace(policy, vehicle=vehicle, left_out=(clause,)))
    rows = [" ".join(row.split()) for row in str(page).splitlines()]
    assert "without rain, snow: not fitted; what reads it `where fitted` is left out" in rows
    assert rows.count("left out assume rain < 3 m/s: the vehicle is without a sensor for it") == 1
    assert not any(row.startswith("left out") for row in _shown(policy))


def _shown(policy: Policy) -> list[str]:
    page = TextPage()
    show_policy(page, policy)
    return [row.strip() for row in str(page).splitlines()]


def test_the_local_time_and_by_which_data() -> None:
    policy = case.policy()
    assert any(row.split() == ["local", "time", "UTC", "+2", "h"] for row in _shown(policy))
    zoned = replace(policy.vehicle, time_zone="Asia/Kolkata", time_zone_data="2026f", utc_offset_us=0)
    (row,) = [row for row in _shown(replace(policy, vehicle=zoned)) if row.startswith("local time")]
    assert row.endswith("Asia/Kolkata, by the time-zone data 2026f")


def test_a_bundle_that_makes_no_sense(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    policy = case.policy()
    broken = replace(policy, contingency=tuple(replace(link, skill=99) for link in policy.contingency))
    (tmp_path / "x").write_bytes(case.seal(case.mission(), broken))
    assert app.main(["show", str(tmp_path / "x")]) == ExitCode.INPUT
    assert "is inconsistent" in capsys.readouterr().err


def test_envelopes_of_other_kinds_are_not_shown_as_roots(bundle: Path, tmp_path: Path) -> None:
    (tmp_path / "policy").write_bytes(envelopes(bundle.read_bytes())[0])
    assert app.main(["show", str(tmp_path / "policy")]) == ExitCode.INPUT


def test_out_of_range_values_are_described() -> None:
    choice = Parameter("pattern", CHOICE, "", 0, 0, 1, ("grid", "orbit"))
    assert prose.arguments(case.policy(), (choice,), (7,)) == "pattern = 7, out of range"


@pytest.mark.parametrize(
    ("kind", "window_us", "text"),
    [
        (MonitorKind.FOR_LAST, 3_000_000, "`battery < 25 %` for the last 3 s"),
        (MonitorKind.WITHIN_LAST, 600_000_000, "`battery < 25 %` within the last 10 min"),
        (MonitorKind.RISING, 0, "rising `battery < 25 %`"),
        (MonitorKind.FALLING, 0, "falling `battery < 25 %`"),
    ],
)
def test_a_temporal_monitor(kind: int, window_us: int, text: str) -> None:
    page = TextPage(bold=False)
    show_policy(page, replace(flat.POLICY, monitors=(Monitor(kind, window_us, flat.LOW_BATTERY),)))
    assert text in str(page)
    bare = TextPage(bold=False)
    show_policy(bare, flat.POLICY)
    assert "Temporal monitors" not in str(bare)


def test_words_of_places_and_zones() -> None:
    assert prose.geographic(-473_977_400, 5) == "47.39774 S, 0.0000005 E"
    levelled = Plan(MotionKind.COVER, (0, 0, 9_000, 0), 20_000, 0, (12_000, 20_000), (0, 9_000))
    assert prose.plan(case.policy(), levelled).endswith(
        "at 2 heights from 12 m to 20 m above home, facing inward, at the vehicle's own speed"
    )
    assert prose.geographic(0, -1_800_000_000) == "0.0 N, 180.0 W"
    round_zone = Zone("z", CIRCLE, 0, 60_000, (0, 0, 80_000**2))
    assert prose.zone(case.policy(), round_zone).startswith("circle of 80 m around ")
    assert prose.zone(case.policy(), round_zone).endswith("; floor 0 m, ceiling 60 m above home")


def test_pages_wrap_beneath_themselves() -> None:
    page = TextPage(bold=True)
    page.head("title")
    page.rows("name", ["word " * 40, "second"])
    page.rows("nothing", [])
    lines = str(page).splitlines()
    assert lines[0] == "\033[1mtitle\033[0m"
    assert lines[1].startswith("  name")
    assert all(line.startswith(" " * 16) for line in lines[2:])


def test_text_from_elsewhere() -> None:
    assert visible("a\tb\x00é°") == "a<U+0009>b<U+0000>é°"
    assert shorten("abcdef", 4) == "abc…"
    assert shorten("abcd", 4) == "abcd"
    assert utc(0) == "1970-01-01 00:00:00Z"
    assert utc(-1) == "-1 us"
    assert utc(1 << 60) == f"{1 << 60} us"


def test_boundary_statement_is_summarised() -> None:
    said = [detail_of("boundary", read(line)["detail"]) for line in attested() if read(line).get("event") == "boundary"]
    assert said[0] == "session 1 has 1 entry and 0 frames of commands"
    assert said[-1].startswith("session 1 has 11 entries and ")
    assert said[-1].endswith(" frames of commands, and it ends there")
    assert detail_of("boundary", "nonsense") == "no statement"
