"""Coverage of several policies at once, as tests of several programs come to them.

What two programs import is the same policy if it says the same, for the same vehicle, in the same words: it is counted
once, and all their cases count for it.
"""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.checker.symbols import collect
from rtshcua.ground.testing.case import Tested
from rtshcua.ground.testing.coverage.coverage import Coverage, Reached, coverage
from rtshcua.ground.testing.coverage.reached import reached
from rtshcua.ground.testing.coverage.universe import ENERGY, Item, Universe, universe
from rtshcua.ground.testing.run import Ran
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.program import Unit


class Covered(NamedTuple):
    """The coverage of one policy, and where each of its lines is written; None where that is no one place."""

    coverage: Coverage
    spans: tuple[Span | None, ...]


class _Kept(NamedTuple):
    universe: Universe
    spans: tuple[Span | None, ...]
    reached: list[Reached]


class Tally:
    """Adds up what cases reach. `sources` are the texts that spans are about."""

    def __init__(self) -> None:
        self._kept: dict[Policy, _Kept] = {}
        self.sources: dict[str, Source] = {}

    def policy(self, tested: Tested, units: Iterable[Unit], sources: Mapping[str, Source]) -> None:
        """Count a policy, of which perhaps no case is run; `units` are those of its program."""
        self.sources.update(sources)
        if tested.lowered.policy not in self._kept:
            found = universe(tested.prepared)
            skills = collect(units).skills
            charges = {name: skill.energy.span for name, skill in skills.items() if skill.energy is not None}
            spans = tuple(_span(tested, item, charges) for item in found.items)
            self._kept[tested.lowered.policy] = _Kept(found, spans, [])

    def case(self, ran: Ran) -> None:
        """Count what a case reached; its policy is counted."""
        kept = self._kept[ran.case.policy.lowered.policy]
        kept.reached.append(reached(kept.universe, ran.case.invocation, ran.trace))

    def flights(self, tested: Tested, reached: Iterable[Reached]) -> None:
        """Count what the decisions of flights reached; their policy is counted."""
        self._kept[tested.lowered.policy].reached.extend(reached)

    def all(self) -> tuple[Covered, ...]:
        """The coverage of each policy, in the order in which they came."""
        return tuple(Covered(coverage(kept.universe, kept.reached), kept.spans) for kept in self._kept.values())


def _span(tested: Tested, item: Item, charges: Mapping[str, Span]) -> Span | None:
    if item.where is not None:
        return tested.lowered.files.span(*item.where)
    return charges.get(item.skill) if item.role == ENERGY else tested.lowered.declaration.name.span
