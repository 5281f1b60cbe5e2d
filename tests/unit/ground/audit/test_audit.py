"""The log of every kind of mission passes the audit, and the report states exactly what it proves.

`test_frames_follow` audits the log of every kind of flight.
"""

from collections.abc import Sequence

import pytest
from msgspec.structs import replace

from reference.forgery import LOG_KEY, ROOT_KEY, edit, flight, prove, read, signed, sound
from reference.kinds_of_flight import FAULTS, recorded
from rtshcua.evidence.report import LogVerdict
from rtshcua.ground.audit.audit import Audit, audit
from rtshcua.model.faults import BatteryLevel, Fault
from rtshcua.model.flat.mission import Mission, OnInadmissible
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.ports import Event, Interrupted
from rtshcua.wire.keys import Duty
from virtual import case
from virtual.flight import Flight
from virtual.sampling import each_once

S = case.S


def fly(*faults: Fault, of: Mission | None = None) -> list[bytes]:
    mission = of or case.mission(case.short_steps())
    return Flight(case.seal(mission), case.simulated("px4", faults=faults), attested=False).fly().lines


@pytest.mark.slow
@pytest.mark.parametrize(
    ("behaviour", "kind"), each_once(OnInadmissible, ["wind", "no fix for a while", "low battery"])
)
def test_log_passes_for_every_action_when_a_step_is_not_admitted(behaviour: OnInadmissible, kind: str) -> None:
    mission = case.mission(case.short_steps())
    steps = tuple(replace(step, on_inadmissible=behaviour) for step in mission.invocations)
    sound(fly(*FAULTS[kind], of=replace(mission, invocations=steps)))


def test_log_of_an_interrupted_flight_passes() -> None:
    interrupted = [False]

    def each(run: Flight) -> Sequence[Event]:
        now_us = run.clock.now().monotonic_us
        if interrupted[0] or now_us < 20 * S:
            return ()
        interrupted[0] = True
        return (Interrupted(now_us),)

    flown = Flight(case.seal(case.mission(case.short_steps())), case.simulated("px4")).fly(each)
    assert interrupted[0]
    assert flown.effects("interrupted")
    sound(flown.lines)


def test_report_lists_proven_and_unproven_claims() -> None:
    report = sound(flight()).report
    assert [claim.slug for claim in report.proven] == [
        "trust", "bundle", "chain", "seals", "signed-close", "decisions", "dispatches",
    ]  # fmt: skip
    assert [claim.slug for claim in report.unproven] == ["anchor", "boundary", "state", "development"]
    texts = " ".join(claim.text for claim in report.proven)
    assert "3 decisions derived again" in texts
    assert "3 dispatches, each after a record" in texts
    assert LOG_KEY.kid.hex() in texts


def test_report_uses_singular_and_plural() -> None:
    lines = fly(BatteryLevel(0, 1_500))
    texts = [claim.text for claim in sound(lines).report.proven]
    decisions = sum(read(line)["type"] == "decision" for line in lines)
    assert f"{decisions} decision{'' if decisions == 1 else 's'} derived again, each with the same answer" in texts
    assert "0 dispatches, each after a record that permits it" in texts


def test_truncated_log_still_proves_its_beginning() -> None:
    report = prove(flight()[:-1]).report
    assert report.verdict is LogVerdict.INCOMPLETE
    assert [claim.slug for claim in report.proven] == ["trust", "bundle", "chain", "seals", "decisions", "dispatches"]
    assert "signed-close" in [claim.slug for claim in report.unproven]


def test_failed_log_proves_nothing() -> None:
    report = prove([flight()[0], *flight()[2:]]).report
    assert report.proven == ()
    assert [claim.slug for claim in report.unproven] == ["log"]
    report = prove(signed([flight()[0], edit(flight()[2], outcome="deny"), flight()[-1]])).report
    assert (report.proven, report.shortfall) == ((), None)
    assert [claim.slug for claim in report.unproven] == ["log"]


@pytest.mark.slow
def test_report_says_that_mode_none_needs_no_permits() -> None:
    report = sound_without_permits(recorded("wind", "ardupilot", EnforcementMode.NONE).lines)
    assert "enforcement" in [claim.slug for claim in report.report.unproven]
    assert "dispatches" not in [claim.slug for claim in report.report.proven]


def sound_without_permits(lines: Sequence[bytes]) -> Audit:
    result = prove(lines)
    assert result.report.failure is None, result.report.failure
    return result


@pytest.mark.parametrize("length", [16, 32])
def test_pin_may_be_a_public_key_or_its_kid(length: int) -> None:
    root = case.KEYS[Duty.ROOT]
    pinned = root.kid if length == 16 else root.public
    assert audit(flight(), pinned).report.failure is None


def test_log_fails_under_another_pinned_key() -> None:
    for pinned in (bytes(16), bytes(32), case.KEYS[Duty.POLICY].public):
        report = audit(flight(), pinned).report
        assert report.failure is not None
        assert report.failure.slug.startswith("trust/root-")
        assert report.failure.record == 0


def test_changed_record_is_reported_as_a_chain_flaw_first() -> None:
    lines = list(flight())
    number = next(n for n, line in enumerate(lines) if read(line)["type"] == "decision")
    lines[number] = edit(lines[number], outcome="deny")
    report = audit(lines, ROOT_KEY).report
    assert report.failure is not None
    assert (report.failure.slug, report.failure.record) == ("chain/broken", number)


def test_wrong_record_at_the_end_is_reported() -> None:
    lines = flight()
    number = next(n for n, line in enumerate(lines) if read(line)["type"] == "decision")
    report = audit([*lines[:number], edit(lines[number], outcome="deny")], ROOT_KEY).report
    assert report.failure is not None
    assert (report.failure.slug, report.failure.record) == ("decision/outcome", number)
