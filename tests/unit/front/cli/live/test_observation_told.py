"""A temporal condition is unknown when a run begins: `run` reports it, and a rehearsal does not count it as refused."""

from msgspec.structs import replace

from reference.flat_case import CONTRACTS, MISSION, POLICY, TAKEOFF, WIND, M, S, apply, clause, const, signal
from reference.forgery import edit
from reference.world import START, FakeVehicle, Run, loaded
from rtshcua.app.fly.dry_run import FlightRehearsal
from rtshcua.app.fly.narrator import Teller
from rtshcua.decision.tree import slots_read
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.front.cli.render.live.lines import sentence
from rtshcua.front.cli.render.showing import rehearsed
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.policy import Monitor, MonitorKind
from rtshcua.model.flat.situation import State
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.rehearsal import rehearse
from rtshcua.wire.request import DEGRADE, FALLBACK_LINK
from virtual.rows import rows

CALM = Monitor(MonitorKind.FOR_LAST, 3 * S, clause("wind.speed < 8 m/s", apply(Op.LT, signal(WIND), const(8 * M))))
STILL = Monitor(MonitorKind.FOR_LAST, 2 * S, clause("so", (Op.MONITOR, 0, 0)))
LATER = clause("wind.speed < 8 m/s for the last 3 s for the last 2 s", (Op.MONITOR, 1, 0))


def waiting(skill: int = TAKEOFF) -> Loaded:
    """A mission with a skill that requires calm air for 3 s; calm was observed for 2 s."""
    contract = replace(CONTRACTS[skill], deadline_us=30 * S, require=(LATER,))
    read = slots_read((*contract.require, *contract.assume, *contract.maintain), POLICY.vehicle, (CALM, STILL))
    contract = replace(contract, reads=read)
    contracts = (*CONTRACTS[:skill], contract, *CONTRACTS[skill + 1 :])
    steps = tuple(replace(one, contract=contract) if one.skill == skill else one for one in MISSION.invocations)
    return loaded(replace(POLICY, monitors=(CALM, STILL), contracts=contracts), replace(MISSION, invocations=steps))


def test_run_names_the_condition_a_deferral_waits_for() -> None:
    run = Run(waiting()).until_flies("takeoff")
    teller = Teller(run.loaded.policy.policy, run.loaded.bundle.mission, START.monotonic_us)
    told = [each for each in map(teller.tell, run.lines[1:]) if each is not None and each.event == "decision"]
    assert [each.outcome for each in told] == ["defer", "allow"]
    assert told[0].waits == "the clause looks back 5 s, but observation began with the run"
    assert sentence(told[0]).endswith(f"because state/unknown: `{LATER.text}`; {told[0].waits}")
    assert told[1].waits == ""


def test_unknown_input_after_long_observation_waits_for_another_cause() -> None:
    run = Run(waiting()).until_flies("takeoff")
    teller = Teller(run.loaded.policy.policy, run.loaded.bundle.mission, START.monotonic_us - 5 * S)
    told = [each for each in map(teller.tell, run.lines[1:]) if each is not None and each.event == "decision"]
    assert [each.waits for each in told] == ["", ""]


@rows(
    ("wind", "monitors", "hopeful", "observing"),
    [
        (4 * M, (UNKNOWN, UNKNOWN), True, True),
        (4 * M, (TRUE, TRUE), True, False),
        (9 * M, (UNKNOWN, UNKNOWN), False, False),  # as it is now, it would be false then
        (9 * M, (FALSE, FALSE), False, False),
        (None, (UNKNOWN, UNKNOWN), False, False),
    ],
)
def test_a_first_step_that_waits_to_have_observed_enough_would_fly(
    wind: int | None, monitors: tuple[int, ...], hopeful: bool, observing: bool
) -> None:
    values = FakeVehicle().values | {WIND: wind}
    state = State(tuple(values[slot] for slot in range(len(values))), (10_000,) * len(values), monitors)
    first = rehearse(waiting(), state, START)[0]
    assert (first.hopeful, first.observing) == (hopeful, observing)


def test_dry_run_names_the_awaited_condition() -> None:
    of, values = waiting(), FakeVehicle().values
    state = State(tuple(values[slot] for slot in range(len(values))), (10_000,) * len(values), (UNKNOWN, UNKNOWN))
    page = str(rehearsed._page(FlightRehearsal(of, rehearse(of, state, START), (), None, None, interrupted=False)))
    assert "waits until the condition was observed for its whole window, from the start of the run" in " ".join(
        page.split()
    )
    assert "1 waiting for later events, 0 would not fly" in page


def test_degraded_skill_is_named_if_it_is_unique() -> None:
    run = Run(loaded()).until_flies("takeoff")
    sent = next(line for line in run.lines if b'"event":"dispatched"' in line)
    degraded = edit(sent, kind=FALLBACK_LINK, link=DEGRADE)
    rule = next(each for each in POLICY.rules if each.target is not None)
    other = replace(rule, target=replace(rule.target, text="another link"))
    for policy, subject in (
        (POLICY, f"fallback: {rule.target.text}"),
        (replace(POLICY, rules=(*POLICY.rules, other)), "fallback: what the policy degrades to"),
    ):
        told = Teller(policy, MISSION, START.monotonic_us).tell(degraded)
        assert told is not None
        assert told.subject == subject
