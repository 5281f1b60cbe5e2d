"""Lowers tests to cases, one for each row of a table, under a lowered policy.

A request is a real one: a mission of one step, lowered, bound and prepared like any other. Missions of tests are not
proved, so that a test can make a request that the proofs would refuse.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence

from msgspec.structs import replace

from rtshcua.decision.prepare import PreparedInvocation, prepare_mission
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.arguments import bind_value, pair
from rtshcua.ground.checker.checks.premises import TestStart, nominal_of, start_of
from rtshcua.ground.checker.checks.tests import unranged
from rtshcua.ground.checker.context import Bound, CheckContext
from rtshcua.ground.checker.name_scope import Scope
from rtshcua.ground.checker.report import Report
from rtshcua.ground.lower.mission import lower_mission
from rtshcua.ground.testing.case import PolicyCase, PolicyUnderTest
from rtshcua.ground.testing.case_situation import Situations, SubjectValue
from rtshcua.ground.testing.clause_quotes import quoted_clauses
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.limits import MAX_DURATION
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.situation import Context as Standing
from rtshcua.model.flat.situation import Now
from rtshcua.model.ir.expression import Coordinates
from rtshcua.model.ir.missions import MissionDecl, Phase, Step
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import VehicleDecl, ZoneDecl
from rtshcua.model.ir.policies import PolicyDecl
from rtshcua.model.ir.skills import ArgumentValue, SkillDecl
from rtshcua.model.ir.tests import Answer, Expectation, Named, RequestDecl, Subject, TableRow, TestDecl
from rtshcua.wire.binding import bind
from rtshcua.wire.bundle import policy_digest, policy_payload

#: the default source of a request, as in a `permit`
OWN_SOURCE = "operator"


class Requests:
    """The requests of the tests under one policy; equal ones are made once. `names` are the signed names of files."""

    def __init__(self, context: CheckContext, policy: PolicyUnderTest, names: Mapping[str, str]) -> None:
        self._context = context
        self._policy = policy
        self._names = names
        self._digest = policy_digest(policy_payload(policy.lowered.policy))
        self._made: dict[tuple[object, ...], PreparedInvocation] = {}

    def of(
        self,
        test: TestDecl,
        request: RequestDecl,
        start: TestStart,
        columns: Sequence[ArgumentValue],
        issued_at_us: int,
    ) -> PreparedInvocation | None:
        """Return a request with its own arguments and those of a row; None after a finding."""
        skill = self._context.symbols.skills[request.skill.text]
        arguments = (*request.arguments, *columns)
        bound = self._bound(skill, arguments, request)
        phase = None if bound is None else self._phase(request, start)
        if bound is None or phase is None:
            return None
        assert start.role is not None
        source = start.source or Name(span=request.span, text=OWN_SOURCE)
        order = tuple(name.text for name in start.order)
        key = (skill.name.text, tuple(map(_bound_key, bound)), start.role.text, source.text, order, phase, issued_at_us)
        if key not in self._made:
            step = Step(span=request.span, skill=request.skill, arguments=arguments, on_inadmissible="abort")
            mission = MissionDecl(
                span=test.span,
                name=Name(span=test.name.span, text="test"),  # the title of a test is not a valid name
                policy=start.nominal.policy,
                policy_version=self._policy.lowered.policy.version,
                vehicle=start.nominal.vehicle,
                intent=None,
                source=source,
                proposer=None,
                role=start.role,
                phases=tuple(
                    Phase(span=name.span, name=name, items=(step,) if name.text == phase else ())
                    for name in start.order
                ),
            )
            made = self._lowered(mission, step, skill, bound, issued_at_us)
            if made is None:
                return None
            self._made[key] = made
        return self._made[key]

    def _bound(self, skill: SkillDecl, arguments: Sequence[ArgumentValue], request: RequestDecl) -> list[Bound] | None:
        """The value of every parameter, of the right type but perhaps out of range; None if one is missing."""
        context = self._context
        pairs = pair(context, skill, arguments, request.span)
        known = context.arguments(skill)
        silent = Scope(context.symbols, Report(context.report.sources))
        bound: list[Bound] = []
        for parameter in skill.parameters:
            value = None if pairs is None else pairs.get(parameter.name.text, parameter.default)
            found = None if value is None else bind_value(silent, unranged(known[parameter.name.text]), value)
            if found is None:
                return None
            bound.append(found)
        return bound

    def _phase(self, request: RequestDecl, start: TestStart) -> str | None:
        """The phase of the step: the mission's own, or else the first in which the skill is valid."""
        assert start.phase is not None
        valid = [name.text for name in self._context.symbols.skills[request.skill.text].phases]
        order = [name.text for name in start.order]
        if not valid or start.phase.phase.text in valid:
            return start.phase.phase.text
        found = next((name for name in order if name in valid), None)
        if found is None:
            phases = ", ".join(f"`{name}`" for name in valid)
            current = start.phase.phase.text
            self._context.report.add(
                codes.UNKNOWN_PHASE,
                request.skill.span,
                f"`{request.skill.text}` is valid only during {phases}, and the test has no such phase",
                help=f"name the phases in order, as in `phase {current} of {current}, {valid[0]}`",
                labels=[(start.phase.span, "the phase is set here")],
            )
        return found

    def _lowered(
        self, mission: MissionDecl, step: Step, skill: SkillDecl, bound: list[Bound], issued_at_us: int
    ) -> PreparedInvocation | None:
        context, under = self._context, self._policy.lowered
        context.bind(step, self._within(skill, bound))
        lowered = lower_mission(context, mission, under, self._names, issued_at_us)
        if lowered is None:
            return None
        flat = _with_arguments(lowered.mission, under.contracts.cells(bound))
        prepared = prepare_mission(bind(flat, self._digest), self._policy.prepared)
        if not isinstance(prepared, Refusal):
            return prepared[0]
        context.report.add(
            codes.REFUSED_ON_BOARD,
            step.span,
            f"the vehicle would refuse this request without a decision: {prepared.text}",
            help="use arguments nearer to the ranges of the skill",
        )
        return None

    def _within(self, skill: SkillDecl, bound: list[Bound]) -> tuple[Bound, ...]:
        """The arguments moved into their ranges, because only those can be planned."""
        known = self._context.arguments(skill)
        found: list[Bound] = []
        for parameter, value in zip(skill.parameters, bound, strict=True):
            argument = known[parameter.name.text]
            if isinstance(value, int) and argument.low is not None and argument.high is not None:
                value = min(max(value, argument.low), argument.high)
            found.append(value)
        return tuple(found)


