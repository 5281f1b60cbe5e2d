"""In what two policies differ, in a few words each, what matters most first."""

from collections.abc import Iterator, Mapping

from rtshcua.ground.versions.meaning import Fields, Meaning, Written
from rtshcua.model.flat.policy import Policy, RuleKind

#: so much of a rule's text is quoted
_QUOTED = 60


def differences(old: Policy, new: Policy) -> tuple[str, ...]:
    """What `new` says otherwise than `old`; nothing where both mean the same. Versions and names do not count."""
    zones = frozenset(zone.name for zone in old.zones[: old.declared])
    common = zones & {zone.name for zone in new.zones[: new.declared]}
    moved = old.projection != new.projection
    return tuple(_differences(Meaning(old, common, moved=moved), Meaning(new, common, moved=moved)))


def _differences(old: Meaning, new: Meaning) -> Iterator[str]:
    yield from _rules(old.rules(), new.rules())
    if old.airspace() != new.airspace():
        yield "the airspace"
    if old.contingency() != new.contingency():
        yield "the contingency"
    if old.without_evidence() != new.without_evidence():
        yield "what is done without evidence"
    vehicle = _fields(old.vehicle(), new.vehicle())
    if vehicle:
        yield f"the vehicle ({vehicle})"
    yield from _named("zone", old.zones(), new.zones())
    yield from _named("skill", old.skills(), new.skills())
    yield from _named("signal", old.signals(), new.signals())


def _named(what: str, old: Mapping[str, Fields], new: Mapping[str, Fields]) -> Iterator[str]:
    for name, fields in new.items():
        if name not in old:
            yield f"the new {what} `{name}`"
        elif fields != old[name]:
            yield f"the {what} `{name}` ({_fields(old[name], fields)})"
    for name in old:
        if name not in new:
            yield f"the {what} `{name}`, which is gone"


def _fields(old: Fields, new: Fields) -> str:
    return ", ".join(name for name, value in new.items() if value != old[name])


def _rules(old: tuple[Written, ...], new: tuple[Written, ...]) -> Iterator[str]:
    gone, more = _without(old, new), _without(new, old)
    for rule in more:
        before = next((each for each in gone if each.kind == rule.kind and _alike(each, rule)), None)
        if before is not None:
            gone.remove(before)
        yield f"the {'new ' if before is None else ''}rule `{_quoted(rule)}`"
    for rule in gone:
        yield f"the rule `{_quoted(rule)}`, which is gone"
    for kind in (RuleKind.CONFIRM, RuleKind.DEGRADE):  # of these the first that holds decides
        order = [[rule.meaning for rule in rules if rule.kind == kind] for rules in (old, new)]
        if not more and not gone and order[0] != order[1]:
            yield f"the order of its `{kind.name.lower()}` rules"


def _without(rules: tuple[Written, ...], others: tuple[Written, ...]) -> list[Written]:
    """The rules whose meaning none of the others has; one that is written twice says no more than once."""
    known = {rule.meaning for rule in others}
    return [rule for rule in rules if rule.meaning not in known]


def _alike(one: Written, other: Written) -> bool:
    return one.skills == other.skills or not one.skills.isdisjoint(other.skills)


def _quoted(rule: Written) -> str:
    return rule.text if len(rule.text) <= _QUOTED else f"{rule.text[: _QUOTED - 3]}..."
