"""X3: each case at each point, repeated, by request octets to `enforce` and answer octets back, in every mode that
decides as `decide` does. Each answer is compared with the pure `decide`, and with the table of the cases.

In each mission the struck step is repeated, with ids of their own: when one is used, the next repetition asks for the
next, and a new session begins only after the last. So an isolated boundary opens few bundles.
"""

from collections.abc import Iterator, Sequence
from random import Random
from typing import Final, NamedTuple

from msgspec.structs import replace

from rtshcua.decision.decide import decide
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, prepare, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evaluation import case_flights, cases
from rtshcua.evaluation.case_flights import NAME
from rtshcua.evaluation.cases import CASES, EXTRAS, EvaluationCase
from rtshcua.evaluation.design import POINTS, UNENFORCED, EvaluationPlan, EvaluationPoint, WorkUnit
from rtshcua.evaluation.results import EnforceCheck, Result
from rtshcua.evaluation.worlds import RECEIVED, FlatProgram, World, bound, not_here, program_at, world
from rtshcua.model.decision import Decision
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Context, Now
from rtshcua.model.outcome import Outcome
from rtshcua.model.step_number import number_of
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire.request import Request, encode
from rtshcua.wire.response import Status, decode

#: modes whose home takes seconds to start
SLOW: Final = ("trustzone-m", "optee")
#: us between the requests of a session, and from the receipt of the bundle to the first: more than the longest deadline
_APART_US: Final = 250_000
_FIRST_US: Final = 2_000_000
#: how often the struck step is repeated: with 12 steps it fits in the least home
_TIMES: Final = 24
#: us by which the end of a validity is passed
_PAST_US: Final = 1_000_000


