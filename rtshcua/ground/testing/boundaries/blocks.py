"""Blocks of cases for a scene and its limits."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from rtshcua.decision import tree
from rtshcua.ground.testing.boundaries import case_values
from rtshcua.ground.testing.boundaries.case_values import (
    always_tested,
    around,
    ordered,
    parameter_of,
    signal_of,
    variables,
    writable,
)
from rtshcua.ground.testing.boundaries.clause_limits import ClauseLimit
from rtshcua.ground.testing.boundaries.draft import Block, CaseRow
from rtshcua.ground.testing.boundaries.scene import TIME, PolicyPart, Scene, SceneChanges, SceneVariable, Value
from rtshcua.model.flat.contract import PLACE, SourceKind
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy

#: the clock error in the case with an inexact clock; us
_CLOCK_ERROR = 1_000_000


class CaseFrame(NamedTuple):
    """The data that the blocks about one skill and requester share: the scene, its changes of the nominal, the name of
    the nominal, and the phase if it differs from the nominal's. `label` is unique.
    """

    label: str
    scene: Scene
    made: SceneChanges
    nominal: str
    phase: str | None = None

    @property
    def policy(self) -> Policy:
        """The policy of the scene."""
        return self.scene.invocation.policy.policy


def tables(
    frame: CaseFrame, parts: Sequence[PolicyPart], limits: Iterable[ClauseLimit], bounds: Sequence[tuple[int, int]]
) -> Iterator[Block]:
    """Yield a table for each variable, and for each other situation in which the variable decides something.

    `bounds` are the ranges of the slots.
    """
    invocation = frame.scene.invocation
    grouped: dict[tuple[SceneVariable, tuple[tuple[SceneVariable, Value], ...]], list[ClauseLimit]] = {
        (variable, ()): [] for variable in variables(parts, invocation)
    }
    for limit in limits:
        if limit.variable != TIME:
            grouped.setdefault((limit.variable, limit.made), []).append(limit)
    for (variable, made), found in grouped.items():
        here = frame.made | dict(made)
        values = [value for limit in found for value in around(limit)]
        if not made:
            values += always_tested(variable, invocation)
            values += [_present(frame, variable)]
        cells = [
            _cell(frame, variable, value) for value in ordered(values) if writable(value, variable, invocation, bounds)
        ]
        cells += [] if made else _ages(frame, variable)
        rows = [CaseRow((cell,)) for cell in dict.fromkeys(cells) if cell is not None]
        name = name_of(frame, variable)
        if rows:
            yield block(frame, name, here, without=variable, comments=_comments(found), columns=(name,), rows=rows)


def _ages(frame: CaseFrame, variable: SceneVariable) -> list[str]:
    """The present value of a signal, at the greatest accepted age and just above it."""
    if variable.argument or variable.at is None:
        return []
    signal, value = signal_of(frame.policy, variable.at), _present(frame, variable)
    cell = None if value is None else case_values.signal_text(frame.policy, signal, value)
    ages = (signal.stale_us, signal.stale_us + 1)
    return [] if cell is None else [f"{cell} measured {case_values.duration_text(age)} ago" for age in ages]


def _present(frame: CaseFrame, variable: SceneVariable) -> Value:
    return frame.scene.place(variable) if _is_place(variable, frame) else frame.scene.value(variable)


def times(frame: CaseFrame, limits: Iterable[ClauseLimit]) -> Iterator[Block]:
    """Yield a test for each side of each limit in time, and one with an inexact clock."""
    for limit in limits:
        if limit.variable == TIME:
            for value in (limit.holds, limit.fails):
                assert isinstance(value, int)
                here = frame.made | dict(limit.made) | {TIME: value}
                yield block(frame, f"at {case_values.moment_text(value)}", here, comments=_comments([limit]))
            here = frame.made | dict(limit.made) | {TIME: limit.holds}
            within = f" within {case_values.duration_text(_CLOCK_ERROR)}"
            yield block(frame, "on a clock that may be wrong", here, comments=_comments([limit]), clock=within)


def stretches(frame: CaseFrame) -> Iterator[Block]:
    """Yield tests on both sides of the contract's deadline since the release and validity since the issue."""
    flat = frame.scene.invocation.invocation
    contract, remaining = flat.contract, frame.scene.context.remaining_us
    spare = contract.deadline_us - remaining
    for us in (spare, spare + 1) if spare >= 0 else (0,):
        ago = case_values.duration_text(us)
        premise = f"released {ago} ago"
        comment = f"deadline {case_values.duration_text(contract.deadline_us)}"
        yield block(frame, premise, frame.made, comments=(comment,), premises=(premise,))
    for us in (contract.validity_us, contract.validity_us + 1):
        premise = f"issued {case_values.duration_text(us)} ago"
        comment = f"valid for {case_values.duration_text(contract.validity_us)}"
        yield block(frame, premise, frame.made, comments=(comment,), premises=(premise,))