def _with_arguments(mission: Mission, arguments: tuple[int, ...]) -> Mission:
    """The mission with these arguments in its one step, and the altitude and speed of its plan from them."""
    (invocation,) = mission.invocations
    if arguments == invocation.arguments:
        return mission
    plan, contract = invocation.plan, invocation.contract
    altitude = _cell(contract, arguments, "altitude", plan.altitude)
    lowest = _cell(contract, arguments, "lowest", plan.lowest)
    plan = replace(
        plan, altitude=altitude, speed=_cell(contract, arguments, "speed", plan.speed),
        heights=tuple(min(max(height, lowest), altitude) for height in plan.heights),
    )  # fmt: skip
    return replace(mission, invocations=(replace(invocation, arguments=arguments, plan=plan),))


def _cell(contract: Contract, arguments: tuple[int, ...], name: str, otherwise: int) -> int:
    cell: int = getattr(contract.motion, name)
    return otherwise if cell == -1 else arguments[cell]


def _bound_key(bound: Bound) -> object:
    if isinstance(bound, ZoneDecl):
        return bound.name.text
    return (bound.latitude, bound.longitude) if isinstance(bound, Coordinates) else bound


#: the time for validation and dispatch in us, which is assumed on board until enough was measured
REMAINING_US = 20_000
#: the monotonic time of every decision in us, large enough for all earlier times to be positive
AT_US = MAX_DURATION

Lower = Callable[[PolicyDecl, VehicleDecl], PolicyUnderTest | None]


class _Under:
    """A policy with the data that its tests share."""

    def __init__(self, context: CheckContext, policy: PolicyUnderTest, names: Mapping[str, str]) -> None:
        self.policy = policy
        self.requests = Requests(context, policy, names)
        self.situations = Situations(context, policy)


def cases_of(context: CheckContext, lower: Lower, names: Mapping[str, str]) -> Iterator[PolicyCase]:
    """Yield the cases of the checked tests in `context`, except those with findings.

    `lower` returns a policy for a vehicle; `names` are the signed names of files.
    """
    symbols = context.symbols
    known: dict[tuple[str, str], _Under] = {}
    for test in symbols.tests:
        nominal = nominal_of(context, test)
        if nominal is None or test.request is None:
            continue
        key = nominal.policy.text, nominal.vehicle.text
        policy = lower(symbols.policies[key[0]], symbols.vehicles[key[1]])
        if policy is None:
            continue
        if key not in known:
            known[key] = _Under(context, policy, names)
        yield from _Cases(context, known[key], test, test.request, start_of(test, nominal)).made()


