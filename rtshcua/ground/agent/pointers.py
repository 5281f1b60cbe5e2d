"""JSON Pointers (RFC 6901) for places in a specification's text."""

from bisect import bisect_right

from rtshcua.diagnostics.span import Span
from rtshcua.ground.agent.json_tree import Path, Tree


def pointer(path: Path) -> str:
    """The pointer to a path; the whole document is the empty one."""
    return "".join("/" + str(part).replace("~", "~0").replace("/", "~1") for part in path)


class Places:
    """The values and keys of a tree by where they stand, for as many questions as there are findings."""

    def __init__(self, tree: Tree) -> None:
        found = [
            (place.start, -place.end, path) for places in (tree.spans, tree.keys) for path, place in places.items()
        ]
        found.sort(key=lambda each: each[:2])
        self._starts = [start for start, _, _ in found]
        self._ends = [-end for _, end, _ in found]
        self._paths = [path for _, _, path in found]
        self._around: list[int] = []  # of each place the one that it lies in, -1 for the whole
        open_places: list[int] = []
        for number, end in enumerate(self._ends):
            while open_places and self._ends[open_places[-1]] < end:
                open_places.pop()
            self._around.append(open_places[-1] if open_places else -1)
            open_places.append(number)

    def innermost(self, span: Span) -> Path:
        """The path of the smallest value that holds a span, or of the member whose key does."""
        at = bisect_right(self._starts, span.start) - 1
        while at >= 0 and self._ends[at] < span.end:
            at = self._around[at]
        return () if at < 0 else self._paths[at]
