"""Source text, parsed."""

from collections.abc import Iterable

from fuzz import corpus, world
from fuzz.mutation.sentences import mutated as mutated
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.parse import parse

MAX_LENGTH = 8_000


def seeds() -> Iterable[bytes]:
    return corpus.sources()


def one(data: bytes) -> None:
    source = Source(world.PROBE, data.decode("utf-8", errors="replace"))
    parsed = parse(source)
    world.hold(parsed.diagnostics, {source.file: source})
    starts = [found.span.start for found in parsed.diagnostics if found.span is not None]
    assert starts == sorted(starts)
