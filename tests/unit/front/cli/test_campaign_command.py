"""`rtshcua campaign`: options, resumption, stored files and exit codes."""

import json
import signal
from collections.abc import Callable
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from rtshcua import library
from rtshcua.app.testing import flying
from rtshcua.campaign.rounds import CampaignFlight, CampaignResult, FlownMission, JudgeFinding
from rtshcua.campaign.scenario_trials import ScenarioTrial, Try
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.ground.testing.reporting import FlightFailure, FlightResult
from rtshcua.model.faults import GpsLoss
from virtual import case

S = 1_000_000
SHORT = str(library.root() / "missions" / "short.rts")
#: a day on which the shipped mission may fly
AT = ("--at", "2026-06-01T08:00:00Z")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def flies(
    monkeypatch: pytest.MonkeyPatch,
) -> Callable[[Callable[[FlownMission, CampaignFlight], CampaignResult]], None]:
    """A function that replaces how flights are flown."""

    def put(fly: Callable[[FlownMission, CampaignFlight], CampaignResult]) -> None:
        monkeypatch.setattr(FlownMission, "fly", fly)

    return put


def told(flight: CampaignFlight, *failures: JudgeFinding) -> CampaignResult:
    scenario = flight.scenario
    texts = tuple(each.text for each in scenario.incidents)
    return CampaignResult(
        flight.number, scenario.flavours[0], scenario.first_seed, texts, flight.tries, "completed", failures, (),
        {"fence_mm": 20_000 + flight.number}, (("airborne", 5 * S), ("down", 50 * S)), 60 * S, "00", S,
    )  # fmt: skip


def good(_: FlownMission, flight: CampaignFlight) -> CampaignResult:
    return told(flight)


