"""E1408 to E1410: tests become cases, one a row of a table; what they rest on is the policy as it was lowered."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence

from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.context import Context
from rtshcua.ground.checker.starts import Start, nominal_of, start_of
from rtshcua.ground.testing.case import Case, Tested
from rtshcua.ground.testing.clauses import quoted_clauses
from rtshcua.ground.testing.request import Requests
from rtshcua.ground.testing.situation import Said, Situations
from rtshcua.model.flat.limits import MAX_DURATION
from rtshcua.model.flat.situation import Context as Standing
from rtshcua.model.flat.situation import Now
from rtshcua.model.ir.places import VehicleDecl
from rtshcua.model.ir.policies import PolicyDecl
from rtshcua.model.ir.skills import ArgumentValue
from rtshcua.model.ir.tests import Answer, Expectation, Named, Request, Row, Subject, TestDecl

#: what validation and dispatch are taken to need, in us: what is assumed on board until enough was measured
REMAINING_US = 20_000
#: the moment of every decision, monotonic, in us: so that all that was before it has a time of its own
AT_US = MAX_DURATION

Lower = Callable[[PolicyDecl, VehicleDecl], Tested | None]


class _Under:
    """What is kept for all tests under one policy."""

    def __init__(self, context: Context, policy: Tested, names: Mapping[str, str]) -> None:
        self.policy = policy
        self.requests = Requests(context, policy, names)
        self.situations = Situations(context, policy)


def cases_of(context: Context, lower: Lower, names: Mapping[str, str]) -> Iterator[Case]:
    """The cases of the tests in `context`, which were checked; without those in which something is found.

    `lower` gives a policy for a vehicle, `names` what files are called in what is signed.
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
    """The cases of one test."""

    def __init__(self, context: Context, under: _Under, test: TestDecl, request: Request, start: Start) -> None:
        self._context = context
        self._under = under
        self._test = test
        self._request = request
        self._start = start
        premises = test.premises, start.nominal.premises
        self._given = [Said(each.subject, each.cell, each.span) for held in reversed(premises) for each in held.given]
        self._released = next((held.released.value for held in premises if held.released is not None), 0)
        self._issue = next((held.issued for held in premises if held.issued is not None), None)

    def made(self) -> Iterator[Case]:
        """One case for each row, or the only one."""
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
        row: Row | None,
    ) -> Case | None:
        under, start = self._under, self._start
        assert start.instant is not None
        said, arguments = list(self._given), []
        for column, cell in zip(columns, () if row is None else row.cells, strict=True):
            if isinstance(column, Named) and column.name.text not in self._context.symbols.signals:
                assert cell.value is not None
                arguments.append(ArgumentValue(span=cell.span, name=column.name, value=cell.value))
            else:
                said.append(Said(column, cell, column.span))
        within = start.instant.within
        now = Now(AT_US, start.instant.utc_us, 0 if within is None else within.value)
        distance = 0 if self._issue is None else self._issue.distance.value
        issued_at_us = now.utc_us + (distance if self._issue is not None and self._issue.ahead else -distance)
        invocation = under.requests.of(self._test, self._request, start, arguments, issued_at_us)
        if invocation is None:
            return None
        before = len(self._context.report.found)
        state = under.situations.state(said, now)
        standing = self._standing(invocation)
        self._not_given(invocation, said)
        quoted = quoted_clauses(self._context, expected, invocation, under.policy)
        errors = self._context.report.found[before:]
        if any(found.code.severity is codes.Severity.ERROR for found in errors):
            return None
        phases = tuple(each.text for each in start.order)
        return Case(
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
        """Where the mission stands: as the request would have it, but for what the test says."""
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

    def _not_given(self, invocation: PreparedInvocation, said: list[Said]) -> None:
        """Warn of signals that are unknown because nothing says what they are."""
        missing = self._under.situations.missing((slot for slot, _ in invocation.reads), said)
        if missing:
            are = "it is unknown" if len(missing) == 1 else "they are unknown"
            self._context.report.add(
                codes.NOT_GIVEN,
                self._request.skill.span,
                f"a decision on `{self._request.skill.text}` reads {listed(missing)}, and nothing gives "
                f"{'it' if len(missing) == 1 else 'them'}: {are}",
                help=f"add to the nominal or the test what it is, or say so: `given {missing[0]} = unknown`",
                labels=[(self._start.nominal.name.span, "the test starts from here")],
            )


def _numbered(answers: Sequence[Answer]) -> dict[tuple[str, int], Answer]:
    """Answers by the role, and which of its people it is."""
    found: dict[tuple[str, int], Answer] = {}
    for answer in answers:
        found[answer.role.text, (answer.role.text, 0) in found] = answer
    return found
