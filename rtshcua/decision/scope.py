"""What code may name: the slots, cells, zones, tables, sets and monitors that exist, and of what kind they are."""

from typing import NamedTuple

from rtshcua.model.flat.contract import CHOICE, PLACE, QUANTITY, ZONE, Contract
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION


class Scope(NamedTuple):
    """Each method answers what is wrong with naming an index, or None.

    `kinds` is the signal kind of each slot. `cells` is, for each skill that the code may speak of, the parameter kind
    at each first cell: an argument must exist, of the same kind, in all of them, and in at least one. `members` are
    the policy's sets; `phases` counts its phase names, None where code may not ask for the phase.
    """

    kinds: tuple[int, ...]
    zones: int
    tables: int
    members: tuple[tuple[int, ...], ...]
    cells: tuple[dict[int, int], ...]
    monitors: int
    phases: int | None

    def slot(self, slot: int) -> str | None:
        """A slot of any kind."""
        return None if 0 <= slot < len(self.kinds) else f"there is no slot {slot}"

    def number(self, slot: int) -> str | None:
        """A slot that holds a number (an enumeration's ordinal is one)."""
        if not 0 <= slot < len(self.kinds):
            return f"there is no slot {slot}"
        return f"slot {slot} is a position, not a number" if self.kinds[slot] == POSITION else None

    def enumeration(self, slot: int) -> str | None:
        """A slot that holds an enumeration."""
        found = 0 <= slot < len(self.kinds) and self.kinds[slot] == ENUMERATION
        return None if found else f"slot {slot} is no enumeration"

    def quantity(self, cell: int) -> str | None:
        """A cell that holds a number."""
        return self._argument(cell, (QUANTITY, CHOICE), "number")

    def choice_or_zone(self, cell: int) -> str | None:
        """A cell that holds an ordinal or a zone's index."""
        return self._argument(cell, (CHOICE, ZONE), "choice and no zone")

    def zone_argument(self, cell: int) -> str | None:
        """A cell that holds a zone's index."""
        return self._argument(cell, (ZONE,), "zone")

    def place(self, cell: int) -> str | None:
        """The first of the two cells that hold a place."""
        return self._argument(cell, (PLACE,), "place")

    def zone(self, index: int) -> str | None:
        """A zone, declared or derived."""
        return None if 0 <= index < self.zones else f"there is no zone {index}"

    def table(self, index: int) -> str | None:
        """A table of derived zones."""
        return None if 0 <= index < self.tables else f"there is no table {index}"

    def set_of_members(self, index: int) -> str | None:
        """A membership set."""
        return None if 0 <= index < len(self.members) else f"there is no set {index}"

    def set_of_phases(self, index: int) -> str | None:
        """A membership set of phase names."""
        phases = self.phases
        if phases is None:
            return "the phase is asked for where there is none"
        if not 0 <= index < len(self.members):
            return f"there is no set {index}"
        return None if all(0 <= member < phases for member in self.members[index]) else f"set {index} is none of phases"

    def monitor(self, index: int) -> str | None:
        """A temporal monitor."""
        return None if 0 <= index < self.monitors else f"there is no monitor {index} here"

    def _argument(self, cell: int, kinds: tuple[int, ...], name: str) -> str | None:
        if not self.cells:
            return "an argument is named, but no skill is"
        found = all(kinds_of.get(cell) in kinds for kinds_of in self.cells)
        return None if found else f"argument cell {cell} is no {name}"

    def about(self, *contracts: Contract) -> "Scope":
        """The same, for code that may name the arguments of these contracts' skills."""
        return self._replace(cells=tuple(cells_of(contract) for contract in contracts))

    def inside_monitor(self, number: int) -> "Scope":
        """The same, for the code of a temporal monitor: it may read those before it, no argument and no phase."""
        return self._replace(cells=(), monitors=number, phases=None)


def cells_of(contract: Contract) -> dict[int, int]:
    """The kind of the parameter that begins at each cell."""
    return {parameter.cell: parameter.kind for parameter in contract.parameters}


def scope_of(policy: Policy) -> Scope:
    """What code may name anywhere in a policy; `policy.signals` own its slots."""
    kinds = [0] * policy.slots
    for signal in policy.signals:
        for slot in signal.slots:
            kinds[slot] = signal.kind
    monitors, phases = len(policy.monitors), len(policy.phases)
    return Scope(tuple(kinds), len(policy.zones), len(policy.tables), policy.sets, (), monitors, phases)
