"""Whether one difference between two policies makes the newer one stricter or looser, as far as intervals decide it.

Each difference is judged by itself: stricter means that everything that passes now also passed before. Conditions are
compared as conjunctions of bounds on one signal or argument each; all other parts must be equal on both sides. In all
other cases the result is `CANNOT_TELL`.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from rtshcua.ground.versions.differences import Difference, Fields, PolicyMeaning, RuleMeaning
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.policy import AfterSilence, Policy, RuleKind
from rtshcua.model.flat.zone import CIRCLE, Zone

STRICTER, LOOSER, CANNOT_TELL = "stricter", "looser", "cannot tell"

#: the bounds of a comparison with an integer: whether the bound is an upper one, and its offset from the constant
_BOUNDS: Final = {Op.LE: ((True, 0),), Op.LT: ((True, -1),), Op.GE: ((False, 0),), Op.GT: ((False, 1),),
                  Op.EQ: ((True, 0), (False, 0))}  # fmt: skip
#: fields of which less is stricter. Not `energy` and `lasts`: with less of them a step may begin with less charge, or
#: later in the active time of a zone
_LESS: Final = frozenset({"deadline", "stale"})
_CLAUSES: Final = frozenset({"require", "assume", "maintain"})


class Bound(NamedTuple):
    """A bound of a condition on one signal or argument: at most (`upper`) or at least a value."""

    subject: tuple[Any, ...]
    upper: bool
    value: int


def direction(one: Difference, old: Policy, new: Policy) -> str:
    """The direction of one difference: `STRICTER`, `LOOSER` or `CANNOT_TELL`."""
    common = {zone.name for zone in old.zones[: old.declared]} & {zone.name for zone in new.zones[: new.declared]}
    moved = old.projection != new.projection
    before, after = (PolicyMeaning(policy, frozenset(common), moved=moved) for policy in (old, new))
    match one.kind:
        case "sensor":
            return _stricter_if(one.name not in new.vehicle.without)
        case "rule":
            return _rule(_written(before, one.before), _written(after, one.after))
        case "airspace":
            return _airspace(before.airspace(), after.airspace())
        case "evidence":
            return _stricter_if(new.without_evidence <= old.without_evidence)
        case "silence":
            return _silence(old, new)
        case "vehicle":
            return _joined([_vehicle(field, old, new) for field in one.fields])
        case "zone":
            return _zone(one, old, new)
        case "skill":
            return _joined(_each(one.fields, before.skills().get(one.name), after.skills().get(one.name)))
        case "signal":
            return _joined(_each(one.fields, before.signals().get(one.name), after.signals().get(one.name)))
        case _:
            return CANNOT_TELL


def _joined(found: Sequence[str]) -> str:
    """The direction of several parts: their common one, or `CANNOT_TELL`."""
    return found[0] if found and len(set(found)) == 1 else CANNOT_TELL


def _stricter_if(stricter: bool) -> str:
    return STRICTER if stricter else LOOSER


def _towards(*, stricter: bool, looser: bool) -> str:
    return CANNOT_TELL if stricter is looser else _stricter_if(stricter)


def _turned(found: str) -> str:
    return {STRICTER: LOOSER, LOOSER: STRICTER}.get(found, found)


# ------------------------------------------------------------------------------------------ rules


def _written(meaning: PolicyMeaning, text: str) -> RuleMeaning | None:
    return next((each for each in meaning.rules() if text and each.text == text), None)


def _rule(old: RuleMeaning | None, new: RuleMeaning | None) -> str:
    kind = (new or old or RuleMeaning((), RuleKind.DEGRADE, frozenset(), "")).kind
    if kind == RuleKind.DEGRADE:  # its target may be safer or not
        return CANNOT_TELL
    if old is None or new is None:
        return _stricter_if((new is not None) is not (kind == RuleKind.PERMIT))
    wider = _wider(old.meaning, new.meaning)
    return _turned(wider) if kind != RuleKind.PERMIT else wider


def _wider(old: tuple[Any, ...], new: tuple[Any, ...]) -> str:
    """The direction of a rule that permits: `LOOSER` if it holds in more cases."""
    found = [
        _towards(stricter=_within(new[at], old[at]), looser=_within(old[at], new[at]))
        for at in (1, 2, 3)  # skills, roles, sources; an empty set means any
        if old[at] != new[at]
    ]
    if old[4] != new[4]:
        was, now = _conjunction(old[4] or ()), _conjunction(new[4] or ())
        found.append(_towards(stricter=_implies(now, was), looser=_implies(was, now)))
    if old[6] != new[6]:  # the second person of a `confirm`, whose direction the caller inverts
        found.append(CANNOT_TELL if old[6] and new[6] else _stricter_if(bool(old[6])))
    if (old[5], *old[7:]) != (new[5], *new[7:]):
        return CANNOT_TELL
    return _joined(found)


def _within(some: frozenset[Any], others: frozenset[Any]) -> bool:
    return not others or (bool(some) and some <= others)


# ------------------------------------------------------------------------------------------ conditions


def _conjunction(code: Iterable[tuple[Any, ...]]) -> tuple[Any, ...]:
    """The parts of a conjunction: bounds, and the code of other parts. Empty means always true."""
    stack: list[tuple[tuple[Any, ...], tuple[Any, ...]]] = []  # code, and its conjunction
    for step in code:
        op = step[0]
        if op in (Op.CONST, Op.SIGNAL, Op.ARGUMENT, Op.SIGNAL_IN, Op.ARGUMENT_IN, Op.KNOWN, Op.POSITION_IN,
                  Op.POSITION_IN_ARGUMENT, Op.ARGUMENT_POINT_IN, Op.TIME_IN, Op.WEEK_IN, Op.PHASE_IN,
                  Op.MONITOR):  # fmt: skip
            stack.append(((step,), ((step,),)))
            continue
        taken = 1 if op in (Op.SCALE, Op.NOT) else 2
        parts = stack[-taken:]
        del stack[-taken:]
        whole = (*(each for part, _ in parts for each in part), step)
        parted: tuple[Any, ...] = (whole,)
        if op == Op.AND:
            parted = tuple(each for _, part in parts for each in part)
        elif op in _BOUNDS and len(whole) == 3 and whole[1][0] == Op.CONST and whole[0][0] != Op.CONST:
            parted = tuple(Bound(whole[0], upper, whole[1][1] + by) for upper, by in _BOUNDS[op])
        stack.append((whole, parted))
    return stack[-1][1] if stack else ()


def _implies(some: tuple[Any, ...], others: tuple[Any, ...]) -> bool:
    return all(any(_narrower(one, other) for one in some) for other in others)


def _narrower(one: Any, other: Any) -> bool:
    if not isinstance(one, Bound) or not isinstance(other, Bound):
        return bool(one == other)
    if (one.subject, one.upper) != (other.subject, other.upper):
        return False
    return one.value <= other.value if one.upper else one.value >= other.value


# ------------------------------------------------------------------------------------------ the rest


def _airspace(old: Any, new: Any) -> str:
    if old is None or new is None:
        return _stricter_if(new is not None)
    was, now = (frozenset({*(("in", each) for each in side[0]), *(("out", each) for each in side[1])})
                for side in (old, new))  # fmt: skip
    return _towards(stricter=was <= now, looser=now <= was)


def _silence(old: Policy, new: Policy) -> str:
    found = []
    if old.silence_us != new.silence_us:
        found.append(_stricter_if(new.silence_us < old.silence_us))
    if old.after_silence != new.after_silence:
        found.append(_stricter_if(new.after_silence != AfterSilence.CONTINUE))
    return _joined(found)


def _vehicle(field: str, old: Policy, new: Policy) -> str:
    return _stricter_if(new.vehicle.reserve > old.vehicle.reserve) if field == "reserve" else CANNOT_TELL


def _each(fields: Sequence[str], old: Fields | None, new: Fields | None) -> list[str]:
    if old is None or new is None:
        return [CANNOT_TELL]  # the rules decide whether it may be used at all
    return [_field(field, old, new) for field in fields]


def _field(field: str, old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    was, now = old[field], new[field]
    if field == "grace":
        return _stricter_if(now < was)
    if field in _LESS:
        return _stricter_if(bool(now) and (not was or now < was))  # 0 is no limit
    if field in _CLAUSES:
        before, after = (tuple(each for code in side for each in _conjunction(code)) for side in (was, now))
        return _towards(stricter=_implies(after, before), looser=_implies(before, after))
    if field == "parameters":
        return _parameters(was, now)
    if field == "valid" and was[1] == now[1]:
        return _stricter_if(now[0] < was[0])
    return CANNOT_TELL


def _parameters(old: tuple[Any, ...], new: tuple[Any, ...]) -> str:
    """The direction of changed ranges, if the parameters are the same."""
    if [each[:4] for each in old] != [each[:4] for each in new]:
        return CANNOT_TELL
    found = []
    for was, now in zip(old, new, strict=True):
        if was == now:
            continue
        if was[5] != now[5] or was[4] is None or now[4] is None:
            return CANNOT_TELL
        (low, high), (other_low, other_high) = was[4], now[4]
        found.append(
            _towards(stricter=low <= other_low and other_high <= high, looser=other_low <= low and high <= other_high)
        )
    return _joined(found)


def _zone(one: Difference, old: Policy, new: Policy) -> str:
    """The direction of a changed zone, by its use in the airspace. A zone in conditions may be for or against a
    request, so its direction is unknown.
    """
    zones = [{zone.name: zone for zone in policy.zones[: policy.declared]} for policy in (old, new)]
    if one.name not in zones[0] or one.name not in zones[1] or any(_named(one.name, each) for each in (old, new)):
        return CANNOT_TELL
    uses = {_use(one.name, policy) for policy in (old, new)}
    if len(uses) != 1 or "" in uses:
        return CANNOT_TELL
    wider = _joined([_grown(field, zones[0][one.name], zones[1][one.name], old, new) for field in one.fields])
    return wider if uses == {"inside"} else _turned(wider)


def _use(name: str, policy: Policy) -> str:
    airspace = policy.airspace
    if airspace is None:
        return ""
    sides = ["inside"] * any(policy.zones[each].name == name for each in airspace.inside)
    sides += ["outside"] * any(policy.zones[each].name == name for each in airspace.outside)
    return sides[0] if len(sides) == 1 else ""


def _named(name: str, policy: Policy) -> bool:
    """Whether a condition uses the zone, by name or as an argument.

    A clause that the vehicle is inside an argument's zone does not count: like the airspace, it still holds if the zone
    grows.
    """
    word = re.compile(rf"\b{re.escape(name)}\b")
    clauses = [
        each for contract in policy.contracts for each in (*contract.require, *contract.assume, *contract.maintain)
    ]
    texts = (*(rule.text for rule in policy.rules), *(clause.text for clause in clauses))
    if any(word.search(text) for text in texts):
        return True
    rules = [rule.when.code[::3] for rule in policy.rules if rule.when is not None]
    turned = [clause.code[::3] for clause in clauses if Op.NOT in clause.code[::3]]
    return any(Op.POSITION_IN_ARGUMENT in ops for ops in (*rules, *turned))


def _grown(field: str, was: Zone, now: Zone, old: Policy, new: Policy) -> str:
    """The direction of a zone to stay inside of: `LOOSER` if it is larger."""
    match field:
        case "floor":
            return _stricter_if(now.floor >= was.floor)
        case "ceiling":
            return _stricter_if(now.ceiling <= was.ceiling)
        case "shape" if old.projection == new.projection and was.shape == now.shape == CIRCLE:
            if was.data[:2] == now.data[:2]:
                return _stricter_if(now.data[2] <= was.data[2])
    return CANNOT_TELL