def without_gps(_: FlownMission, flight: CampaignFlight) -> CampaignResult:
    """Fails whenever the fix is lost."""
    lost = any(isinstance(each.fault, GpsLoss) for each in flight.scenario.incidents)
    return told(flight, JudgeFinding("collision", "flew into a <pillar>", 7 * S)) if lost else told(flight)


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    code = app.main(["campaign", SHORT, *AT, "-j", "1", *words])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.slow
def test_flights_that_are_flown_and_judged(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A few real flights, from the source to the report."""
    code, out, err = run(capsys, "--flights", "2", "--json", "--fault", "link-silence", "--fault", "wind", "-o", "made")
    assert (code, err) == (ExitCode.OK, "")
    found = json.loads(out)["campaign"]
    assert (found["mission"], found["flights"], found["failed"], found["campaign"]) == ("short", 2, 0, 1)
    assert set(found["kinds"]) == set(found["near"]) <= {"link-silence", "wind"}, "as sources and `--fault` call them"
    titles = {each["name"]: each["title"] for each in found["margins"]}
    assert titles["fence_mm"] == "least distance to the airspace's edge, inside"
    text = unescape(Path("made/report.html").read_text())
    assert titles["fence_mm"] in text
    for internal in ("fence_mm", "ended_us", "LinkSilence", "WindStep"):
        assert internal not in text
    assert sum(sum(counts.values()) for counts in found["endings"].values()) == 2
    lines = [json.loads(line) for line in Path("made/results.jsonl").read_text().splitlines()]
    assert all(line["flown_us"] > S and len(line["log"]) == 64 for line in lines)
    again = [fly_one_again(lines[0])]
    assert [each.log for each in again] == [lines[0]["log"]]


def fly_one_again(line: dict[str, Any]) -> CampaignResult:
    """Fly flight 0 again, in this process, from the contents of the folder only."""
    from rtshcua.app.campaigns import _kinds, _space
    from rtshcua.app.programs import compile_sources
    from rtshcua.campaign.drawing import FLAVOURS
    from rtshcua.campaign.rounds import CampaignOrder, drawn

    begun = json.loads(Path("made/campaign.json").read_text())
    compiled, _ = compile_sources([Path(SHORT)], mission=None, issued_at_us=begun["issued_at_us"])
    assert compiled.policy is not None
    assert compiled.mission is not None
    field = FlownMission.of(compiled.policy, compiled.mission, begun["issued_at_us"])
    kinds = _kinds(["link-silence", "wind"])
    assert isinstance(kinds, frozenset)
    space = _space(field, compiled.policy, compiled.mission, FLAVOURS, kinds, False)
    assert not hasattr(space, "slug")
    made = drawn(CampaignOrder(begun["seed"], 2, space), line["number"], {})
    return field.fly(CampaignFlight(line["number"], made.scenario, made.tries))


def test_interrupted_campaign_resumes(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    seen: list[int] = []

    def interrupted(field: FlownMission, flight: CampaignFlight) -> CampaignResult:
        seen.append(flight.number)
        if len(seen) == 12:  # the present flight is completed
            signal.raise_signal(signal.SIGTERM)
        return good(field, flight)

    flies(interrupted)
    code, _, err = run(capsys, "--flights", "30")
    assert code == ExitCode.INTERRUPTED
    folder = Path("runs/campaign-short-1")
    assert f"interrupted; 10 of 30 flights are kept in `{folder}`" in err  # two calm ones were flown before
    assert json.loads((folder / "report.json").read_text())["flights"] == 10
    flies(good)
    assert run(capsys, "--flights", "30")[0] == ExitCode.OK
    assert json.loads((folder / "report.json").read_text())["flights"] == 30
    assert len((folder / "results.jsonl").read_text().splitlines()) == 30


def test_interrupted_shrinking_resumes(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    seen: list[int] = []

    def interrupted(field: FlownMission, flight: CampaignFlight) -> CampaignResult:
        seen.append(flight.number)
        if len(seen) == 122:  # the calm ones, those that are drawn, and then candidates
            signal.raise_signal(signal.SIGINT)
        return without_gps(field, flight)

    flies(interrupted)
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        code, out, _ = run(capsys, "--flights", "119", "--json")
    finally:
        signal.signal(signal.SIGINT, before)
    error = json.loads(out)
    assert (code, error["error"]["slug"]) == (ExitCode.INTERRUPTED, "interrupted")
    report = json.loads(Path("runs/campaign-short-1/report.json").read_text())
    assert report["flights"] == 119
    assert not list(Path("runs/campaign-short-1").glob("failures/*.rts"))
    flies(without_gps)
    assert run(capsys, "--flights", "119")[0] == ExitCode.TESTS
    assert Path("runs/campaign-short-1/failures/collision.rts").exists()


def test_failure_is_shrunk_to_a_scenario_and_exits_with_13(
    here: Path,
    capsys: pytest.CaptureFixture[str],
    flies: Callable[[Any], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flies(without_gps)
    code, out, _ = run(capsys, "--flights", "120")
    assert code == ExitCode.TESTS
    assert "failed   collision: " in out
    text = Path("runs/campaign-short-1/failures/collision.rts").read_text()
    assert text.startswith("// collision: flew into a <pillar>\n// Flight ")
    assert 'import "lib:missions/short.rts"' in text
    incidents = [line for line in text.splitlines() if line.startswith(("  at ", "  after "))]
    assert len(incidents) == 1
    assert "gps_loss(" in incidents[0]
    page = Path("runs/campaign-short-1/report.html").read_text()
    assert "flew into a &lt;pillar&gt;" in page
    assert "<pillar>" not in page
    monkeypatch.setattr(flying.ScenarioTrial, "fly", _failing)
    assert app.main(["test", "runs/campaign-short-1/failures"]) == ExitCode.TESTS
    assert "collision" in capsys.readouterr().err


def _failing(_: ScenarioTrial, flight: Try) -> FlightResult:
    """Check that a stored failure is the flight that failed."""
    assert [type(each.fault) for each in flight.scenario.incidents] == [GpsLoss]
    assert flight.scenario.start.utc_us == 1_780_300_800_000_000 + 60 * S
    wrong = (FlightFailure(-1, "collision", "flew into it"),)
    return FlightResult(flight.number, flight.flavour, flight.seed, "crashed", wrong, (), (), ())


def test_another_campaign_in_the_folder_is_refused(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    flies(good)
    assert run(capsys, "--flights", "1", "-o", "made")[0] == ExitCode.OK
    code, _, err = run(capsys, "--flights", "1", "-o", "made", "--seed", "2")
    assert code == ExitCode.USAGE
    assert "`made` holds a campaign with a different seed" in err
    Path("made/campaign.json").write_text("{}")
    code, _, err = run(capsys, "--flights", "1", "-o", "made")
    assert code == ExitCode.INPUT
    assert "campaign.json` is malformed" in err


def test_a_campaign_of_other_faults_does_not_go_on_in_its_folder(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    flies(good)
    assert run(capsys, "--flights", "1", "-o", "made", "--fault", "wind")[0] == ExitCode.OK
    code, _, err = run(capsys, "--flights", "2", "-o", "made")
    assert code == ExitCode.USAGE
    assert "`made` holds a campaign with different kinds of faults" in err


def test_torn_result_line_repeats_only_its_flight(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    flies(good)
    code, _, err = run(capsys, "--flights", "3", "-o", "made")
    assert (code, "are kept" in err) == (ExitCode.OK, False)
    results = Path("made/results.jsonl")
    results.write_bytes(results.read_bytes()[:-20])
    code, _, err = run(capsys, "--flights", "5", "-o", "made")
    assert (code, "2 of 5 flights are kept in `made`; continuing with the next" in err) == (ExitCode.OK, True)
    kept = [line for line in results.read_bytes().splitlines() if line.endswith(b"}")]
    assert sorted(json.loads(line)["number"] for line in kept) == [0, 1, 2, 3, 4]


def test_flight_with_two_findings_counts_once(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    both = JudgeFinding("collision", "flew into it"), JudgeFinding("late", "came late")
    flies(lambda _, flight: told(flight, *both) if flight.scenario.incidents else told(flight))
    code, out, _ = run(capsys, "--flights", "2", "--no-shrink", "--json")
    assert code == ExitCode.TESTS
    assert json.loads(out)["campaign"]["failed"] == 2


def test_a_mission_that_does_not_fly_without_faults_is_refused(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    flies(lambda _, flight: replace(told(flight), ending="refused"))
    code, _, err = run(capsys)
    assert code == ExitCode.TESTS
    assert "on px4 the mission ends as `refused` without faults" in err
    assert not Path("runs").exists()


def test_a_mission_that_fails_without_faults_is_refused(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    flies(lambda _, flight: told(flight, JudgeFinding("collision", "flew into the ground")))
    code, _, err = run(capsys)
    assert code == ExitCode.TESTS
    assert "on px4 the mission fails without faults: flew into the ground" in err


@pytest.mark.slow
def test_approve_grants_each_requested_approval(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    """Each of two orbits needs the approval of two roles."""
    asked = [f"1 s .. 5 s after goto {step} approve(role = {role})" for step in (2, 3) for role in ("chief", "safety")]
    refused: list[CampaignFlight] = []

    def fly(_: FlownMission, flight: CampaignFlight) -> CampaignResult:
        texts = [each.text for each in flight.scenario.incidents]
        refused.extend([flight] * any(text.split()[-3:] == ["refuse(role", "=", "safety)"] for text in texts))
        return replace(told(flight), ending="completed" if texts[-4:] == asked else "aborted")

    flies(fly)
    mission = str(Path(__file__).parents[4] / "examples" / "wind_farm" / "missions" / "near_look.rts")
    made = ["campaign", mission, *AT, "-j", "1", "-o", "made", "--flights", "400"]
    assert app.main(made) == ExitCode.TESTS
    assert "`--approve` grants all" in capsys.readouterr()[1]
    assert app.main([*made, "--approve"]) == ExitCode.OK
    endings = json.loads(Path("made/report.json").read_text())["endings"]
    assert endings == {"px4": {"completed": 200}, "ardupilot": {"completed": 200}}
    assert refused, "the second role is never drawn"
    capsys.readouterr()
    assert app.main(made) == ExitCode.USAGE
    assert "a different setting of `--approve`" in capsys.readouterr()[1]


def test_fewer_flights_than_were_flown_are_reported_with_all_that_were(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    flies(lambda _, flight: told(flight, *[JudgeFinding("late", "came late")] * (flight.number == 3)))
    assert run(capsys, "--flights", "5", "-o", "made", "--no-shrink")[0] == ExitCode.TESTS
    code, out, _ = run(capsys, "--flights", "2", "-o", "made", "--no-shrink")
    assert code == ExitCode.TESTS
    assert "5 flights, 1 failed" in out


def test_campaign_output_must_be_a_folder(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("made").write_text("mine")
    code, _, err = run(capsys, "-o", "made")
    assert (code, Path("made").read_text()) == (ExitCode.USAGE, "mine")
    assert "`made` is not a folder" in err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--fault", "storm"], "no such fault: `storm`"),
        (["--at", "noon"], "`noon` is not a UTC time"),
        (["--cluster", "tcp://127.0.0.1:9"], "`--jobs` and `--cluster` cannot be combined"),
    ],
)
def test_conflicting_options_are_refused(
    here: Path, capsys: pytest.CaptureFixture[str], words: list[str], text: str
) -> None:
    code, _, err = run(capsys, *words)
    assert code == ExitCode.USAGE
    assert text in err
    assert not Path("runs").exists()


def test_a_cluster_that_does_not_answer_is_named(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    def nobody(*_: object, **__: object) -> None:
        raise OSError

    monkeypatch.setattr(pytest.importorskip("distributed"), "Client", nobody)
    flies(good)
    code = app.main(["campaign", SHORT, *AT, "--cluster", "tcp://127.0.0.1:9", "--flights", "1"])
    assert code == ExitCode.LINK
    assert "no cluster answered: `tcp://127.0.0.1:9`" in capsys.readouterr().err


def test_invalid_scheduler_or_source_is_refused_before_flying(
    here: Path, capsys: pytest.CaptureFixture[str], flies: Callable[[Any], None]
) -> None:
    flies(lambda *_: pytest.fail("nothing is to fly"))
    assert app.main(["campaign", SHORT, *AT, "--cluster", "foo"]) == ExitCode.USAGE
    assert "`foo` is not the address of a Dask scheduler\n help: write it as `tcp://" in capsys.readouterr().err
    Path("made.bundle").write_bytes(case.seal(case.mission(case.short_steps())))
    assert app.main(["campaign", "made.bundle", *AT]) == ExitCode.USAGE
    assert "`made.bundle` is a bundle, and no source\n help: give the source" in capsys.readouterr().err
    assert app.main(["campaign", "none.rts", *AT]) == ExitCode.INPUT