def units(plan: EvaluationPlan) -> list[WorkUnit]:
    """One unit for each point and mode, with all cases: an isolated home starts once for it. Then the flights."""
    modes = [mode for mode in plan.modes if mode != UNENFORCED and not (plan.quick and mode in SLOW)]
    points = POINTS[:: len(POINTS) // 3] if plan.quick else POINTS
    checked = [WorkUnit(NAME, ("check", *point, mode, plan.runs)) for mode in modes for point in points]
    return [*checked, *case_flights.units(() if plan.quick else POINTS, quick=plan.quick)]


def run(unit: WorkUnit) -> Sequence[Result]:
    """Check all cases of a unit, or fly one. Raises RuntimeError where a step before the struck one is not allowed."""
    if unit.key[0] == "flight":
        return case_flights.run(unit)
    _, mission, deadline_us, mode, runs = unit.key
    point = EvaluationPoint(str(mission), int(deadline_us))
    missing = not_here(str(mode))
    if missing:
        return missing
    program = program_at(point)
    with world(str(mode), program.policy) as where:
        return [*_checked(where, point, program, int(runs))]


def _checked(where: World, point: EvaluationPoint, program: FlatProgram, runs: int) -> Iterator[EnforceCheck]:
    """The checks of one point. Cases with a bundle of their own come last, and before them what ends a validity: no
    session follows that could not begin then.
    """
    own = (cases.OUT_OF_SCOPE, cases.NOT_PERMITTED)
    common = [each for each in (*CASES, *EXTRAS) if each not in own]
    for group in (common, *([each] for each in own)):
        subject = StruckBundle(where, cases.program_of(group[0], program))
        for case in group:
            for repetition in range(1, runs + 1):
                chance = Random(f"{case.name} {point.mission} {point.deadline_us} {repetition}")
                yield subject.check(case, point, repetition, chance)


class StruckBundle:
    """A bundle in force in one mode, at its struck step, which is repeated; and, apart from it, the same prepared for
    `decide`.
    """

    def __init__(self, where: World, program: FlatProgram) -> None:
        program = cases.repeated(program, _TIMES)
        self._where, self._program = where, program
        self._loaded: Loaded = where.load(program)
        self.mission: Mission = bound(program)
        self._first = self.step = cases.struck_step(self.mission)
        self._other = bound(cases.next_version(program))
        self._pure = Prepared.of(program.policy, self.mission)
        self._begin()

    def _begin(self) -> None:
        self._now_us = RECEIVED.monotonic_us + _FIRST_US
        self._arrived = self._used = False
        self.step = self._first

    def renew(self) -> None:
        """Begin a new session."""
        self._loaded = self._where.renewed(self._loaded)
        self._begin()

    @property
    def loaded(self) -> Loaded:
        """The bundle in force."""
        return self._loaded

    def request(self, case: EvaluationCase, chance: Random) -> Request:
        """The request of a case, in a session in which the struck step has its turn; after a replay's original."""
        if self._used and case is not cases.REPLAY:
            self._used = False
            self.step += 1
            if self.step == self._first + _TIMES:
                self.renew()
        if not self._arrived:
            self._arrive(chance)
        if case is cases.REPLAY and not self._used:
            self._ask(self._honest(self.step, chance))
            self._used = True
        if case is cases.VALIDITY_OVER:
            invocation = self.mission.invocations[self.step]
            over_us = invocation.issued_at_us + invocation.contract.validity_us + RECEIVED.utc_error_us + _PAST_US
            self._now_us = max(self._now_us, RECEIVED.monotonic_us + over_us - RECEIVED.utc_us)
        other = self._other.invocations[self.step].binding
        return cases.troubled(case, self._honest(self.step, chance), self._program.policy, self.mission, other)

    def answer(self, octets: bytes) -> Decision | Status | Refusal:
        """The boundary's answer about the struck step."""
        contract = self.mission.invocations[self.step].contract
        return decode(self._loaded.boundary.enforce(octets), self._program.policy, contract)

    def note(self, said: Decision | Status | Refusal) -> None:
        """Note whether an answer used the id of the step."""
        if not isinstance(said, Decision) or said.outcome in (Outcome.ALLOW, Outcome.FALLBACK):
            self._used = True

    def check(self, case: EvaluationCase, point: EvaluationPoint, repetition: int, chance: Random) -> EnforceCheck:
        """One check."""
        request = self.request(case, chance)
        pure = self._pure.decide(self.step, request, used=case is cases.REPLAY)
        said = self.answer(encode(request))
        found = said if isinstance(said, Decision) else None
        self.note(said)
        agrees = found is not None and replace(found, permit=b"") == pure
        expected = found is not None and (found.outcome, found.reason) == (case.outcome, case.reason)
        return EnforceCheck(
            case=case.name, mission=point.mission, deadline_us=point.deadline_us, mode=self._where.mode,
            repetition=repetition, outcome="undecided" if found is None else found.outcome.name.lower(),
            reason=str(said) if found is None else found.reason, as_expected=expected, agrees=agrees,
            permits=int(found is not None and bool(found.permit)),
            differs="" if agrees and expected else f"{_words(said)}; `decide`: {_words(pure)}",
        )  # fmt: skip

    def _arrive(self, chance: Random) -> None:
        """Have the steps before the struck one allowed."""
        for step in range(self._first):
            self._ask(self._honest(step, chance))
        self._arrived = True

    def _honest(self, step: int, chance: Random) -> Request:
        self._now_us += _APART_US
        ahead_us = RECEIVED.utc_us - RECEIVED.monotonic_us
        now = Now(self._now_us, self._now_us + ahead_us, RECEIVED.utc_error_us)
        return cases.honest(self._program.policy, self.mission, step, now, chance, at=min(step, self._first))

    def _ask(self, request: Request) -> None:
        contract = self.mission.invocations[request.step].contract
        said = decode(self._loaded.boundary.enforce(encode(request)), self._program.policy, contract)
        if not isinstance(said, Decision) or said.outcome is not Outcome.ALLOW:
            raise RuntimeError(f"an honest request is not allowed at step {number_of(request.step)}: {_words(said)}")


class Prepared(NamedTuple):
    """A policy and a mission, prepared for `decide` only."""

    policy: PreparedPolicy
    steps: tuple[PreparedInvocation, ...]

    @classmethod
    def of(cls, policy: Policy, mission: Mission) -> "Prepared":
        prepared = prepare(policy)
        if isinstance(prepared, Refusal):
            raise RuntimeError(str(prepared))
        steps = prepare_mission(mission, prepared)
        if isinstance(steps, Refusal):
            raise RuntimeError(str(steps))
        return cls(prepared, steps)

    def decide(self, step: int, asked: Request, *, used: bool) -> Decision:
        """What is decided about a request of the step, whose id was used before or not."""
        policy = self.policy.policy
        context = Context(
            asked.binding, policy.vehicle.identity, policy.version, int(used), asked.released_us, asked.phase,
            asked.remaining_us, (),
        )  # fmt: skip
        return decide(self.steps[step], asked.state, self.policy, context, asked.now)


def _words(said: Decision | Status | Refusal) -> str:
    """An answer in words."""
    if isinstance(said, Status):
        return f"undecided ({said.name.lower()})"
    if isinstance(said, Refusal):
        return str(said)
    clause = "" if said.clause is None else f" at `{said.clause.text}`"
    target = "" if said.target is None else f" to `{said.target.text}` (link {said.link})"
    until = f", valid until {said.valid_until_us} us" if said.outcome is Outcome.ALLOW else ""
    return f"{said.outcome.name.lower()} because {said.reason}{clause}{target}{until}"