class _Cases:
    """Lowers the cases of one test."""

    def __init__(
        self, context: CheckContext, under: _Under, test: TestDecl, request: RequestDecl, start: TestStart
    ) -> None:
        self._context = context
        self._under = under
        self._test = test
        self._request = request
        self._start = start
        premises = test.premises, start.nominal.premises
        self._assigned = [
            SubjectValue(each.subject, each.cell, each.span) for held in reversed(premises) for each in held.given
        ]
        self._released = next((held.released.value for held in premises if held.released is not None), 0)
        self._issue = next((held.issued for held in premises if held.issued is not None), None)

    def made(self) -> Iterator[PolicyCase]:
        """Yield the case of each row, or the only one."""
        test = self._test
        if test.table is None:
            assert test.expectation is not None
            case = self._case(test.name.text, None, test.name.span, test.expectation, (), None)
            if case is not None:
                yield case
            return
        seen: Counter[str] = Counter()
        for number, row in enumerate(test.table.rows):
            cells = ", ".join(self._context.report.text(cell.span) for cell in row.cells)
            name = f"{test.name.text} [{cells}]"
            seen[name] += 1
            name = name if seen[name] == 1 else f"{name} #{seen[name]}"
            case = self._case(name, number, row.span, row.expectation, test.table.columns, row)
            if case is not None:
                yield case

    def _case(
        self,
        name: str,
        number: int | None,
        span: Span,
        expected: Expectation,
        columns: tuple[Subject, ...],
        row: TableRow | None,
    ) -> PolicyCase | None:
        under, start = self._under, self._start
        assert start.instant is not None
        assigned, arguments = list(self._assigned), []
        for column, cell in zip(columns, () if row is None else row.cells, strict=True):
            if isinstance(column, Named) and column.name.text not in self._context.symbols.signals:
                assert cell.value is not None
                arguments.append(ArgumentValue(span=cell.span, name=column.name, value=cell.value))
            else:
                assigned.append(SubjectValue(column, cell, column.span))
        within = start.instant.within
        now = Now(AT_US, start.instant.utc_us, 0 if within is None else within.value)
        distance = 0 if self._issue is None else self._issue.distance.value
        issued_at_us = now.utc_us + (distance if self._issue is not None and self._issue.ahead else -distance)
        invocation = under.requests.of(self._test, self._request, start, arguments, issued_at_us)
        if invocation is None:
            return None
        before = len(self._context.report.found)
        state = under.situations.state(assigned, now)
        standing = self._standing(invocation)
        self._warn_of_missing(invocation, assigned)
        quoted = quoted_clauses(self._context, expected, invocation, under.policy)
        errors = self._context.report.found[before:]
        if any(found.code.severity is codes.Severity.ERROR for found in errors):
            return None
        phases = tuple(each.text for each in start.order)
        return PolicyCase(
            name=name,
            test=self._test,
            row=number,
            span=span,
            expected=expected,
            policy=under.policy,
            invocation=invocation,
            state=state,
            context=standing,
            now=now,
            phases=phases,
            nominal=start.nominal,
            quoted=quoted,
        )

    def _standing(self, invocation: PreparedInvocation) -> Standing:
        """The context of the mission: as the request expects it, except for the premises of the test."""
        test, nominal = self._test.premises, self._start.nominal.premises
        policy = self._under.policy.lowered.policy
        binding = invocation.invocation.binding
        tampered = test.tampered or nominal.tampered
        in_force = test.in_force or nominal.in_force
        identity = test.identity or nominal.identity
        answered = _numbered(nominal.answers) | _numbered(test.answers)
        phase = self._start.phase
        assert phase is not None
        return Standing(
            binding=binding if tampered is None else bytes([binding[0] ^ 1]) + binding[1:],
            vehicle=policy.vehicle.identity if identity is None else identity.text,
            policy_version=policy.version if in_force is None else in_force.version,
            consumed=int((test.replayed or nominal.replayed) is not None),
            released_us=AT_US - self._released,
            phase=[name.text for name in self._start.order].index(phase.phase.text),
            remaining_us=REMAINING_US,
            approvals=self._under.situations.approvals(answered.values(), AT_US),
        )

    def _warn_of_missing(self, invocation: PreparedInvocation, assigned: list[SubjectValue]) -> None:
        """Warn of signals that are unknown because they have no value."""
        missing = self._under.situations.missing((slot for slot, _ in invocation.reads), assigned)
        if missing:
            have = "has no value: it is unknown" if len(missing) == 1 else "have no values: they are unknown"
            self._context.report.add(
                codes.NOT_GIVEN,
                self._request.skill.span,
                f"a decision on `{self._request.skill.text}` reads {listed(missing)}, which {have}",
                help=f"add a value to the nominal or the test, or write `given {missing[0]} = unknown`",
                labels=[(self._start.nominal.name.span, "the test starts from here")],
            )


def _numbered(answers: Sequence[Answer]) -> dict[tuple[str, int], Answer]:
    """The answers by role, and whether it is the first or second person of the role."""
    found: dict[tuple[str, int], Answer] = {}
    for answer in answers:
        found[answer.role.text, (answer.role.text, 0) in found] = answer
    return found
