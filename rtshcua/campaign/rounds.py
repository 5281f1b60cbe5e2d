"""Fly a campaign round by round: each flight is flown, judged and stored as a line of JSON.

The flights of a round depend only on the results of earlier rounds. A campaign therefore gives the same results with
any number of workers, in any order of completion, and after any interruption. It continues from its stored lines; a
truncated line counts as not flown.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from hashlib import sha256
from time import process_time_ns
from typing import Any, Final, Self

import msgspec

from rtshcua.campaign.drawing import CampaignTally, Drawn, FaultSpace, Moment, draw
from rtshcua.campaign.workers import FlightWorkers
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.scenario import Scenario
from rtshcua.virtual import development_keys
from rtshcua.virtual.flight_record import ScenarioFlown
from rtshcua.virtual.judge import judge
from rtshcua.virtual.scenario import Keys, fly
from rtshcua.wire.keys import Duty


class JudgeFinding(msgspec.Struct, frozen=True):
    """A failure, or an excused failure with its cause in `why`."""

    slug: str
    text: str
    at_us: int = 0
    why: str = ""


class CampaignResult(msgspec.Struct, frozen=True):
    """The result of one flight. `tries` are pairs of a fault kind and the state change near it; `margins` the judge's.

    `moments` are the observed state changes. `took_us` is processor time, the only field that differs when the flight
    is repeated.
    """

    number: int
    flavour: str
    seed: int
    incidents: tuple[str, ...]
    tries: tuple[tuple[str, str], ...]
    ending: str
    failures: tuple[JudgeFinding, ...]
    exceptions: tuple[JudgeFinding, ...]
    margins: dict[str, int]
    moments: tuple[tuple[str, int], ...]
    flown_us: int
    log: str
    """SHA-256 of the flight's log, in hexadecimal."""
    took_us: int = 0


#: how many occurrences of a state change are kept
_KEPT: Final = 40
_DECODER: Final = msgspec.json.Decoder(CampaignResult)


def result_line(result: CampaignResult) -> bytes:
    """Return the stored line of a result."""
    return msgspec.json.encode(result) + b"\n"


def read_results(lines: Iterable[bytes]) -> dict[int, CampaignResult]:
    """Return the stored results by number; malformed lines are skipped."""
    found: dict[int, CampaignResult] = {}
    for each in lines:
        try:
            result = _DECODER.decode(each)
        except msgspec.MsgspecError:
            continue
        found[result.number] = result
    return found


def tally(results: Iterable[CampaignResult]) -> CampaignTally:
    """Return the tally of results, which must be ordered by number."""
    made = CampaignTally()
    seen: dict[tuple[str, str], int] = {}
    for result in results:
        moments = made.moments.setdefault(result.flavour, [])
        for label, at_us in result.moments:
            count = seen.get((result.flavour, label), 0)
            if count < _KEPT:
                seen[result.flavour, label] = count + 1
                moments.append(Moment(label, at_us))
        for pair in result.tries:
            made.tried[pair] = made.tried.get(pair, 0) + 1
    return made


#: the slug and text of a flight whose worker process died
LOST: Final = "process-died"
DIED: Final = "the worker process of this flight died twice"


@dataclass(frozen=True, slots=True)
class CampaignFlight:
    """A flight to be flown."""

    number: int
    scenario: Scenario
    tries: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class FlownMission:
    """The shared inputs of all flights of a campaign: the bundle, its trust root (`development_keys`), and the policy's
    roles.
    """

    bundle: bytes
    root: bytes
    roles: tuple[str, ...]

    @classmethod
    def of(cls, policy: Policy, mission: Mission, issued_at_us: int) -> Self:
        """Seal a mission under a policy."""
        roles = policy.roles
        return cls(development_keys.seal(policy, mission), development_keys.root(issued_at_us, roles), roles)

    def flown(self, scenario: Scenario, flavour: str, seed: int) -> ScenarioFlown:
        """Fly a scenario and return its record."""
        made = development_keys.keys()
        keys = Keys(made[Duty.LOG], development_keys.approvers(self.roles), made[Duty.MISSION], made[Duty.BOUNDARY])
        return fly(self.bundle, self.root, keys, scenario, flavour, seed)

    def fly(self, flight: CampaignFlight) -> CampaignResult:
        """Fly and judge a flight."""
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
        """Return the result of a flight whose worker process died repeatedly."""
        scenario = flight.scenario
        flavour, seed = scenario.flavours[0], scenario.first_seed
        failed = JudgeFinding(LOST, DIED)
        texts = tuple(incident.text for incident in scenario.incidents)
        return CampaignResult(flight.number, flavour, seed, texts, flight.tries, "none", (failed,), (), {}, (), 0, "")


def moments(was: ScenarioFlown) -> Iterator[tuple[str, int]]:
    """Yield the state changes of a flight: sent commands, endings, and true changes of the vehicle."""
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


#: flights per round; the first round is small, because no state changes are known yet
FIRST: Final = 20
ROUND: Final = 100


@dataclass(frozen=True, slots=True)
class CampaignOrder:
    """A request for flights 0 to `flights` - 1 of the campaign with this seed."""

    seed: int
    flights: int
    space: FaultSpace


def rounds(flights: int) -> Iterator[range]:
    """Yield the flight numbers of each round."""
    first = 0
    while first < flights:
        end = min(flights, first + (ROUND if first else FIRST))
        yield range(first, end)
        first = end


def drawn(order: CampaignOrder, number: int, past: Mapping[int, CampaignResult]) -> Drawn:
    """Draw one flight again; `past` must hold the results of all earlier rounds."""
    first = next(each for each in rounds(order.flights) if number in each)[0]
    return draw(order.seed, number, order.space, tally(past[n] for n in range(first)))


def fly_rounds(
    order: CampaignOrder,
    field: FlownMission,
    workers: FlightWorkers,
    past: dict[int, CampaignResult],
    keep: Callable[[CampaignResult], None],
) -> None:
    """Fly the flights that are missing in `past` and add them; `keep` is called with each result at once."""
    for numbers in rounds(order.flights):
        left = [number for number in numbers if number not in past]
        if not left:
            continue
        known = tally(past[number] for number in range(numbers[0]))
        flights = []
        for number in left:
            made = draw(order.seed, number, order.space, known)
            flights.append(CampaignFlight(number, made.scenario, made.tries))
        for result in workers.fly(field, flights):
            past[result.number] = result
            keep(result)
