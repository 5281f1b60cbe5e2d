"""`show`, `why` and `verify-log` on a log with documents: the steps are those in force, and no signature is printed."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from reference.documents import approval, cancellation, hand, low, recall, replacement
from reference.flat_case import BATTERY, WIND, S
from reference.forgery import edit
from reference.world import APPROVAL_KEY, MISSION_KEY, ROOT_KEY, TICK, FakeVehicle, Run
from rtshcua.app.fly.narrator import NOTHING_FLIES, Teller
from rtshcua.app.fly.story import Summary
from rtshcua.app.telling.record_prose import Names, detail_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.image_records import ImageDetail, MissingDetail, encoded
from rtshcua.evidence.reading import read
from rtshcua.front.cli.app import main
from rtshcua.front.cli.render.live.lines import ending
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Interrupted, TakenOver
from rtshcua.wire.keys import SigningKey
from rtshcua.wire.request import STEP


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Approved, then replaced, then recalled on the way home."""
    run = Run(low()).until_flies("goto")
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    assert hand(run, replacement(run.loaded)) == "accepted"
    run.until_flies("return_home")
    assert hand(run, recall(run.loaded, now=run.clock.now())) == "accepted"
    run.until_over()
    for _ in range(S // TICK):
        run.clock.advance(TICK)
    close = run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)
    path = tmp_path / "log.jsonl"
    path.write_bytes(b"".join([*run.lines, close]))
    return path


def test_a_timeline_names_the_steps_that_are_in_force(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(log)]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "granted as supervisor, good until" in out
    assert f"key {APPROVAL_KEY.kid.hex()}" in out
    assert "calls home the mission" in out
    assert "steps, new from step 3" in out
    assert max(map(len, out.splitlines())) < 240
    assert "step 3 `return_home()`" in out, "the last step, which is the third one now"


