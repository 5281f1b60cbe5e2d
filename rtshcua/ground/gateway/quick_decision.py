"""Decide at once on a step that a client asks for: by `decide` itself, in the state that was seen last.

Only a certain refusal is answered here. What would be allowed, or waits for a person, is compiled and signed, and
decided on board. A temporal monitor needs the history of the state, which is not kept here: a step that one of its
truths would let pass is not refused. The time that is left before the deadline is not counted either.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from rtshcua.decision.decide import decide, possible
from rtshcua.decision.evaluate import Condition, Environment, build
from rtshcua.decision.nearest import DAYTIME, LOCAL_TIME, ChangeSearch, Nearest, NearestChange, Offer, nearest, offer
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy, PreparedRule, prepare_invocation
from rtshcua.decision.situation import environment, situation
from rtshcua.decision.times import local_time
from rtshcua.decision.tree import Both, Node, PointInside
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.analysis.plane import nearest_inside
from rtshcua.ground.gateway.interface import GatewaySettings, ProposedStep
from rtshcua.ground.gateway.translation import degrees
from rtshcua.ground.lower.mission import straight_plan
from rtshcua.ground.why.trace import read_values
from rtshcua.mavlink.command_results import DENIED, TEMPORARILY_REJECTED
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import Contract, SourceKind
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.mission import Invocation, OnInadmissible
from rtshcua.model.flat.policy import Airspace
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.flat.zone import unproject
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.model.quantity import Dimension, display

#: reasons that only time or a person resolves: these steps are decided on board
_NOT_HERE: Final = frozenset(
    {Reason.AWAITING_APPROVAL, Reason.CLOCK_UNCERTAIN, Reason.PHASE_NOT_REACHED, Reason.NO_SLACK}
)
_DIMENSIONS: Final = {each.value: each for each in Dimension}
_MINUTE: Final = 60_000_000
#: the phase of a step whose contract names none; a name that no policy needs to know
_PHASE: Final = "flight"
#: how many rules may move a nearest value on
_ROUNDS: Final = 3
#: the most characters of a clause in an answer
_CLAUSE: Final = 100
#: how far from the edge of a zone the nearest accepted place is looked for, mm
_MARGINS_MM: Final = (1_000, 5_000, 15_000)


class QuickRefusal(NamedTuple):
    """A MAV_RESULT, the slug of the reason, the skill, the reason in words, and whether other arguments might pass."""

    result: int
    reason: str
    skill: str
    words: str
    by_argument: bool = False

    @property
    def text(self) -> str:
        """The answer to a client that asked for the step."""
        return f"{self.skill} {'denied' if self.result == DENIED else 'rejected'}: {self.words}"


class QuickDecision:
    """Decides under the policy of one gateway."""

    def __init__(self, settings: GatewaySettings) -> None:
        self._policy = settings.policy
        self._state_of = settings.state_of
        self._margins: dict[int, int] = {}  # by zone
        self._conjuncts: dict[int, list[tuple[Node, Condition]]] = {}  # by rule
        policy = settings.policy.policy
        self._skills = {contract.name: number for number, contract in enumerate(policy.contracts)}
        self._roles = {role: number for number, role in enumerate(policy.roles)}

    def refusal(self, step: ProposedStep, role: str, now: Now) -> QuickRefusal | None:
        """Why a step is certainly refused now; None if it may pass, or is not decided here."""
        flat = self._policy.policy
        if role not in self._roles:
            words = f"no rule of {flat.name} names the role {role}"
            return QuickRefusal(DENIED, Reason.NOT_PERMITTED, step.skill, words)
        invocation = self._prepared(step, role, now)
        if isinstance(invocation, Refusal):
            return QuickRefusal(DENIED, Reason.ARGUMENT_RANGE, step.skill, invocation.text, True)
        context = Context(b"", flat.vehicle.identity, flat.version, 0, now.monotonic_us, 0, 0, ())
        state = self._state_of(now)
        decision = decide(invocation, state, self._policy, context, now)
        if decision.outcome is Outcome.ALLOW or decision.reason in _NOT_HERE:
            return None
        if flat.monitors and not self._is_certain(invocation, state, context, now):
            return None
        near = nearest(decision, invocation, state, self._policy, now)
        near = self._accepted(near, step, role, context, state, now)
        out_of_scope = decision.reason is Reason.OUT_OF_SCOPE and not near
        unmet = self._unmet(step, role, invocation, context, state, now) if out_of_scope else []
        words = (
            f"{'; '.join(unmet)} ({decision.reason})"
            if unmet
            else _words(decision, near, invocation, state, self._policy, now)
        )
        parameters = {each.name for each in flat.contracts[self._skills[step.skill]].parameters}
        by_argument = bool(near) and all(each.subject in parameters for each in near)
        result = DENIED if decision.outcome is Outcome.DENY else TEMPORARILY_REJECTED
        return QuickRefusal(result, decision.reason, step.skill, words, by_argument)

    def _accepted(
        self, near: tuple[Nearest, ...], step: ProposedStep, role: str, context: Context, state: State, now: Now
    ) -> tuple[Nearest, ...]:
        """The nearest value of one argument, moved on while another rule refuses that value too."""
        contract = self._policy.policy.contracts[self._skills[step.skill]]
        cells = {each.name: each.cell for each in contract.parameters}
        tried = near
        for _ in range(_ROUNDS):
            if len(tried) != 1 or tried[0].subject not in cells or tried[0].choices:
                return near
            near, values = tried, list(step.values)
            values[cells[near[0].subject]] = near[0].value
            moved = self._prepared(step._replace(values=tuple(values)), role, now)
            if isinstance(moved, Refusal):
                return near
            decision = decide(moved, state, self._policy, context, now)
            tried = nearest(decision, moved, state, self._policy, now)
            if [each.subject for each in tried] != [each.subject for each in near]:
                return near
        return near

    def _unmet(
        self, step: ProposedStep, role: str, invocation: PreparedInvocation, context: Context, state: State, now: Now
    ) -> list[str]:
        """Each condition of a permit that does not hold, with the nearest accepted value; none if that is not known for
        one of them. Of several permits, that with the fewest such conditions counts.
        """
        policy, contract = self._policy, invocation.invocation.contract
        at = environment(situation(state, policy, now), policy, invocation.arguments, invocation.phase)
        conditions = self._failed(invocation, at)
        found, values = list[str](), list(step.values)
        places = [each for each in conditions if isinstance(each, PointInside)]
        for condition in (each for each in conditions if each not in places):
            changes = self._changes(condition, contract, at)
            if not changes:
                return []
            for subject, near in changes:
                found.append(f"{_found(near, invocation, state, policy, now)}, accepted {_value(near)}")
                if subject.argument and subject.at is not None:
                    values[subject.at] = near.value
        for each in places:
            place = self._inside(each, step._replace(values=tuple(values)), role, context, state, now)
            name = next(one.name for one in contract.parameters if one.cell == each.cell)
            zone = policy.policy.zones[each.zone].name
            found.insert(0, f"{name} outside {zone}" + ("" if place is None else f", nearest accepted {place}"))
        return found

    def _changes(self, condition: Node, contract: Contract, at: Environment) -> list[tuple[NearestChange, Nearest]]:
        """The changes of values with which a condition holds, made together; none if no such changes are known."""
        changes = ChangeSearch(at, self._policy.tables).find(condition, True) or ()
        offers = [offer(each, contract, self._policy.policy, at) for each in changes]
        return [(each.change, _nearest_of(each)) for each in offers] if all(each.options for each in offers) else []

    def _failed(self, invocation: PreparedInvocation, at: Environment) -> list[Node]:
        """The conditions that do not hold, of the permit that has the fewest."""
        rules = (self._joined(permit) for permit in invocation.candidates.permits if permit.rule.when is not None)
        failed = ([node for node, holds in rule if holds(at) != TRUE] for rule in rules)
        return min(failed, key=len, default=[])

    def _joined(self, permit: PreparedRule) -> list[tuple[Node, Condition]]:
        """The conditions that the condition of a permit joins by `and`, each also compiled, on first use."""
        found = self._conjuncts.get(permit.number)
        if found is None:
            when, tables = self._policy.compiler.when(permit.rule), self._policy.tables
            nodes = () if when is None else _conjuncts(when)
            found = self._conjuncts[permit.number] = [(node, build(node, tables)) for node in nodes]
        return found

    def _inside(
        self, condition: PointInside, step: ProposedStep, role: str, context: Context, state: State, now: Now
    ) -> str | None:
        """The nearest place in a zone, so far from its edge that the step may be permitted; None if none is known."""
        flat, cell, values = self._policy.policy, condition.cell, list(step.values)
        there = values[cell], values[cell + 1]
        kept = self._margins.get(condition.zone)  # what was enough for another place is tried first
        for margin_mm in _MARGINS_MM if kept is None else (kept, *(each for each in _MARGINS_MM if each != kept)):
            place = nearest_inside(flat.zones[condition.zone], there, margin_mm)
            if place is None:
                return None
            values[cell : cell + 2] = place
            moved = self._prepared(step._replace(values=tuple(values)), role, now)
            if not isinstance(moved, Refusal):
                decision = decide(moved, state, self._policy, context, now)
                if decision.outcome is Outcome.ALLOW or decision.reason in _NOT_HERE:
                    self._margins[condition.zone] = margin_mm
                    latitude, longitude = unproject(flat.projection, *place)
                    return f"{degrees(latitude, 'NS')}, {degrees(longitude, 'EW')}"
        return None

    def _is_certain(self, invocation: PreparedInvocation, state: State, context: Context, now: Now) -> bool:
        """Whether it is refused whatever the temporal monitors remember."""
        sets = situation(state, self._policy, now)
        anything = sets._replace(monitors=(TRUE | FALSE | UNKNOWN,) * len(self._policy.monitors))
        found = possible(invocation, anything, self._policy, context)
        return all(each.outcome is not Outcome.ALLOW and each.reason not in _NOT_HERE for each in found)

    def _prepared(self, step: ProposedStep, role: str, now: Now) -> PreparedInvocation | Refusal:
        skill = self._skills[step.skill]
        contract = self._policy.policy.contracts[skill]
        phases = (contract.phases[0] if contract.phases else _PHASE,)
        invocation = Invocation(
            invocation_id=b"",
            step=0,
            phase=0,
            skill=skill,
            source=SourceKind.AGENT,
            role=self._roles[role],
            arguments=step.values,
            issued_at_us=now.utc_us - now.utc_error_us,  # certainly in the past
            phases=1,
            on_inadmissible=OnInadmissible.ABORT,
            contract=contract,
            plan=straight_plan(contract, step.values),
            text="",
            file=0,
            start=0,
            end=0,
            binding=b"",
        )
        return prepare_invocation(invocation, self._policy, phases)


def _nearest_of(offer: Offer) -> Nearest:
    names = tuple(name for _, name in offer.options if name)
    return Nearest(offer.subject, offer.dimension, offer.options[0][0], names)


def _conjuncts(node: Node) -> Iterator[Node]:
    """The conditions that a condition joins by `and`."""
    if isinstance(node, Both):
        yield from _conjuncts(node.left)
        yield from _conjuncts(node.right)
    else:
        yield node


def _words(
    decision: Decision,
    near: tuple[Nearest, ...],
    invocation: PreparedInvocation,
    state: State,
    policy: PreparedPolicy,
    now: Now,
) -> str:
    """What decided: what was found and what would be accepted, then the reason."""
    if near:
        found = [f"{_found(each, invocation, state, policy, now)}, accepted {_value(each)}" for each in near]
    else:
        found = list(_without_nearest(decision, invocation, state, policy, now))
    return f"{'; '.join(found)} ({decision.reason})"


def _without_nearest(
    decision: Decision, invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now
) -> Iterator[str]:
    flat, clause = policy.policy, decision.clause
    if isinstance(clause, Airspace):
        yield from _left_zones(invocation, state, policy, now)
    if decision.reason is Reason.NOT_PERMITTED:
        yield f"the role {flat.roles[invocation.invocation.role]} may not"
    if decision.outcome is Outcome.DEFER:
        yield from _unknown(decision, invocation, state, policy)
    if clause is not None:
        text = " ".join(clause.text.split())
        if decision.reason is Reason.OUT_OF_SCOPE and " when " in text:
            text = "only when " + text.partition(" when ")[2]  # first what counts: some clients show 50 characters
        yield text if len(text) <= _CLAUSE else f"{text[: _CLAUSE - 3]}..."


def _left_zones(invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now) -> Iterator[str]:
    """The zones of the airspace that the planned path leaves or enters."""
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    place = invocation.planner.volume(at.slots, policy.tables.known).place
    airspace = policy.airspace
    if airspace is not None:
        names = [zone.name for zone in policy.policy.zones]
        yield from (f"leaves {names[each.number]}" for each in airspace.inside if place.inside(each) & FALSE)
        yield from (f"enters {names[each.number]}" for each in airspace.outside if place.inside(each) & TRUE)


def _unknown(decision: Decision, invocation: PreparedInvocation, state: State, policy: PreparedPolicy) -> Iterator[str]:
    """The signals without a fresh value that the deciding clause reads; without one, those that any step needs."""
    flat, contract = policy.policy, invocation.invocation.contract
    if decision.clause is None:
        stale = {slot for slot, (most, _) in enumerate(policy.limits) if state.ages[slot] > most}
        reads = {slot for slot, _ in invocation.reads if state.values[slot] is None or slot in stale}
        names = [each.name for each in flat.signals if not reads.isdisjoint(each.slots)]
    else:
        read = read_values(decision.clause, flat, contract, invocation.invocation.arguments, state)
        names = [each.name for each in read if each.signal is not None and (None in each.values or each.stale)]
    if names:
        yield f"{', '.join(names)} unknown"


def _found(near: Nearest, invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now) -> str:
    """The present value of what would have to change."""
    flat = invocation.invocation
    for parameter in flat.contract.parameters:
        if parameter.name == near.subject:
            return f"{near.subject} {_shown(flat.arguments[parameter.cell], near.dimension)}"
    if near.subject == LOCAL_TIME:
        moment = now.utc_us + local_time(policy.policy.vehicle).offset(now.utc_us)
        return f"time {_shown(moment % DAY, DAYTIME)}"
    signal = next(each for each in policy.policy.signals if each.name == near.subject)
    value = state.values[signal.slot]
    if value is None:
        return f"{near.subject} unknown"
    return f"{near.subject} {dict(signal.labels).get(value) or _shown(value, near.dimension)}"


def _value(near: Nearest) -> str:
    return " or ".join(near.choices) if near.choices else _shown(near.value, near.dimension)


def _shown(value: int, dimension: str) -> str:
    if dimension == DAYTIME:
        return f"{value // _MINUTE // 60:02}:{value // _MINUTE % 60:02}"
    known = _DIMENSIONS.get(dimension)
    return str(value) if known is None else display(value, known)
