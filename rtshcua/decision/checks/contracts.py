"""Checks of skill contracts, their clauses and the links of chains. The contract in a mission must equal the policy's
or be stricter (design 5).
"""

from collections import Counter
from collections.abc import Iterator

from rtshcua.decision.checks.emission_numbers import emission
from rtshcua.decision.checks.indexes import at, index, within
from rtshcua.decision.checks.zones import place
from rtshcua.decision.contracts import cells, first_cell, misfit
from rtshcua.decision.durability import recorded_as
from rtshcua.decision.tree import CodeScope, parse, slots_read
from rtshcua.model.durability import BUFFERED, WORDS
from rtshcua.model.flat import limits
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import (
    CHOICE,
    PLACE,
    QUANTITY,
    ZONE,
    Contract,
    Facing,
    Link,
    MotionKind,
    Parameter,
    TimingClass,
)
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import HIGHEST, LOWEST


def clause(clause: Clause, scope: CodeScope) -> Iterator[str]:
    """Yield the problem of a clause's code, if it has one."""
    node = parse(clause.code, scope)
    if isinstance(node, str):
        yield node


def contract(contract: Contract, policy: Policy, scope: CodeScope) -> Iterator[str]:
    """Yield the problems of a contract. `chain` checks its links, because they refer to other contracts."""
    yield from _parameters(contract, policy)
    yield from _motion(contract)
    yield from within("timing class", contract.timing_class, TimingClass.SEMANTIC, TimingClass.REFLEX)
    for name, duration in (
        ("deadline", contract.deadline_us),
        ("validity", contract.validity_us),
        ("duration", contract.duration_us),
        ("grace", contract.grace_us),
    ):
        yield from within(name, duration, 0, limits.MAX_DURATION)
    yield from within("energy", contract.energy, 0, limits.FULL)
    yield from _record(contract)
    yield from within("number of commands to payload", len(contract.emits), 0, limits.MAX_EMISSIONS)
    for number, emitted in enumerate(contract.emits):
        yield from at(f"emits {number}", emission(emitted, contract, policy.vehicle))
    about = scope.about(contract)
    for name, clauses in (
        ("require", contract.require),
        ("assume", contract.assume),
        ("maintain", contract.maintain),
    ):
        yield from within(f"number of {name} clauses", len(clauses), 0, limits.MAX_CLAUSES)
        for number, one in enumerate(clauses):
            yield from at(f"{name} {number}", clause(one, about))
    clauses = (*contract.require, *contract.assume, *contract.maintain)
    if contract.reads != slots_read(clauses, policy.vehicle, policy.monitors):
        yield "`reads` differs from what the clauses read"


def _record(contract: Contract) -> Iterator[str]:
    """A record may be `buffered` (lost if the process crashes) only for reflex skills, which have no time to wait for
    it.
    """
    written = [word for word in contract.record if word in WORDS]
    if len(written) > 1:
        yield f"recorded as both `{written[0]}` and `{written[1]}`"
    if WORDS[BUFFERED] in written and contract.timing_class != TimingClass.REFLEX:
        yield f"`record {WORDS[BUFFERED]}` is only allowed for reflex skills"


def _parameters(contract: Contract, policy: Policy) -> Iterator[str]:
    yield from within("number of parameters", len(contract.parameters), 0, limits.MAX_PARAMETERS)
    cell = 0
    for parameter in contract.parameters:
        if parameter.cell != cell:
            yield f"parameter `{parameter.name}`: cell {parameter.cell} is out of sequence; expected {cell}"
        yield from at(f"parameter `{parameter.name}`", _parameter(parameter, policy))
        cell += 2 if parameter.kind == PLACE else 1
    yield from within("number of cells", cell, 0, limits.MAX_CELLS)


def _parameter(parameter: Parameter, policy: Policy) -> Iterator[str]:
    yield from within("kind", parameter.kind, QUANTITY, PLACE)
    yield from within("low bound", parameter.low, -limits.MAX_VALUE, limits.MAX_VALUE)
    yield from within("high bound", parameter.high, parameter.low, limits.MAX_VALUE)
    if parameter.kind == CHOICE:
        yield from index("label", parameter.low, len(parameter.labels))
        yield from index("label", parameter.high, len(parameter.labels))
    elif parameter.kind == ZONE:
        yield from index("declared zone", parameter.low, policy.declared)
        yield from index("declared zone", parameter.high, policy.declared)


def _motion(contract: Contract) -> Iterator[str]:
    kinds = {parameter.cell: parameter.kind for parameter in contract.parameters}
    motion = contract.motion
    yield from within("motion", motion.kind, MotionKind.HOLD, MotionKind.LAND)
    named = (
        ("altitude", motion.altitude), ("speed", motion.speed), ("time", motion.time), ("lowest height", motion.lowest),
    )  # fmt: skip
    for name, cell in named:
        if cell != -1 and kinds.get(cell) != QUANTITY:
            yield f"motion: argument cell {cell} is not a {name}"
    yield from within("facing", motion.facing, Facing.ALONG, Facing.INWARD)
    if motion.kind != MotionKind.COVER and (motion.lowest, motion.facing) != (-1, Facing.ALONG):
        yield "motion: only a skill that covers a zone has several heights or faces inward"
    if motion.kind in (MotionKind.CLIMB, MotionKind.FLY, MotionKind.COVER) and motion.altitude == -1:
        yield "motion: a skill that moves the vehicle needs an altitude"
    if motion.kind == MotionKind.FLY and PLACE not in kinds.values():
        yield "motion: a skill that flies to a place needs a place argument"
    if motion.kind == MotionKind.COVER and list(kinds.values()).count(ZONE) != 1:
        yield "motion: a skill that covers a zone needs exactly one zone argument"