def test_decision_is_explained_with_the_mission_in_force(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["why", str(log), "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["outcome"] == "allow"
    damaged = log.read_bytes().replace(b'"event":"replacement"', b'"event":"replacemant"')
    log.write_bytes(damaged)
    assert main(["why", str(log), "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["reason"] == "integrity/binding-mismatch"


def test_invalid_replacement_in_a_log_is_refused(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = log.read_bytes().splitlines(keepends=True)
    at = next(n for n, line in enumerate(lines) if b'"event":"replacement"' in line)
    for nonsense in ("", "!!", "aGVsbG8="):
        record = json.loads(lines[at]) | {"detail": nonsense}
        lines[at] = json.dumps(record, separators=(",", ":"), sort_keys=True).encode() + b"\n"
        log.write_bytes(b"".join(lines))
        assert main(["show", str(log)]) == ExitCode.OK
        assert main(["why", str(log)]) == ExitCode.INPUT
        assert "invalid replacement in the log" in capsys.readouterr().err


def test_audit_lists_signed_documents(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify-log", str(log), "--root", ROOT_KEY.public.hex(), "--json", "--audit"]) == ExitCode.OK
    proven = {claim["slug"]: claim["text"] for claim in json.loads(capsys.readouterr().out)["proven"]}
    assert proven["documents"].startswith("1 approval by ada, 1 recall by ada, 1 replacement, ")


def test_the_person_who_signed_is_named_from_the_trust_root(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A key id is not readable, so the person's name is taken from the root in the log."""
    assert main(["show", str(log)]) == ExitCode.OK
    told = [line for line in capsys.readouterr().out.splitlines() if f"by ada, key {APPROVAL_KEY.kid.hex()}" in line]
    assert [line.split("·")[1].split()[0] for line in told] == ["approval", "recall"]
    records = [json.loads(line) for line in log.read_bytes().splitlines()]
    approved = next(each["seq"] for each in records if each.get("event") == "approval")
    assert main(["verify-log", str(log), "--root", ROOT_KEY.public.hex(), "--explain", str(approved)]) == ExitCode.OK
    assert "by ada, key" in " ".join(capsys.readouterr().out.split())


def test_a_trust_root_that_makes_no_sense_names_nobody(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, *rest = log.read_bytes().splitlines(keepends=True)
    for root in ("", "!!", "aGVsbG8="):
        log.write_bytes(edit(first, root=root) + b"".join(rest))
        assert main(["show", str(log)]) == ExitCode.OK
        out = capsys.readouterr().out
        assert f"by key {APPROVAL_KEY.kid.hex()}" in out
        assert "ada" not in out


def test_why_begins_with_the_cause_of_the_end(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The cause is the recall, not an admitted step."""
    assert main(["why", str(log)]) == ExitCode.OK
    out = capsys.readouterr().out
    assert out.startswith("Cause of the early end\n")
    assert "recall" in out.splitlines()[1]
    assert main(["why", str(log), "--json"]) == ExitCode.OK
    said = json.loads(capsys.readouterr().out)
    assert said["outcome"] == "allow"
    assert "recall" in said["cause"]["what"]
    assert main(["why", str(log), "--record", str(said["record"]), "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["cause"] is None, "that record was asked for"


@pytest.mark.parametrize(
    ("make", "key", "words"),
    [
        (approval, APPROVAL_KEY, "granted as supervisor, good until"),
        (lambda of: approval(of, granted=0), APPROVAL_KEY, "refused as supervisor"),
        (recall, APPROVAL_KEY, "calls home the mission"),
        (replacement, MISSION_KEY, "new from step 3"),
        (cancellation, MISSION_KEY, "cancels the mission"),
    ],
)
def test_document_is_shown_with_its_destination(
    make: Callable[[Loaded], bytes], key: SigningKey, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "x.document"
    path.write_bytes(make(low()))
    assert main(["show", str(path)]) == ExitCode.OK
    out = " ".join(capsys.readouterr().out.split())
    assert words in out
    assert f"key {key.kid.hex()}" in out
    assert main(["show", str(path), "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["key"] == key.kid.hex()
    assert main(["run", str(path), "--runs", str(tmp_path / "runs")]) == ExitCode.INPUT
    assert "hand" in capsys.readouterr().err


def test_the_summary_counts_every_decision_as_the_log_does() -> None:
    run = Run(low()).until_flies("goto")
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    run.tick(Interrupted(run.clock.now().monotonic_us))
    run.until_over()
    teller = Teller(run.loaded.bundle.policy, run.loaded.bundle.mission, 0, detail_of=detail_of)
    counts = dict.fromkeys(teller.outcomes, 0)
    for line in run.lines:
        what, record = teller.tell(line), json.loads(line)
        if record["type"] == "decision":
            counts[record["outcome"]] += 1
        if record.get("event") == "approval":
            assert what is not None
            assert what.detail.startswith("granted as supervisor")
    assert teller.outcomes == counts
    assert counts["allow"] > 2, "both steps, and the links of what flew then"


def test_fallback_without_a_landing_is_in_both_summaries(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = Run(low()).until_flies("goto")
    assert hand(run, recall(run.loaded, now=run.clock.now())) == "accepted"
    run.until_flies("return_home")
    run.tick(TakenOver(run.clock.now().monotonic_us, "POSCTL"))
    run.until_over()
    teller = Teller(run.loaded.bundle.policy, run.loaded.bundle.mission, 0, detail_of=detail_of)
    for line in run.lines:
        teller.tell(line)
    (what,) = teller.unconfirmed
    assert what.startswith(("contingency: ", "fallback: "))
    summary = SUMMARY | {"unconfirmed": (what,)}
    (said,) = [line for line in ending(Summary(**summary)) if "unseen" in line]
    assert said == f"  unseen   {what}: sent but not confirmed: no landing was observed"
    path = tmp_path / "log.jsonl"
    path.write_bytes(b"".join([*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)]))
    words = ["verify-log", "--root", ROOT_KEY.public.hex(), str(path)]
    assert main([*words, "--audit"]) == ExitCode.OK
    out = " ".join(capsys.readouterr().out.split())
    (number,) = [record["seq"] for record in run.records if record.get("event") == "released"]
    assert f"that the fallback that ended at record {number} brought the vehicle down: sent but not" in out
    assert main(words) == ExitCode.OK
    assert "not confirmed" not in capsys.readouterr().out, "without an audit no record is read"


def test_summary_compares_battery_with_its_declaration() -> None:
    told = "6.3 % a minute declared, 17.6 % measured", "100.0 % a km declared, 100.0 % measured"
    lines = list(ending(Summary(**SUMMARY | {"battery": told})))
    assert [line for line in lines if "measured" in line] == [f"  battery  {each}" for each in told]
    assert not any("battery" in line for line in ending(Summary(**SUMMARY)))


SUMMARY: dict[str, Any] = {
    **dict.fromkeys(("mission", "policy", "vehicle", "flavour", "mode", "ending", "folder", "log", "next"), ""),
    **dict.fromkeys(("exit_code", "steps", "steps_done", "flight_us", "records"), 0),
    "outcomes": {},
    "whole": True,
}


@pytest.fixture
def broken_off(tmp_path: Path) -> Path:
    """Approved in the air, then stopped by Ctrl-C: the contingency brings it down."""
    run = Run(low()).until_flies("goto")
    assert hand(run, approval(run.loaded, now=run.clock.now())) == "accepted"
    run.until_flies("inspect_area")
    run.tick(Interrupted(run.clock.now().monotonic_us))
    run.until_over()
    path = tmp_path / "log.jsonl"
    path.write_bytes(b"".join([*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None)]))
    return path


def test_why_shows_end_and_approvals_of_a_flight(broken_off: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["why", str(broken_off)]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "granted as supervisor by ada, 2" in out, "in the step that asks for it, with the time"
    assert "Approvals and refusals of this step" in out
    assert "End of the flight" in out
    assert "· interrupted" in out
    assert "interrupted" in out.splitlines()[-1]


def test_why_explains_every_record(broken_off: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kinds: dict[int, int] = {}
    for line in broken_off.read_bytes().splitlines():
        record = json.loads(line)
        if record["type"] == "genesis":
            continue
        assert main(["why", str(broken_off), "--record", str(record["seq"]), "--json"]) == ExitCode.OK
        shown = json.loads(capsys.readouterr().out)
        assert shown["record"] == record["seq"]
        if record["type"] == "decision":
            kinds[record["kind"]] = record["seq"]
            assert shown["outcome"] == record["outcome"]
            if record["kind"] != STEP:
                assert shown["admissible"] is (record["outcome"] == "allow")
                assert set(shown["state"]) == {signal.name for signal in low().bundle.policy.signals}
        elif record["type"] == "effect":
            assert shown["event"] == record["event"]
    assert set(kinds) > {STEP}
    link = next(seq for kind, seq in kinds.items() if kind != STEP)
    assert main(["why", str(broken_off), "--record", str(link)]) == ExitCode.OK
    out = capsys.readouterr().out
    assert "The state, as recorded" in out
    assert "The chain, in order" in out


def test_a_step_refused_on_the_ground_flies_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vehicle = FakeVehicle()
    vehicle.values[BATTERY] = 2_000
    run = Run(vehicle=vehicle).until_over()
    assert run.flown == []
    teller = Teller(run.loaded.bundle.policy, run.loaded.bundle.mission, 0, detail_of=detail_of)
    told = [what for what in map(teller.tell, run.lines) if what is not None and what.outcome == "fallback"]
    assert told
    assert all(what.target in ("", NOTHING_FLIES) for what in told)
    path = tmp_path / "log.jsonl"
    path.write_bytes(b"".join(run.lines))
    assert main(["why", str(path)]) == ExitCode.OK
    assert "flies         nothing: the vehicle was on the ground" in capsys.readouterr().out


def test_numbers_in_a_log_are_labelled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vehicle = FakeVehicle()
    vehicle.values[WIND] = None
    run = Run(vehicle=vehicle)
    for _ in range(40):
        run.tick()
    run.tick(Interrupted(run.clock.now().monotonic_us))
    run.until_over()
    (count,) = [str(record["detail"]) for record in run.records if record.get("event") == "repeated"]
    path = tmp_path / "log.jsonl"
    path.write_bytes(b"".join(run.lines))
    assert main(["show", str(path)]) == ExitCode.OK
    assert f"the same decision {count} more times" in capsys.readouterr().out
    assert main(["why", str(path)]) == ExitCode.OK
    assert " us " not in capsys.readouterr().out


def test_the_target_of_a_degrade_rule_is_named_as_such() -> None:
    run = Run(low()).until_flies("goto")
    run.vehicle.values[BATTERY] = 2_400
    run.until_over()
    names = Names(None)
    told = [names.tell(record) for record in map(read, run.lines) if not isinstance(record, Flaw)]
    assert any("target of the degrade rule, at step 2" in line for line in told)


def test_decision_record_names_the_approver(broken_off: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records = [json.loads(line) for line in broken_off.read_bytes().splitlines()]
    decided = next(each["seq"] for each in records if each["type"] == "decision" and each["context"]["approvals"])
    main(["verify-log", str(broken_off), "--root", ROOT_KEY.public.hex(), "--explain", str(decided)])
    assert "granted by ada" in " ".join(capsys.readouterr().out.split())


def test_times_in_a_log_are_read_in_units_that_people_use() -> None:
    assert detail_of("stalled", "22223836 us") == "22.223836 s"
    assert detail_of("clock", "kernel: UTC is true to 100000 us") == "kernel: UTC is true to 100 ms"
    assert detail_of("clock-stepped", "+1500000 us") == "+1.5 s"


def test_images_are_told_in_words() -> None:
    fields = dict[str, Any](
        above_home_mm=20_040, above_sea_mm=508_000, asked=2, attitude="camera", camera=100, file="", horizontal_mm=None,
        index=7, latitude=473_977_400, longitude=85_455_900, pitch_cd=None, result=1, roll_cd=None, series=0, unit=0,
        utc_us=None, vertical_mm=None, yaw_cd=None,
    )  # fmt: skip
    place = "47.3977400, 8.5455900"
    told = detail_of("image", encoded(ImageDetail(**fields)))
    assert told == f"camera 100 took image 7 at {place}, 20.0 m above home (requested 2 times)"
    unknown = {**fields, "latitude": None, "longitude": None, "above_home_mm": None, "asked": 0}
    assert detail_of("image", encoded(ImageDetail(**unknown))) == "camera 100 took image 7"
    failed = {**fields, "index": None, "result": 0}
    assert detail_of("image", encoded(ImageDetail(**failed))) == "camera 100 reports a picture that failed"
    gaps = MissingDetail(100, 1, 0, 9, ((2, 2), (5, 7)), 4, 0, 6)
    assert detail_of("images-missing", encoded(gaps)) == (
        "6 images of camera 100, 4 missing: 2, 5 to 7; 1 picture failed"
    )
    assert detail_of("image", "nonsense") == detail_of("images-missing", "{}") == "no record of an image"
    assert detail_of("noted", "22223836 us") == "22223836 us", "what others wrote is left as it is"
