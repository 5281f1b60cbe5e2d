"""The content of a flight's report: six lines that answer a customer's questions, from the log alone."""

import json
import re
from base64 import b64encode
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference import bound_run
from reference.forgery import edit, signed
from rtshcua.app.flights.flight_reading import read_flight
from rtshcua.app.flights.flight_report import FlightReportRequest, LiveFlight, flight_report
from rtshcua.app.flights.watched import WatchedPage
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.app import main
from rtshcua.ground.flight.embedding import extract
from rtshcua.ground.flight.flight_content import FlightReport, as_plain
from rtshcua.ground.flight.flight_page import page
from rtshcua.mavlink import tlog
from virtual import case, run_folder
from virtual.flight_reports import MADE_US, PIN, report_of


def answers(report: FlightReport) -> list[str]:
    return [line.answer for line in report.summary]


def test_completed_flight_in_six_lines(completed: Path) -> None:
    report, code, _ = report_of(completed)
    asked, allowed, flew, ended, intact, unvouched = answers(report)
    assert "3 steps" in asked
    assert "takeoff(altitude = 15 m)" in asked
    assert "version" in allowed
    assert "3 of 3 steps completed" in flew
    assert ended.startswith("The mission was completed. It landed at ")
    assert intact.startswith("Yes: ")
    assert "witness" in unvouched
    assert (report.verdict, code) == ("verified", ExitCode.OK)
    assert report.steps_done == report.steps == 3
    assert report.highest is not None
    assert 14 * case.M < report.highest < 20 * case.M
    assert report.distance is not None
    assert 80 * case.M < report.distance < 120 * case.M  # 45 m there, and back


def test_flight_that_turned_home_says_why(turned: Path) -> None:
    report = report_of(turned).report
    ended = answers(report)[3]
    assert "Ended early" in ended
    assert "battery" in ended
    assert "Then flew, from " in ended
    assert "It landed at " in ended
    lanes = {each.lane for each in report.timeline}
    assert {"proposed", "compiled", "decided", "dispatched", "observed", "fallback"} <= lanes
    flown = [each for each in report.timeline if each.lane == "fallback" and each.until_us is not None]
    stopped = [each for each in report.timeline if each.lane == "dispatched"]
    assert stopped[-1].until_us is not None
    assert stopped[-1].until_us <= flown[0].t_us


def test_decision_on_the_fallback_tells_its_rule_and_what_it_read(turned: Path) -> None:
    report = report_of(turned).report
    rule = next(each for each in report.decisions if each.subject.startswith("target of the degrade rule"))
    assert (rule.outcome, rule.flies) == ("allow", "return_home()")
    assert rule.clause == "`degrade ()`"  # its text in this policy, which is made by hand
    assert rule.place
    (battery,) = (each for each in rule.reads if each.name == "battery")
    assert battery.value.endswith("%")
    assert battery.age_us is not None
    assert rule.would_pass == ()
    assert rule.chain
    flown = [each.told for each in report.timeline if each.lane == "fallback" and each.until_us is not None]
    assert "`return_home`" in flown[0]
    assert f"{rule.seq}: return_home" in page(report)


def test_events_and_decisions_are_those_of_the_log(completed: Path) -> None:
    report = report_of(completed).report
    lines = [json.loads(line) for line in (completed / "log.jsonl").read_bytes().splitlines()]
    decided = [each for each in lines if each["type"] == "decision"]
    assert [each.seq for each in report.decisions] == [each["seq"] for each in decided]
    assert [each.t_us for each in report.decisions] == [each["at_us"] - lines[0]["at_us"] for each in decided]
    assert [each.seq for each in report.records] == list(range(len(lines)))
    for view, record in zip(report.decisions, decided, strict=True):
        assert (view.outcome, view.reason) == (record["outcome"], record["reason"])
        ages = record["state"]["ages"]
        assert all(read.age_us is None or read.age_us in ages for read in view.reads)
        assert view.reads
    assert report.timeline == tuple(sorted(report.timeline, key=lambda each: each.t_us))