def arguments(values: tuple[int, ...], contract: Contract) -> Iterator[str]:
    """Yield the problems of a call's arguments."""
    if len(values) != cells(contract):
        yield f"{len(values)} argument cells; the contract has {cells(contract)}"
    found = misfit(values, contract)
    if found is not None:
        yield f"argument `{found.name}` is out of range"


def chain(links: tuple[Link, ...], policy: Policy) -> Iterator[str]:
    """Yield the problems of a chain's links. The contracts must be well-formed."""
    yield from within("number of links", len(links), 0, limits.MAX_LINKS)
    for number, one in enumerate(links):
        yield from at(f"link {number}", link(one, policy))


def link(link: Link, policy: Policy) -> Iterator[str]:
    """Yield the problems of a link, which must be a complete call of a skill that needs no survey path."""
    yield from index("skill", link.skill, len(policy.contracts))
    called = policy.contracts[link.skill]
    if called.motion.kind == MotionKind.COVER:
        yield "a link cannot call a skill that covers a zone, because links carry no path"
    yield from arguments(link.arguments, called)
    yield from within("limit", link.limit_us, 0, limits.MAX_DURATION)
    motion = called.motion
    for name, cell, low, high in (
        ("altitude", motion.altitude, LOWEST, HIGHEST),
        ("speed", motion.speed, 0, policy.vehicle.speed),
    ):
        if cell != -1:
            yield from within(name, link.arguments[cell], low, high)
    if motion.kind == MotionKind.FLY:
        cell = first_cell(called, PLACE)
        yield from place(policy.projection, link.arguments[cell], link.arguments[cell + 1])


def tightens(mine: Contract, policys: Contract) -> Iterator[str]:
    """Yield each field in which a mission's contract is looser than the policy's. A duration of 0 is unlimited."""
    for name, same in (
        ("name", mine.name == policys.name),
        ("motion", mine.motion == policys.motion),
        ("timing class", mine.timing_class == policys.timing_class),
        ("fallback", _calls(mine.fallback) == _calls(policys.fallback)),
        ("emits", mine.emits == policys.emits),
        ("parameters", _same_parameters(mine, policys)),
        ("phases", not policys.phases or (bool(mine.phases) and set(mine.phases) <= set(policys.phases))),
        ("deadline", mine.deadline_us <= policys.deadline_us),
        ("validity", mine.validity_us <= policys.validity_us),
        ("duration", not policys.duration_us or 0 < mine.duration_us <= policys.duration_us),
        ("grace", mine.grace_us <= policys.grace_us),
        ("energy", mine.energy >= policys.energy),
        ("require", _codes(mine.require) >= _codes(policys.require)),
        ("assume", _codes(mine.assume) >= _codes(policys.assume)),
        ("maintain", _codes(mine.maintain) >= _codes(policys.maintain)),
        ("record", {*mine.record, *WORDS} >= set(policys.record)),
        ("durability", recorded_as(mine.record) >= recorded_as(policys.record)),
    ):
        if not same:
            yield f"`{name}` is looser than in the policy"
    codes: dict[str, set[tuple[int, ...]]] = {}
    for one in (*policys.require, *policys.assume, *policys.maintain):
        codes.setdefault(one_line(one.text), set()).add(one.code)
    for one in (*mine.require, *mine.assume, *mine.maintain):
        if one.code not in codes.get(one_line(one.text), {one.code}) and not is_cut(one.text):
            yield posing(one)


def one_line(text: str) -> str:
    """A text with its white space collapsed, as it is displayed."""
    return " ".join(text.split())


def is_cut(text: str) -> bool:
    """Whether a text is an abbreviation, so that other texts may share its beginning."""
    return len(text) == limits.MAX_TEXT and text.endswith("...")


def posing(one: Clause) -> str:
    """Yield each clause of the mission's own that could be mistaken for a clause of the policy."""
    return f"clause `{one_line(one.text)}` has the text of a policy clause but different code"


# logs and their readers identify a clause by its text, so a policy clause must have the policy's text
def _calls(links: tuple[Link, ...]) -> list[tuple[int, tuple[int, ...], int, str]]:
    return [(link.skill, link.arguments, link.limit_us, link.text) for link in links]


def _codes(clauses: tuple[Clause, ...]) -> Counter[tuple[tuple[int, ...], str]]:
    return Counter((clause.code, clause.text) for clause in clauses)


def _same_parameters(mine: Contract, policys: Contract) -> bool:
    """Whether the parameters are the same and no range is wider."""
    return len(mine.parameters) == len(policys.parameters) and all(
        (a.name, a.kind, a.dimension, a.cell, a.labels) == (b.name, b.kind, b.dimension, b.cell, b.labels)
        and b.low <= a.low
        and a.high <= b.high
        for a, b in zip(mine.parameters, policys.parameters, strict=True)
    )
