"""What a policy says otherwise than an earlier one: by name, so that a page can mark it."""

from collections.abc import Mapping
from dataclasses import dataclass

from rtshcua.ground.report.model import ChangeTold
from rtshcua.ground.report.words.differences import told_difference
from rtshcua.ground.versions.differences import compared
from rtshcua.ground.versions.direction import direction
from rtshcua.ground.versions.meaning import Fields, Meaning
from rtshcua.model.flat.policy import Policy


@dataclass(frozen=True, slots=True)
class Changes:
    """In words, and which zones, skills, signals and rules (by their number) are new or other than before."""

    told: tuple[ChangeTold, ...] = ()
    zones: frozenset[str] = frozenset()
    skills: frozenset[str] = frozenset()
    signals: frozenset[str] = frozenset()
    rules: frozenset[int] = frozenset()


def told_changes(old: Policy, new: Policy) -> tuple[ChangeTold, ...]:
    """What differs, in words, and which way each goes."""
    return tuple(
        ChangeTold(each.told.removeprefix("looser: "), *told_difference(each, old, new), direction(each, old, new))
        for each in compared(old, new)
    )


def changes(old: Policy, new: Policy) -> Changes:
    """What differs in meaning, as `check --since` counts it."""
    common = frozenset(zone.name for zone in old.zones[: old.declared])
    common &= {zone.name for zone in new.zones[: new.declared]}
    moved = old.projection != new.projection
    before, after = Meaning(old, common, moved=moved), Meaning(new, common, moved=moved)
    known = {rule.meaning for rule in before.rules()}
    return Changes(
        told_changes(old, new),
        _changed(before.zones(), after.zones()),
        _changed(before.skills(), after.skills()),
        _changed(before.signals(), after.signals()),
        frozenset(number for number, rule in enumerate(after.rules()) if rule.meaning not in known),
    )


def _changed(old: Mapping[str, Fields], new: Mapping[str, Fields]) -> frozenset[str]:
    return frozenset(name for name, fields in new.items() if old.get(name) != fields)
