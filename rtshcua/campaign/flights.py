"""One flight of a campaign: flown, judged, and told in a line. Maybe in another process, or on another machine."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from hashlib import sha256
from time import process_time_ns
from typing import Any, Final, Self

import msgspec

from rtshcua.campaign.results import CampaignResult, JudgeFinding
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.scenario import Scenario
from rtshcua.virtual import development
from rtshcua.virtual.flown import ScenarioFlown
from rtshcua.virtual.judge import judge
from rtshcua.virtual.scenario import Keys, fly
from rtshcua.wire.keys import Duty

#: a flight in which a process died
LOST: Final = "process-died"
DIED: Final = "the process that flew it died, and the next one too"


@dataclass(frozen=True, slots=True)
class CampaignFlight:
    """A flight that is to be flown."""

    number: int
    scenario: Scenario
    tries: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class FlownMission:
    """What all flights of a campaign share: the bundle, the trust root that it is signed under (`development`), and the
    roles of the policy, of whom there are people to ask.
    """

    bundle: bytes
    root: bytes
    roles: tuple[str, ...]

    @classmethod
    def of(cls, policy: Policy, mission: Mission, issued_at_us: int) -> Self:
        """The field of a mission under a policy."""
        roles = policy.roles
        return cls(development.seal(policy, mission), development.root(issued_at_us, roles), roles)

    def flown(self, scenario: Scenario, flavour: str, seed: int) -> ScenarioFlown:
        """A flight of a scenario, as it was."""
        made = development.keys()
        keys = Keys(made[Duty.LOG], development.approvers(self.roles), made[Duty.MISSION], made[Duty.BOUNDARY])
        return fly(self.bundle, self.root, keys, scenario, flavour, seed)

    def fly(self, flight: CampaignFlight) -> CampaignResult:
        """The flight, judged."""
        began = process_time_ns()
        scenario = flight.scenario
        was = self.flown(scenario, scenario.flavours[0], scenario.first_seed)
        verdict = judge(was)
        log = sha256()
        for life in was.lives:
            for line in life.lines:
                log.update(line)
        return CampaignResult(
            flight.number,
            was.flavour,
            was.seed,
            tuple(incident.text for incident in scenario.incidents),
            flight.tries,
            was.ending or "none",
            tuple(JudgeFinding(each.slug, each.text, each.at_us) for each in verdict.failures),
            tuple(JudgeFinding(each.slug, each.text, each.at_us, each.cause or "") for each in verdict.exceptions),
            {name: value for name, value in asdict(verdict.margins).items() if value is not None},
            tuple(moments(was)),
            was.samples[-1].at_us,
            log.hexdigest(),
            (process_time_ns() - began) // 1_000,
        )

    def lost(self, flight: CampaignFlight) -> CampaignResult:
        """The flight, when the process that flew it died, more than once."""
        scenario = flight.scenario
        flavour, seed = scenario.flavours[0], scenario.first_seed
        failed = JudgeFinding(LOST, DIED)
        texts = tuple(incident.text for incident in scenario.incidents)
        return CampaignResult(flight.number, flavour, seed, texts, flight.tries, "none", (failed,), (), {}, (), 0, "")


def moments(was: ScenarioFlown) -> Iterator[tuple[str, int]]:
    """The state changes of a flight: what was sent, and what the vehicle then really did."""
    for life in was.lives:
        for line in life.lines:
            if b'"event":"dispatched"' in line:
                record: dict[str, Any] = msgspec.json.decode(line)
                said = record["detail"].split("(")[0].split()[0]
                yield f"{said} sent" if record["kind"] == 0 else f"fallback {said}", record["at_us"] - was.start_us
        if life.ending is not None:
            yield life.ending, life.ended_us
    before = was.samples[0]
    for sample in was.samples[1:]:
        if sample.armed != before.armed:
            yield "armed" if sample.armed else "disarmed", sample.at_us
        if sample.in_air != before.in_air:
            yield "airborne" if sample.in_air else "down", sample.at_us
        if sample.mode is not before.mode:
            yield f"mode {sample.mode}", sample.at_us
        before = sample