def test_lost_link_is_a_gap_to_the_end_and_its_decisions_have_no_place(completed: Path, tmp_path: Path) -> None:
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    begun_us = json.loads(lines[0])["utc_us"]
    entries = [(each.at_us, each.frame) for each in tlog.read((completed / "telemetry.tlog").read_bytes())]
    kept = [each for each in entries if each[0] < begun_us + 18 * case.S]
    run = run_folder.folder(tmp_path / "lost", (lines, kept, (completed / "mission.bundle").read_bytes()))
    report = report_of(run).report
    assert "no frame of the autopilot from 17.9 s to the end" in [each.told for each in report.gaps]
    placed = {each.where is not None for each in report.decisions if each.t_us < 18 * case.S}
    late = [each.where for each in report.decisions if each.t_us > 24 * case.S]
    assert (placed, late) == ({True}, [None] * len(late))
    assert late
    assert not any("to the end" in each.told for each in report_of(completed).report.gaps)


def test_repeated_decisions_are_one(completed: Path) -> None:
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    at = next(n for n, line in enumerate(lines) if b'"type":"decision"' in line)
    changed = edit(lines[at], outcome="defer", reason="approval/awaited", target_link=-1)
    run = completed.parent / "repeated"
    run.mkdir(exist_ok=True)
    (run / "log.jsonl").write_bytes(b"".join(signed([*lines[:at], changed, changed, changed, *lines[at:]])))
    report = report_of(run).report
    waited, allowed = report.decisions[:2]
    assert (waited.outcome, waited.repeats, waited.seq) == ("defer", 3, at)
    assert allowed.outcome == "allow"
    assert report.verdict == "failed"  # nobody decided that


def test_log_that_fails_has_a_page_that_says_so(completed: Path, tmp_path: Path) -> None:
    data = (completed / "log.jsonl").read_bytes()
    at = data.index(b'"admitted"')
    (tmp_path / "log.jsonl").write_bytes(data[:at] + b'"admitteD"' + data[at + 10 :])
    report, code, _ = report_of(tmp_path)
    assert report.verdict == "failed"
    assert answers(report)[4].startswith("No: record ")
    assert code == ExitCode.EVIDENCE
    assert 'class="said failed"' in page(report)


def test_log_without_end_is_incomplete(completed: Path, tmp_path: Path) -> None:
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "log.jsonl").write_bytes(b"".join(lines[:-3]))
    report, code, _ = report_of(tmp_path)
    assert (report.verdict, report.ending, code) == ("incomplete", "not closed", ExitCode.INCOMPLETE)
    assert report.track is None
    assert {"telemetry", "witnesses"} <= {each.what for each in report.gaps}


def cut_in_flight(run: Path, to: Path) -> None:
    """A copy of a run whose log was cut before the vehicle flew on to its highest place; the telemetry goes on."""
    lines = (run / "log.jsonl").read_bytes().splitlines(keepends=True)
    began = next(number for number, line in enumerate(lines) if b'"event":"dispatched"' in line)
    (to / "log.jsonl").write_bytes(b"".join(lines[: began + 3]))
    (to / "telemetry.tlog").write_bytes((run / "telemetry.tlog").read_bytes())


