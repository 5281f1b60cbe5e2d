"""What a box rules out by itself: sums against their parts, and zones against each other."""

from rtshcua.decision.values import FALSE, TRUE, Truth, Value
from rtshcua.ground.analysis.box import VEHICLE, Box, Form, clipped
from rtshcua.ground.analysis.plane import Plane

#: how often sums and parts tighten each other; bounds that creep are left to the search
_ROUNDS = 6


def narrow(box: Box, plane: Plane) -> bool:
    """Tighten a box in place; False where nothing is in it."""
    return _sums(box) and _zones(box, plane)


def _sums(box: Box) -> bool:
    if not box.forms:
        return True
    for _ in range(_ROUNDS):
        changed = False
        for form in box.forms:
            if any(box.cells[term.argument, term.at][2] for term in form):
                continue  # a sum that may be missing says nothing of its parts
            outcome = _tighten(box, form)
            if outcome is None:
                return False
            changed = changed or outcome
        if not changed:
            break
    return True


def _tighten(box: Box, form: Form) -> bool | None:
    """Whether anything became smaller; None where nothing is left."""
    ends = [_ends(box.cells[term.argument, term.at], term.factor) for term in form]
    low, high = sum(end[0] for end in ends), sum(end[1] for end in ends)
    value = clipped(box.forms[form], low, high)
    if value is None:
        return None
    changed = value is not box.forms[form]
    box.forms[form] = value
    for term, (least, most) in zip(form, ends, strict=True):
        # factor * part = sum - others
        lowest, highest = value[0] - (high - most), value[1] - (low - least)
        if term.factor < 0:
            lowest, highest = -highest, -lowest
        size = abs(term.factor)
        cell = (term.argument, term.at)
        part = clipped(box.cells[cell], -(-lowest // size), highest // size)
        if part is None:
            return None
        changed = changed or part is not box.cells[cell]
        box.cells[cell] = part
    return changed


def _ends(value: Value, factor: int) -> tuple[int, int]:
    return (factor * value[0], factor * value[1]) if factor > 0 else (factor * value[1], factor * value[0])


def _zones(box: Box, plane: Plane) -> bool:
    """Follow the sides that are decided: within one, within all around it and outside all apart from it."""
    waiting = [key for key, side in box.sides.items() if side in (TRUE, FALSE)]
    if len(box.sides) < 2:
        return True
    while waiting:
        who, zone = waiting.pop()
        if who == VEHICLE and box.located:
            continue
        inside = box.sides[who, zone] == TRUE
        for (other_who, other), side in list(box.sides.items()):
            if other_who != who or other == zone:
                continue
            implied = _implied(plane, zone, other, inside=inside)
            if implied and not side & implied:
                return False
            if implied and implied != side:
                box.sides[who, other] = implied
                waiting.append((who, other))
    return True


def _implied(plane: Plane, zone: int, other: int, *, inside: bool) -> Truth:
    """On which side of another zone a place inside, or outside, of a zone must be; 0: on any."""
    if not inside:
        return FALSE if plane.within(other, zone) else 0
    if plane.within(zone, other):
        return TRUE
    return FALSE if plane.apart(zone, other) else 0
