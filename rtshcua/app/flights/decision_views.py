"""The decisions of a flight in words: what decided, what it read, and what would have passed."""

from collections.abc import Iterable
from typing import Final

from rtshcua.app.documents import recorded_replacement
from rtshcua.app.flights.clause_places import ClausePlaces
from rtshcua.app.logged_decision import LinkExplained, StepExplained, explained
from rtshcua.app.prepared_mission import Subject, after
from rtshcua.app.telling import prose
from rtshcua.app.telling.people import People
from rtshcua.app.telling.record_prose import Names
from rtshcua.decision.values import TRUE
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.records import DecisionRecord, Effect
from rtshcua.ground.editor.keyword_help import REASONS
from rtshcua.ground.flight.flight_content import DecisionView, ReadSignal
from rtshcua.ground.why.logged_decisions import context_of, state_of
from rtshcua.ground.why.trace import read_values
from rtshcua.model.decision import Decisive
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import Policy, Rule
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.onboard.calls import argument
from rtshcua.wire.request import Ref

#: the most decisions that are explained in full
MOST_EXPLAINED: Final = 300
#: the most values of a decision that are told
_MOST_READ: Final = 20


class DecisionViews:
    """Collects the decisions of a log; equal ones in a row, such as those while a step waits, are one."""

    def __init__(self, subject: Subject, names: Names, places: ClausePlaces) -> None:
        self._subject, self._names = subject, names
        #: the sources of steps from a number on: those of the bundle, and of each replacement
        self._sources = [(0, places)]
        self._told: list[DecisionView] = []
        self._last: tuple[object, ...] = ()
        self._ref: Ref | None = None  # what the last decision is about
        self._explained = 0
        #: how many decisions are told without what they read
        self.unexplained = 0

    @property
    def views(self) -> tuple[DecisionView, ...]:
        """The decisions in words, in order."""
        return tuple(self._told)

    def take(self, record: DecisionRecord | Effect, t_us: int) -> None:
        """Take the next record, at a time since the first one, after `Names.follow`."""
        if isinstance(record, Effect):
            if record.event == "replacement":
                self._replace(record)
            elif record.event == "repeated" and self._ref == record.ref and record.detail.isdecimal():
                last = self._told[-1]
                self._told[-1] = last._replace(repeats=last.repeats + int(record.detail[:9]), until_us=t_us)
            return
        key = (record.kind, record.step, record.link, record.outcome, record.reason, record.clause, record.target)
        if key == self._last and record.outcome != "allow":
            last = self._told[-1]
            self._told[-1] = last._replace(repeats=last.repeats + 1, until_us=t_us)
            return
        self._last, self._ref = key, record.ref
        self._told.append(self._view(record, t_us))

    def _replace(self, record: Effect) -> None:
        newer = after(self._subject, record.detail)
        if isinstance(newer, Refusal):
            return  # which verification names
        kept = recorded_replacement(record.detail).kept
        self._sources.append(
            (kept, self._sources[0][1].of_mission(newer.mission.sources, newer.mission.source_digests))
        )
        self._subject = newer

    def _place(self, step: int, source: int, start: int) -> str:
        places = next(places for first, places in reversed(self._sources) if first <= max(step, 0))
        return places.place(source, start)

    def _view(self, record: DecisionRecord, t_us: int) -> DecisionView:
        clause = "" if record.clause is None else _quoted(record.clause)
        place = "" if record.clause_at is None else self._place(record.step, *record.clause_at[:2])
        view = DecisionView(
            record.seq, t_us, t_us, 1, self._names.subject(record.kind, record.step, record.link), record.outcome,
            record.reason, _meaning(record.reason), clause, place, record.target or "", (), (), (),
            self._approvals(record), None,
        )  # fmt: skip
        if self._explained >= MOST_EXPLAINED:
            self.unexplained += 1
            return view
        self._explained += 1
        found = explained(record, self._subject)
        if isinstance(found, StepExplained):
            return self._of_step(view, record, found)
        return self._of_link(view, record, found) if isinstance(found, LinkExplained) else view

    def _of_step(self, view: DecisionView, record: DecisionRecord, found: StepExplained) -> DecisionView:
        trace, flat = found.trace, found.invocation.invocation
        decisive = trace.decision.clause
        checked: list[Decisive] = [each.clause for step in trace.steps for each in step.checks]
        view = view._replace(
            clause=prose.quoted(self._policy, flat, decisive) or view.clause,
            reads=self._reads(record, [decisive] if decisive is not None else checked, flat.contract, flat.arguments),
            would_pass=tuple(map(prose.would_pass, trace.nearest)),
        )
        permit = _permit(found)
        return view if permit is None else self._because(view, record, permit)

    def _of_link(self, view: DecisionView, record: DecisionRecord, found: LinkExplained) -> DecisionView:
        """A decision on a link: the `degrade` rule whose target it is, or else what its skill requires."""
        trace, link = found.trace, found.trace.link.link
        view = view._replace(
            flies=prose.link(self._policy, link),
            chain=tuple(f"{each.text}: {'may fly' if each.admissible else 'may not'}" for each in trace.chain),
        )
        if trace.rule is not None and found.of is not None:
            flat = found.of.invocation
            reads = self._reads(record, [trace.rule], flat.contract, flat.arguments)
            return self._because(view._replace(reads=reads), record, trace.rule)
        required = [each.clause for each in trace.checks]
        return view._replace(reads=self._reads(record, required, self._policy.contracts[link.skill], link.arguments))

    def _because(self, view: DecisionView, record: DecisionRecord, rule: Rule) -> DecisionView:
        return view._replace(clause=_quoted(rule.text), place=self._place(record.step, rule.source, rule.start))

    @property
    def _policy(self) -> Policy:
        return self._subject.policy.policy

    def _reads(
        self, record: DecisionRecord, clauses: Iterable[Decisive], contract: Contract, arguments: tuple[int, ...]
    ) -> tuple[ReadSignal, ...]:
        """The signals and arguments that clauses read, with their values in the record."""
        state = state_of(record)
        told: dict[str, ReadSignal] = {}
        for clause in clauses:
            for read in read_values(clause, self._policy, contract, arguments, state):
                if read.signal is not None:
                    age = max(state.ages[slot] for slot in read.signal.slots)
                    told.setdefault(read.name, ReadSignal(read.name, prose.read_value(self._policy, read), age))
                else:
                    parameter = next(each for each in contract.parameters if each.name == read.name)
                    value = argument(self._policy, parameter, arguments)
                    told.setdefault(read.name, ReadSignal(read.name, value, None))
        return tuple(told.values())[:_MOST_READ]

    def _approvals(self, record: DecisionRecord) -> tuple[str, ...]:
        people: People = self._names.people
        roles = self._policy.roles
        told = []
        for each in context_of(record).approvals:
            role = roles[each.role] if 0 <= each.role < len(roles) else f"role {each.role}"
            by = people.by_number.get(each.person)
            told.append(f"{'granted' if each.granted else 'refused'} as `{role}`{f' by `{by}`' if by else ''}")
        return tuple(dict.fromkeys(told))


def _permit(found: StepExplained) -> Rule | None:
    """The rule that permitted an allowed step."""
    if found.trace.decision.outcome is not Outcome.ALLOW:
        return None
    checks = (check for step in found.trace.steps for check in step.checks)
    return next((each.clause for each in checks
                 if each.role == "permit" and each.truth == TRUE and isinstance(each.clause, Rule)), None)  # fmt: skip


def _quoted(text: str) -> str:
    return f"`{' '.join(text.split())}`"


def _meaning(reason: str) -> str:
    try:
        return REASONS[Reason(reason)]
    except ValueError:
        return ""
