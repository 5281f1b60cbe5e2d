"""Of many boxes those that enclose another, in order: a k-d tree over their bounds.

A box is a row of numbers, two an axis: the negated least value and the greatest. One encloses another where no number
of its row is below the other's, so that every side is asked about in the same way.
"""

from collections.abc import Iterator, Sequence
from heapq import heappop, heappush
from operator import lt
from typing import TypeAlias

Row: TypeAlias = tuple[int, ...]

_LEAF = 8


class _Node:
    """Some entries, or two nodes: the greatest number on each side, and the first and the last that are there."""

    __slots__ = ("children", "entries", "first", "last", "most", "parent")

    def __init__(self, entries: list[tuple[int, Row]], parent: "_Node | None", depth: int) -> None:
        self.parent = parent
        self.most: Row = tuple(map(max, zip(*(row for _, row in entries), strict=True)))
        self.entries: dict[int, list[Row]] = {}
        self.children: tuple[_Node, ...] = ()
        self.first = min(number for number, _ in entries)
        self.last = max(number for number, _ in entries)
        side = self._side(entries, depth) if len(entries) > _LEAF else None
        if side is None:
            for number, row in entries:
                self.entries.setdefault(number, []).append(row)
            return
        entries.sort(key=lambda each: each[1][side])
        middle = len(entries) // 2
        self.children = tuple(_Node(part, self, side + 1) for part in (entries[:middle], entries[middle:]))

    def _side(self, entries: list[tuple[int, Row]], depth: int) -> int | None:
        """The side by which the entries are parted, each in its turn; None where all are alike."""
        sides = len(self.most)
        for turn in range(sides):
            side = (depth + turn) % sides
            if any(row[side] != self.most[side] for _, row in entries):
                return side
        return None

    def without(self, number: int) -> None:
        """Take out an entry, and say so above."""
        del self.entries[number]
        node: _Node | None = self
        while node is not None:
            within = [(each.first, each.last) for each in node.children if each.last >= 0] or [
                (each, each) for each in node.entries
            ]
            node.first, node.last = (
                (min(each[0] for each in within), max(each[1] for each in within)) if within else (0, -1)
            )
            node = node.parent


class Enclosing:
    """The rows of numbered boxes; one number may have several. What was removed is not found any more."""

    def __init__(self, entries: Sequence[tuple[int, Row]]) -> None:
        self._root = _Node(list(entries), None, 0) if entries else None
        self._leaves: dict[int, dict[_Node, None]] = {}
        waiting = [] if self._root is None else [self._root]
        while waiting:
            node = waiting.pop()
            waiting += node.children
            for number in node.entries:
                self._leaves.setdefault(number, {})[node] = None

    def remove(self, number: int) -> None:
        """Forget a box, if it is there."""
        for leaf in self._leaves.pop(number, ()):
            leaf.without(number)

    def around(self, row: Row, after: int = -1) -> Iterator[int]:
        """The numbers above `after` of the boxes that enclose a row, the least first, each once."""
        heap: list[tuple[int, int, _Node | None]] = []
        count = 0
        last = after

        def enter(node: _Node) -> None:
            nonlocal count
            if node.last > after and not any(map(lt, node.most, row)):
                count += 1
                heappush(heap, (node.first, count, node))

        if self._root is not None:
            enter(self._root)
        while heap:
            number, _, node = heappop(heap)
            if node is None:
                if number > last:
                    last = number
                    yield number
                continue
            for child in node.children:
                enter(child)
            for entry, rows in node.entries.items():
                if entry > last and any(not any(map(lt, each, row)) for each in rows):
                    count += 1
                    heappush(heap, (entry, count, None))