def phases(frame: CaseFrame) -> Iterator[Block]:
    """Yield a test before and one after the phases in which the skill is valid, and one for each phase of the rules."""
    valid = frame.scene.invocation.invocation.contract.phases
    if valid:
        first = valid[0]
        yield block(frame, "in an earlier phase", frame.made, phase=f"phase earlier of earlier, {first}")
        yield block(frame, "in a later phase", frame.made, phase=f"phase later of {first}, later")
    for name in frame.policy.phases:
        if not valid or name in valid:
            yield block(frame, f"in the phase {name}", frame.made, phase=f"phase {name} of {name}")


def over_time(frame: CaseFrame, parts: Sequence[PolicyPart]) -> Iterator[Block]:
    """Yield a table for each condition over time that a part reads, with a row for each truth."""
    read = {atom.monitor for part in parts for atom in part.atoms if isinstance(atom, tree.MonitorSays)}
    for number in sorted(read):
        column = f"({case_values.monitor_text(frame.policy.monitors[number])})"
        rows = [CaseRow((truth,)) for truth in case_values.TRUTHS.values()]
        yield block(frame, f"over time {number + 1}", frame.made, columns=(column,), rows=rows)


def answers(frame: CaseFrame, limits: Iterable[ClauseLimit]) -> Iterator[Block]:
    """Yield tests of a request that a person must confirm: approved, refused, and not answered in time."""
    policy = frame.policy
    for limit in limits:
        if limit.part.role != "confirm" or limit.variable == TIME:
            continue
        rule = next(each.rule for each in frame.scene.invocation.candidates.confirms if each.rule is limit.part.clause)
        here = frame.made | dict(limit.made) | {limit.variable: limit.holds}
        role, comments = policy.roles[rule.approver], _comments([limit])
        for word in ("approved", "refused"):
            premises = [f"{word} by role {role}"]
            if rule.second != -1:
                premises.append(f"approved by role {policy.roles[rule.second]}")
            yield block(frame, ", ".join(premises), here, comments=comments, premises=tuple(premises))
        for us in (rule.within_us, rule.within_us + 1):
            ago = f"released {case_values.duration_text(us)} ago"
            yield block(frame, f"not answered, {ago}", here, comments=comments, premises=(ago,))
        return


def block(
    frame: CaseFrame,
    about: str,
    made: SceneChanges,
    *,
    without: SceneVariable | None = None,
    comments: tuple[str, ...] = (),
    premises: tuple[str, ...] = (),
    columns: tuple[str, ...] = (),
    rows: list[CaseRow] | None = None,
    clock: str = "",
    phase: str | None = None,
) -> Block:
    """Make a block in the frame's scene, with some values changed from the nominal."""
    where = phase or frame.phase
    scene = frame.scene.with_all({key: value for key, value in made.items() if key != without and key != TIME})
    given: list[str] = []
    for variable, value in made.items():
        if not variable.argument and variable not in (TIME, without):
            cell = _cell(frame, variable, value)
            given += [] if cell is None else [f"{name_of(frame, variable)} = {cell}"]
    lines = [f"given {', '.join(given)}"] if given else []
    if TIME in made:
        moment = made[TIME]
        assert isinstance(moment, int)
        lines.append(f'at "{case_values.moment_text(moment)}"{clock}')
    return Block(
        title=f"{frame.label}: {about}",
        nominal=frame.nominal,
        request=request(scene.invocation.invocation, frame, without),
        comments=comments,
        premises=(*([where] if where else []), *lines, *premises),
        columns=columns,
        rows=rows or [CaseRow()],
    )


def request(flat: Invocation, frame: CaseFrame, without: SceneVariable | None = None) -> str:
    """The text of the request after `when`."""
    policy, contract = frame.policy, flat.contract
    arguments: list[str] = []
    for parameter in contract.parameters:
        if without != SceneVariable(True, parameter.cell):
            cells = flat.arguments[parameter.cell : parameter.cell + 2]
            value: Value = (cells[0], cells[1]) if _is_place(SceneVariable(True, parameter.cell), frame) else cells[0]
            arguments.append(f"{parameter.name} = {case_values.argument_text(policy, parameter, value)}")
    source = SourceKind(flat.source).name.lower()
    return f"{contract.name}({', '.join(arguments)}) by role {policy.roles[flat.role]} through {source}"


def name_of(frame: CaseFrame, variable: SceneVariable) -> str:
    """The name of a variable."""
    assert variable.at is not None
    if variable.argument:
        return parameter_of(frame.scene.invocation, variable.at).name
    return signal_of(frame.policy, variable.at).name


def _is_place(variable: SceneVariable, frame: CaseFrame) -> bool:
    assert variable.at is not None
    if variable.argument:
        return parameter_of(frame.scene.invocation, variable.at).kind == PLACE
    return variable.at == frame.policy.vehicle.position


def _cell(frame: CaseFrame, variable: SceneVariable, value: Value) -> str | None:
    assert variable.at is not None
    if variable.argument:
        return case_values.argument_text(frame.policy, parameter_of(frame.scene.invocation, variable.at), value)
    return case_values.signal_text(frame.policy, signal_of(frame.policy, variable.at), value)


def _comments(limits: Iterable[ClauseLimit]) -> tuple[str, ...]:
    """The clauses of the limits, each once."""
    return tuple(dict.fromkeys(f"{limit.part.role}: {limit.part.text}" for limit in limits))
