"""JSON Pointers (RFC 6901) for places in a specification's text."""

from rtshcua.diagnostics.span import Span
from rtshcua.ground.agent.json_tree import Path, Tree


def pointer(path: Path) -> str:
    """The pointer to a path; the whole document is the empty one."""
    return "".join("/" + str(part).replace("~", "~0").replace("/", "~1") for part in path)


def innermost(tree: Tree, span: Span) -> Path:
    """The path of the smallest value that holds a span, or of the member whose key does."""
    best: Path = ()
    size = None
    for places in (tree.spans, tree.keys):
        for path, place in places.items():
            holds = place.start <= span.start and span.end <= place.end
            if holds and (size is None or place.end - place.start <= size):
                best, size = path, place.end - place.start
    return best
