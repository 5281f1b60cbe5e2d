"""The sets of values, of zones and of phases that the conditions of a policy ask for, each kept once."""

from collections.abc import Iterable


class Sets:
    """Sets in the order in which they are first asked for, and the names of phases that they speak of."""

    def __init__(self) -> None:
        self.all: list[tuple[int, ...]] = []
        self.phases: list[str] = []
        self._numbers: dict[tuple[int, ...], int] = {}
        self._phases: dict[str, int] = {}

    def of(self, members: Iterable[int]) -> int:
        """The index of a set."""
        key = tuple(sorted(set(members)))
        number = self._numbers.get(key)
        if number is None:
            number = self._numbers[key] = len(self.all)
            self.all.append(key)
        return number

    def of_phases(self, names: Iterable[str]) -> int:
        """The index of a set of phases, by the index of each name among the names."""
        return self.of(map(self._phase, names))

    def _phase(self, name: str) -> int:
        number = self._phases.get(name)
        if number is None:
            number = self._phases[name] = len(self.phases)
            self.phases.append(name)
        return number