def test_telemetry_after_the_last_record_is_shown_and_not_counted(completed: Path, tmp_path: Path) -> None:
    whole = report_of(completed).report
    assert whole.track is not None
    assert whole.log_ends_us is None
    assert not [each for each in whole.gaps if "after the last record" in each.told]
    cut_in_flight(completed, tmp_path)
    report = report_of(tmp_path).report
    assert report.track is not None
    assert report.track.points[-1].t_us == whole.track.points[-1].t_us > report.lasted_us
    assert report.log_ends_us == report.lasted_us
    assert report.highest is not None
    assert whole.highest is not None
    assert report.highest < whole.highest
    assert report.distance is not None
    assert whole.distance is not None
    assert report.distance < whole.distance
    assert f"up to {round(report.highest / 100) / 10} m above home" in dict(report.summary)["What flew"]
    (told,) = [each.told for each in report.gaps if "after the last record" in each.told]
    found = re.search(r"it goes on for ([0-9.]+) s after the last record of the log: drawn dashed", told)
    assert found is not None
    ended_us = max(each.t_us for each in whole.track.points)
    assert abs(float(found[1]) * 1_000_000 - (ended_us - report.lasted_us)) < 1_500_000


def test_telemetry_that_begins_after_the_last_record_is_drawn_and_counts_nothing(
    completed: Path, tmp_path: Path
) -> None:
    cut_in_flight(completed, tmp_path)
    cut = report_of(tmp_path).report
    end_us = cut.begun_utc_us + cut.lasted_us
    heard = tlog.read((completed / "telemetry.tlog").read_bytes())
    later = [tlog.encode(each.at_us, each.frame) for each in heard if each.at_us > end_us]
    (tmp_path / "telemetry.tlog").write_bytes(b"".join(later))
    report = report_of(tmp_path).report
    assert (report.highest, report.distance) == (None, None)
    assert "later than the last record" in dict(report.summary)["What flew"]
    drawn = page(report)
    assert '"flown later"' in drawn
    assert '"flown"' not in drawn


def test_telemetry_after_the_last_record_is_drawn_apart(completed: Path, tmp_path: Path) -> None:
    cut_in_flight(completed, tmp_path)
    whole, cut = page(report_of(completed).report), page(report_of(tmp_path).report)
    for drawn in ('"flown later"', '"line later"', "swatch later"):
        assert (drawn in whole, drawn in cut) == (False, True)
    assert cut.count("swatch later") == 2, "keys of the map and of the heights"
    spans = [re.findall(r'data-span="[0-9.]+ [0-9.]+ -?[0-9]+ ([0-9]+)"', text) for text in (whole, cut)]
    assert all(abs(int(one) - int(other)) < 1_000 for one, other in zip(*spans, strict=True)), "the axis has all of it"


