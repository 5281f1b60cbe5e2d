"""Flights of the field mission by the correct runtime, and by wrong ones."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Final

from campaign.wrong import BY_NAME, Aimed
from rtshcua.app.programs import compile_sources
from rtshcua.campaign.drawing import FLAVOURS, CampaignTally, FaultSpace, draw
from rtshcua.campaign.rounds import CampaignFlight, CampaignResult, FlownMission, JudgeFinding, moments
from rtshcua.model.faults import KINDS
from rtshcua.model.scenario import Scenario, Start
from rtshcua.virtual.flight_record import ScenarioFlown
from rtshcua.virtual.judge import judge

ISSUED_US: Final = 1_767_225_600_000_000
_COMPILED, _ = compile_sources([Path(__file__).with_name("field.rts")], mission=None, issued_at_us=ISSUED_US)
assert _COMPILED.policy is not None, _COMPILED.diagnostics
assert _COMPILED.mission is not None
POLICY, MISSION = _COMPILED.policy, _COMPILED.mission
FIELD: Final = FlownMission.of(POLICY, MISSION, ISSUED_US)
SKILLS: Final = tuple(POLICY.contracts[each.skill].name for each in MISSION.invocations)
#: us: how long a calm flight takes
LASTS_US: Final = {"px4": 76_650_000, "ardupilot": 77_700_000}


@dataclass(frozen=True)
class Right:
    """A flight by the correct runtime, and its log."""

    flight: CampaignFlight
    result: CampaignResult
    log: bytes

    def shows(self, words: Sequence[bytes]) -> bool:
        """Return whether any of these is in the log, or the list is empty."""
        return not words or any(word in self.log for word in words)


@cache
def space(aimed: Aimed | None = None) -> FaultSpace:
    """Return the fault space."""
    roles = sorted({POLICY.roles[rule.approver] for rule in POLICY.rules if rule.approver >= 0})
    read = sorted({source.message for signal in POLICY.signals for source in signal.sources})
    drawn_from = FaultSpace(SKILLS, LASTS_US, tuple(roles), FLAVOURS, read=tuple(read))
    if aimed is None:
        return drawn_from
    return replace(drawn_from, kinds=frozenset(KINDS[kind] for kind in aimed.kinds), flavours=aimed.flavours)


def flight_of(seed: int, number: int, drawn_from: FaultSpace, known: CampaignTally) -> CampaignFlight:
    """Draw a flight of a campaign."""
    made = draw(seed, number, drawn_from, known)
    return CampaignFlight(number, made.scenario, made.tries)


def calm(flavour: str) -> Scenario:
    """Return a scenario without faults."""
    return Scenario("calm", (flavour,), 1, 1, Start(), (), ())


def flown(scenario: Scenario) -> ScenarioFlown:
    """Fly with the current runtime."""
    return FIELD.flown(scenario, scenario.flavours[0], scenario.first_seed)


def right(flight: CampaignFlight) -> Right:
    """Fly with the correct runtime."""
    return judged(flight, flown(flight.scenario))


def judged(flight: CampaignFlight, was: ScenarioFlown) -> Right:
    """Judge the flight."""
    verdict = judge(was)
    result = CampaignResult(
        flight.number, was.flavour, was.seed, tuple(each.text for each in flight.scenario.incidents), flight.tries,
        was.ending or "none", tuple(JudgeFinding(each.slug, each.text, each.at_us) for each in verdict.failures),
        tuple(JudgeFinding(each.slug, each.text, each.at_us, each.cause or "") for each in verdict.exceptions),
        {name: value for name, value in asdict(verdict.margins).items() if value is not None}, tuple(moments(was)),
        was.samples[-1].at_us, "",
    )  # fmt: skip
    return Right(flight, result, b"".join(line for life in was.lives for line in life.lines))


def wrongly(name: str, scenario: Scenario) -> ScenarioFlown:
    """Fly with a wrong runtime."""
    with BY_NAME[name].made():
        return flown(scenario)


def wrong_fails(name: str, flight: CampaignFlight) -> tuple[str, ...]:
    """Return the slugs of its failures."""
    return tuple(dict.fromkeys(each.slug for each in judge(wrongly(name, flight.scenario)).failures))
