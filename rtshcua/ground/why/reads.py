"""What a condition read: the signals and arguments that its code names, with the values that they had."""

from typing import NamedTuple

from rtshcua.model.decision import Decisive
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.contract import Contract
from rtshcua.model.flat.policy import Airspace, Policy, Rule
from rtshcua.model.flat.signal import POSITION, Signal
from rtshcua.model.flat.situation import State


class Read(NamedTuple):
    """A signal with the cells that it owns (None: nothing valid), or an argument of the request; stale if too old."""

    name: str
    signal: Signal | None
    values: tuple[int | None, ...]
    stale: bool


def reads(clause: Decisive, policy: Policy, contract: Contract, arguments: tuple[int, ...], state: State) -> list[Read]:
    """Signals and arguments in the order in which they are named, each once."""
    found: dict[str, Read] = {}
    code = _code(clause)
    for at in range(0, len(code), 3):
        op, a = code[at], code[at + 1]
        if op in (Op.SIGNAL, Op.SIGNAL_IN, Op.KNOWN):
            _signal(found, a, policy, state)
        elif op in (Op.ARGUMENT, Op.ARGUMENT_IN, Op.ARGUMENT_POINT_IN):
            _argument(found, a, contract, arguments)
        elif op in (Op.POSITION_IN, Op.POSITION_IN_ARGUMENT):
            _where(found, policy, state)
            if op == Op.POSITION_IN_ARGUMENT:
                _argument(found, a, contract, arguments)
        elif op == Op.MONITOR:
            for read in reads(policy.monitors[a].when, policy, contract, arguments, state):
                found.setdefault(read.name, read)
    if isinstance(clause, Airspace):
        _where(found, policy, state)
    return list(found.values())


def _code(clause: Decisive) -> tuple[int, ...]:
    if isinstance(clause, Rule):
        return () if clause.when is None else clause.when.code
    return clause.code if isinstance(clause, Clause) else ()


def _where(found: dict[str, Read], policy: Policy, state: State) -> None:
    for slot in (policy.vehicle.position, policy.vehicle.height):
        if slot != -1:
            _signal(found, slot, policy, state)


def _signal(found: dict[str, Read], slot: int, policy: Policy, state: State) -> None:
    signal = next(each for each in policy.signals if slot - _width(each) < each.slot <= slot)
    slot, width = signal.slot, _width(signal)
    stale = max(state.ages[slot : slot + width]) > signal.stale_us
    found.setdefault(signal.name, Read(signal.name, signal, state.values[slot : slot + width], stale))


def _width(signal: Signal) -> int:
    return 2 if signal.kind == POSITION else 1


def _argument(found: dict[str, Read], cell: int, contract: Contract, arguments: tuple[int, ...]) -> None:
    parameter = next(each for each in contract.parameters if each.cell == cell)
    found.setdefault(parameter.name, Read(parameter.name, None, arguments[cell : cell + 1], False))
