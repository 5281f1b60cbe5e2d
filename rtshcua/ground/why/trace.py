"""The trace of a decision: what each step of design 4.1 checked and found, which step decided, and the values that a
condition read, by name.

The trace runs the same steps and conditions as `decide`; it has no rules of its own.
"""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.decision.contracts import longest
from rtshcua.decision.decide import PASS, decide, steps
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.fallbacks import link_admissible
from rtshcua.decision.nearest import Nearest, nearest
from rtshcua.decision.prepare import Guards, PreparedInvocation, PreparedPolicy
from rtshcua.decision.situation import environment, ranging, situation
from rtshcua.decision.values import EVERYWHERE, Truth
from rtshcua.model.decision import Decision, Decisive
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import Airspace, Policy, Rule
from rtshcua.model.flat.signal import POSITION, Signal
from rtshcua.model.flat.situation import Context, Now, State


class ReadValue(NamedTuple):
    """A signal with its cells (None: no valid value), or an argument of the request; `stale` if too old."""

    name: str
    signal: Signal | None
    values: tuple[int | None, ...]
    stale: bool


def read_values(
    clause: Decisive, policy: Policy, contract: Contract, arguments: tuple[int, ...], state: State
) -> list[ReadValue]:
    """Return the signals and arguments that a clause reads, each once, in the order of the clause."""
    found: dict[str, ReadValue] = {}
    code = _code(clause)
    for at in range(0, len(code), 3):
        op, a = code[at], code[at + 1]
        if op in (Op.SIGNAL, Op.SIGNAL_IN, Op.KNOWN):
            _note_signal(found, a, policy, state)
        elif op in (Op.ARGUMENT, Op.ARGUMENT_IN, Op.ARGUMENT_POINT_IN):
            _note_argument(found, a, contract, arguments)
        elif op in (Op.POSITION_IN, Op.POSITION_IN_ARGUMENT):
            _note_place(found, policy, state)
            if op == Op.POSITION_IN_ARGUMENT:
                _note_argument(found, a, contract, arguments)
        elif op == Op.MONITOR:
            for read in read_values(policy.monitors[a].when, policy, contract, arguments, state):
                found.setdefault(read.name, read)
    if isinstance(clause, Airspace):
        _note_place(found, policy, state)
    return list(found.values())


def _code(clause: Decisive) -> tuple[int, ...]:
    if isinstance(clause, Rule):
        return () if clause.when is None else clause.when.code
    return clause.code if isinstance(clause, Clause) else ()


def _note_place(found: dict[str, ReadValue], policy: Policy, state: State) -> None:
    for slot in (policy.vehicle.position, policy.vehicle.height):
        if slot != -1:
            _note_signal(found, slot, policy, state)


def _note_signal(found: dict[str, ReadValue], slot: int, policy: Policy, state: State) -> None:
    signal = next(each for each in policy.signals if slot - _width(each) < each.slot <= slot)
    slot, width = signal.slot, _width(signal)
    stale = max(state.ages[slot : slot + width]) > signal.stale_us
    found.setdefault(signal.name, ReadValue(signal.name, signal, state.values[slot : slot + width], stale))


def _width(signal: Signal) -> int:
    return 2 if signal.kind == POSITION else 1


def _note_argument(found: dict[str, ReadValue], cell: int, contract: Contract, arguments: tuple[int, ...]) -> None:
    parameter = next(each for each in contract.parameters if each.cell == cell)
    found.setdefault(parameter.name, ReadValue(parameter.name, None, arguments[cell : cell + 1], False))


#: the numbers and names of the steps of design 4.1, in order
NAMES = (
    ("1", "integrity"),
    ("2", "freshness"),
    ("3", "authority"),
    ("3b", "confirmation"),
    ("4", "phase"),
    ("5", "timing"),
    ("6", "state"),
    ("7", "safety"),
)


class ConditionCheck(NamedTuple):
    """A condition that a step checked: its role, its clause (None: a field), and its truth."""

    role: str
    clause: Decisive
    truth: Truth


class TracedStep(NamedTuple):
    """A step. `passed` is None if an earlier step decided, so that this one was not reached."""

    number: str
    name: str
    passed: bool | None
    checks: tuple[ConditionCheck, ...]


class TriedLink(NamedTuple):
    """A link of the fallback chain, and whether it may fly now."""

    text: str
    admissible: bool


class Trace(NamedTuple):
    """A decision, its steps, the links of the fallback chain, and the nearest values that would have passed."""

    decision: Decision
    steps: tuple[TracedStep, ...]
    chain: tuple[TriedLink, ...]
    nearest: tuple[Nearest, ...]


def trace(invocation: PreparedInvocation, state: State, policy: PreparedPolicy, context: Context, now: Now) -> Trace:
    """Return the decision with its trace. Pure and total, like `decide`."""
    decision = decide(invocation, state, policy, context, now)
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    traced: list[TracedStep] = []
    decided = False
    found = steps(invocation, policy, context, sets, at, exact=True)
    for number, name in NAMES:
        if decided:
            traced.append(TracedStep(number, name, None, ()))
            continue
        decided = next(found)[1][0] is not PASS
        traced.append(TracedStep(number, name, not decided, tuple(_checks(name, invocation, at))))
    chain = tuple(TriedLink(link.link.text, link_admissible(link, state, policy, now)) for link in invocation.chain)
    return Trace(decision, tuple(traced), chain, nearest(decision, invocation, state, policy, now))


def _checks(step: str, invocation: PreparedInvocation, at: Environment) -> Iterator[ConditionCheck]:
    """Yield the conditions of a step, in the order in which it checks them."""
    candidates = invocation.candidates
    if step == "authority":
        for rule in (*candidates.forbids, *candidates.permits):
            yield ConditionCheck("forbid" if rule in candidates.forbids else "permit", rule.rule, rule.condition(at))
    elif step == "confirmation":
        for rule in candidates.confirms:
            yield ConditionCheck("confirm", rule.rule, rule.condition(at))
    elif step == "state":
        yield from _clauses("require", invocation.require, at)
        yield from _clauses("assume", invocation.assume, at)
    elif step == "safety":
        yield from _safety(invocation, at)


def _clauses(role: str, guards: Guards, at: Environment) -> Iterator[ConditionCheck]:
    for clause, condition in guards:
        yield ConditionCheck(role, clause, EVERYWHERE[condition(at)])


def _safety(invocation: PreparedInvocation, at: Environment) -> Iterator[ConditionCheck]:
    policy = invocation.policy
    known = policy.tables.known
    volume = invocation.planner.volume(at.slots, known)
    through = longest(invocation.invocation.contract, policy.policy.vehicle)
    if policy.airspace is not None:
        yield ConditionCheck(
            "airspace", policy.airspace.airspace, EVERYWHERE[policy.airspace.keeps(volume.place, at, through)]
        )
    yield from _clauses("maintain", invocation.maintain, ranging(at, volume, known.height, through))
    enough = invocation.energy.suffices(at.slots[known.battery], volume, at.slots[known.drain])
    yield ConditionCheck("energy", None, EVERYWHERE[enough])
    for rule in invocation.candidates.degrades:
        yield ConditionCheck("degrade", rule.rule, rule.condition(at))
