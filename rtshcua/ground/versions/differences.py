"""In what two policies differ, in a few words each, what matters most first."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from rtshcua.ground.versions.meaning import Fields, Meaning, Written
from rtshcua.model.flat.policy import Policy, RuleKind

#: so much of a rule's text is quoted
_QUOTED = 60


class Difference(NamedTuple):
    """One thing that differs: in a few words, and what it is (`rule`, `order`, `airspace`, `contingency`, `evidence`,
    `silence`, `sensor`, `vehicle`, `zone`, `skill`, `signal`).

    A `rule` has its texts, empty where there is none; what has fields has its name, and which of them differ: all of
    them, where it is new or gone.
    """

    told: str
    what: str
    name: str = ""
    fields: tuple[str, ...] = ()
    before: str = ""
    after: str = ""


def differences(old: Policy, new: Policy) -> tuple[str, ...]:
    """What `new` says otherwise than `old`, in a few words each."""
    return tuple(each.told for each in compared(old, new))


def compared(old: Policy, new: Policy) -> tuple[Difference, ...]:
    """What `new` says otherwise than `old`; nothing where both mean the same. Versions and names do not count."""
    zones = frozenset(zone.name for zone in old.zones[: old.declared])
    common = zones & {zone.name for zone in new.zones[: new.declared]}
    moved = old.projection != new.projection
    return tuple(_differences(Meaning(old, common, moved=moved), Meaning(new, common, moved=moved)))


def _differences(old: Meaning, new: Meaning) -> Iterator[Difference]:
    # what is no longer watched comes first: a finding tells of few differences
    for name in sorted(new.without() - old.without()):
        words = f"looser: the vehicle is now without the signal `{name}`, and clauses `where fitted` on it are left out"
        yield Difference(words, "sensor", name)
    for name in sorted(old.without() - new.without()):
        yield Difference(f"the vehicle is no longer without the signal `{name}`", "sensor", name)
    yield from _rules(old.rules(), new.rules())
    if old.airspace() != new.airspace():
        yield Difference("the airspace", "airspace")
    if old.contingency() != new.contingency():
        yield Difference("the contingency", "contingency")
    if old.without_evidence() != new.without_evidence():
        yield Difference("what is done without evidence", "evidence")
    if old.without_link() != new.without_link():
        yield Difference("what flies after a silence of the vehicle", "silence")
    vehicle = _fields(old.vehicle(), new.vehicle())
    if vehicle:
        yield Difference(f"the vehicle ({', '.join(vehicle)})", "vehicle", fields=vehicle)
    yield from _named("zone", old.zones(), new.zones())
    yield from _named("skill", old.skills(), new.skills())
    yield from _named("signal", old.signals(), new.signals())


def _named(what: str, old: Mapping[str, Fields], new: Mapping[str, Fields]) -> Iterator[Difference]:
    for name, fields in new.items():
        if name not in old:
            yield Difference(f"the new {what} `{name}`", what, name, tuple(fields))
        elif fields != old[name]:
            differ = _fields(old[name], fields)
            yield Difference(f"the {what} `{name}` ({', '.join(differ)})", what, name, differ)
    for name, fields in old.items():
        if name not in new:
            yield Difference(f"the {what} `{name}`, which is gone", what, name, tuple(fields))


def _fields(old: Fields, new: Fields) -> tuple[str, ...]:
    return tuple(name for name, value in new.items() if value != old[name])


def _rules(old: tuple[Written, ...], new: tuple[Written, ...]) -> Iterator[Difference]:
    gone, more = _without(old, new), _without(new, old)
    for rule in more:
        before = next((each for each in gone if each.kind == rule.kind and _alike(each, rule)), None)
        if before is not None:
            gone.remove(before)
        told = f"the {'new ' if before is None else ''}rule `{_quoted(rule)}`"
        yield Difference(told, "rule", before="" if before is None else before.text, after=rule.text)
    for rule in gone:
        yield Difference(f"the rule `{_quoted(rule)}`, which is gone", "rule", before=rule.text)
    for kind in (RuleKind.CONFIRM, RuleKind.DEGRADE):  # of these the first that holds decides
        order = [[rule.meaning for rule in rules if rule.kind == kind] for rules in (old, new)]
        if not more and not gone and order[0] != order[1]:
            yield Difference(f"the order of its `{kind.name.lower()}` rules", "order", kind.name.lower())


def _without(rules: tuple[Written, ...], others: tuple[Written, ...]) -> list[Written]:
    """The rules whose meaning none of the others has; one that is written twice says no more than once."""
    known = {rule.meaning for rule in others}
    return [rule for rule in rules if rule.meaning not in known]


def _alike(one: Written, other: Written) -> bool:
    return one.skills == other.skills or not one.skills.isdisjoint(other.skills)


def _quoted(rule: Written) -> str:
    text = " ".join(rule.text.split())
    return text if len(text) <= _QUOTED else f"{text[: _QUOTED - 3]}..."
