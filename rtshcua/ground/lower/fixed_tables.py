"""Lower conditions under a signed policy, whose tables cannot grow.

The conditions may only read signals that the policy reads, and use its zones, sets and monitors.
"""

from collections.abc import Iterator
from copy import deepcopy
from typing import Any, NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.diagnostics.suggest import listed
from rtshcua.ground.checker.conditions import references
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.lower.conditions import ConditionLowering, ConditionPlace
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.lower.tables import SourceTable
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Monitor, MonitorKind, Policy
from rtshcua.model.ir.expression import Condition
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.places import ENTRY
from rtshcua.model.quantity import Dimension, display


class MissingFromPolicy(NamedTuple):
    """A need of a condition that the policy does not meet: its span, a description, and what the policy has instead."""

    span: Span
    need: str
    available: str


class FixedTables:
    """Lowers conditions under one policy, with the source places of `files`."""

    def __init__(self, context: CheckContext, under: LoweredPolicy, files: SourceTable) -> None:
        self._context = context
        self._under = under
        self._files = files
        self._copy: ConditionLowering | None = None

    def clause(
        self, condition: Condition, place: ConditionPlace, span: Span
    ) -> Clause | list[MissingFromPolicy] | None:
        """Lower a condition, or return its needs that the policy does not meet; None after a finding."""
        unread, sound = self._unread(condition)
        if unread or not sound:
            return unread or None
        if self._copy is None:
            self._copy = _copy(self._context, self._under, self._files)
        before = len(self._context.report.found)
        lowered = self._copy.clause(condition, place)
        lacking = next(_lacking(self._copy, self._under.policy), None)
        if lacking is not None:
            self._copy = None  # discard the additions to the copy
        if len(self._context.report.found) > before:
            return None
        return lowered if lacking is None else [MissingFromPolicy(span, *lacking)]

    def _unread(self, condition: Condition) -> tuple[list[MissingFromPolicy], bool]:
        """Return the signals of a condition that the policy does not read, and whether it has all the zones.

        Reports each missing zone.
        """
        context, under = self._context, self._under
        signals = {signal.name for signal in under.policy.signals}
        unread, sound = list[MissingFromPolicy](), True
        for reference in references(condition):
            zone = reference.name.removesuffix(ENTRY)
            if reference.name in context.symbols.signals and reference.name not in signals:
                need = f"reads the signal `{reference.name}`, which the policy does not read"
                unread.append(MissingFromPolicy(reference.span, need, _signals(under.policy)))
            elif zone in context.symbols.zones:
                sound &= knows_zone(context, under, Name(span=reference.span, text=zone))
        return unread, sound


def knows_zone(context: CheckContext, under: LoweredPolicy, zone: Name) -> bool:
    """Whether a policy has a declared zone. Reports it otherwise."""
    if zone.text in under.zones.index:
        return True
    context.report.add(
        codes.NOT_IN_POLICY,
        zone.span,
        f"the policy `{under.policy.name}` does not import the zone `{zone.text}`",
        help="its zones are " + ", ".join(f"`{name}`" for name in under.zones.index),
        labels=[(context.symbols.zones[zone.text].name.span, "declared here")],
    )
    return False


def _copy(context: CheckContext, under: LoweredPolicy, files: SourceTable) -> ConditionLowering:
    """Return a copy of the policy's tables, to which conditions may add entries."""
    # `deepcopy` does not copy the objects in `memo`
    memo: dict[int, Any] = {id(each): each for each in (context, context.report, context.symbols)}
    memo[id(under.files)] = files
    return deepcopy(under.conditions, memo)


def _lacking(copy: ConditionLowering, policy: Policy) -> Iterator[tuple[str, str]]:
    """Yield descriptions of entries that a lowering added to the tables, each with what the policy has instead."""
    if copy.slots.count > policy.slots:
        yield "reads a signal that the policy does not read", _signals(policy)
    if len(copy.zones.flat()) > len(policy.zones) or len(copy.zones.tables) > len(policy.tables):
        grown = listed(dict.fromkeys(zone.name for zone in policy.zones[len(copy.zones.index) :]))
        yield "needs a grown zone that the policy does not have", f"it has {grown or 'none'}"
    if len(copy.sets.phases) > len(policy.phases):
        yield "names a phase that no condition of the policy names", f"they name {listed(policy.phases) or 'none'}"
    if len(copy.sets.all) > len(policy.sets):
        yield "needs a set of values that no condition of the policy has", "compare a single value with `==`"
    if len(copy.monitors.all) > len(policy.monitors):
        monitored = listed(dict.fromkeys(_window(monitor) for monitor in policy.monitors))
        yield "needs a temporal condition that the policy does not monitor", f"it monitors {monitored or 'none'}"


def _signals(policy: Policy) -> str:
    return f"it reads {listed(signal.name for signal in policy.signals)}"


def _window(monitor: Monitor) -> str:
    """Format a temporal condition as in sources."""
    operator = {
        MonitorKind.FOR_LAST: "for the last",
        MonitorKind.WITHIN_LAST: "within the last",
    }.get(MonitorKind(monitor.kind))
    if operator is None:
        return f"{MonitorKind(monitor.kind).name.lower()} {monitor.when.text}"
    return f"{monitor.when.text} {operator} {display(monitor.window_us, Dimension.DURATION)}"
