"""A mission may only tighten: its copy of a contract is the policy's, or stricter (design 5)."""

from collections import Counter
from collections.abc import Iterator

from rtshcua.decision.durability import recorded_as
from rtshcua.model.durability import WORDS
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, Link


def tightens(mine: Contract, policys: Contract) -> Iterator[str]:
    """Where a mission's contract is looser than the policy's; no duration (0) is no limit, so looser than any."""
    for name, same in (
        ("name", mine.name == policys.name),
        ("motion", mine.motion == policys.motion),
        ("timing class", mine.timing_class == policys.timing_class),
        ("fallback", _calls(mine.fallback) == _calls(policys.fallback)),
        ("parameters", _parameters(mine, policys)),
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


def _calls(links: tuple[Link, ...]) -> list[tuple[int, tuple[int, ...], int]]:
    return [(link.skill, link.arguments, link.limit_us) for link in links]


def _codes(clauses: tuple[Clause, ...]) -> Counter[tuple[int, ...]]:
    return Counter(clause.code for clause in clauses)


def _parameters(mine: Contract, policys: Contract) -> bool:
    """The same parameters, in ranges that are not wider."""
    return len(mine.parameters) == len(policys.parameters) and all(
        (a.name, a.kind, a.dimension, a.cell, a.labels) == (b.name, b.kind, b.dimension, b.cell, b.labels)
        and b.low <= a.low
        and a.high <= b.high
        for a, b in zip(mine.parameters, policys.parameters, strict=True)
    )