def test_growing_flight_is_drawn_beyond_its_last_record(completed: Path, tmp_path: Path) -> None:
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "log.jsonl").write_bytes(b"".join(lines[: len(lines) // 2]))
    (tmp_path / "telemetry.tlog").write_bytes((completed / "telemetry.tlog").read_bytes())
    live = LiveFlight(tmp_path / "log.jsonl", ())
    live.update()
    report = live.report(MADE_US)
    assert not isinstance(report, Refusal)
    assert report.track is not None
    assert report.track.points[-1].t_us > report.lasted_us
    assert not [each for each in report.gaps if "after the last record" in each.told]


@pytest.mark.parametrize("data", [b"", b'{"_prev":"', b"{}\n", b"\xff\xfe garbage\n"])
def test_log_without_a_first_record_is_refused(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "log.jsonl").write_bytes(data)
    found = flight_report(FlightReportRequest(tmp_path / "log.jsonl", PIN, (), MADE_US))
    assert isinstance(found, Refusal)


def test_log_whose_policy_reads_an_unknown_message_is_refused(completed: Path, tmp_path: Path) -> None:
    """Nobody has verified it when its telemetry is read."""
    policy = case.policy()
    source = replace(policy.signals[0].sources[0], message="NO_SUCH_MESSAGE")
    signals = (replace(policy.signals[0], sources=(source,)), *policy.signals[1:])
    bundle = case.seal(case.mission(case.short_steps()), replace(policy, signals=signals))
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    lines[0] = edit(lines[0], bundle=b64encode(bundle).decode())
    (tmp_path / "log.jsonl").write_bytes(b"".join(lines))
    (tmp_path / "telemetry.tlog").write_bytes((completed / "telemetry.tlog").read_bytes())
    found = read_flight(tmp_path / "log.jsonl")
    assert isinstance(found, Refusal)
    assert "NO_SUCH_MESSAGE" in found.text


def test_embedded_log_is_the_file(completed: Path) -> None:
    report = report_of(completed).report
    assert extract(report.log) == (completed / "log.jsonl").read_bytes()
    assert report.without_log().log == ""


def test_page_is_reproducible_and_its_content_is_json(completed: Path) -> None:
    report = report_of(completed).report
    assert page(report) == page(report_of(completed).report)
    plain = json.loads(json.dumps(as_plain(report)))
    assert plain["verdict"] == "verified"
    assert plain["decisions"][0]["reads"][0].keys() == {"name", "value", "age_us"}


def test_growing_log_is_told_as_far_as_it_goes(completed: Path, tmp_path: Path) -> None:
    data = (completed / "log.jsonl").read_bytes()
    lines = data.splitlines(keepends=True)
    log = tmp_path / "log.jsonl"
    log.write_bytes(lines[0][:100])
    live = LiveFlight(log, ())
    assert not live.update()
    assert isinstance(live.report(MADE_US), Refusal)
    log.write_bytes(b"".join(lines[:9]) + lines[9][:20])
    assert live.update()
    found = live.report(MADE_US)
    assert isinstance(found, FlightReport)
    assert (len(found.records), found.verdict, found.ending) == (9, "growing", "flying")
    assert not live.closed
    log.write_bytes(data)
    (tmp_path / "telemetry.tlog").write_bytes((completed / "telemetry.tlog").read_bytes())
    assert live.update()
    assert live.closed
    found = live.report(MADE_US)
    assert isinstance(found, FlightReport)
    whole = report_of(completed).report
    assert found.timeline == whole.timeline
    assert found.decisions == whole.decisions
    assert "Not verified yet" in found.verified
    assert found.verdict == "unverified"


def test_break_of_a_growing_log_is_told_until_it_is_mended(completed: Path, tmp_path: Path) -> None:
    lines = (completed / "log.jsonl").read_bytes().splitlines(keepends=True)
    log = tmp_path / "log.jsonl"
    log.write_bytes(b"".join(lines[:9]))
    live = LiveFlight(log, ())
    assert live.update()

    def breaks_off() -> bool:
        found = live.report(MADE_US)
        assert isinstance(found, FlightReport)
        return "breaks off" in found.summary[3].answer

    assert not breaks_off()
    for wrong, told in (([*lines[:9], b"no record\n"], True), (lines[:8], True), (lines[:10], False)):
        log.write_bytes(b"".join(wrong))
        assert live.update()
        assert not live.update()
        assert breaks_off() == told


def test_closed_log_that_nobody_verifies_does_not_fly(completed: Path) -> None:
    watched = WatchedPage(completed / "log.jsonl", None)
    text = watched.current()
    watched.update()
    assert watched.closed
    assert watched.verdict == "unverified"
    assert "Not verified" in text
    assert "Still flying" not in text
    assert "growing-note" not in text.partition("<script")[0]


def test_autopilots_log_that_is_bound_to_this_flight_is_told_and_no_other(tmp_path: Path) -> None:
    own, other = bound_run.run_folder(tmp_path / "own"), bound_run.run_folder(tmp_path / "other", other=True)
    for run in (own, other):
        assert main(bound_run.bind_words(run, bound_run.with_log(run))) == ExitCode.OK
    (told,) = report_of(own).report.bound
    assert told.what == "a PX4 log"
    assert "positions agree within 1 m and 100 ms" in told.agreement
    for document in (*own.glob("*.binding"), *other.glob("*.binding")):
        if document.parent == own:
            document.unlink()
        else:
            (own / document.name).write_bytes(document.read_bytes())
    report = report_of(own).report
    assert report.bound == ()
    assert any("bound to another log" in text for text in report.unproven)
