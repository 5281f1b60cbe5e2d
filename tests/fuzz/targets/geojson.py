"""The GeoJSON that a zone is read from, lowered and evaluated like any other zone."""

from collections.abc import Iterable

from fuzz import board, corpus, world
from fuzz.mutation.trees import mutated_json as mutated
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect

MAX_LENGTH = 6_000
DATA = "probe/probe.geojson"

__all__ = ["MAX_LENGTH", "mutated", "one", "seeds"]


def seeds() -> Iterable[bytes]:
    return corpus.geojson()


def one(data: bytes) -> None:
    files = world.reading({DATA: data, world.PROBE: corpus.READS_GEOJSON})
    program = load([world.PROBE], files, world.LIBRARY, world.listing)
    compiled = compile_program(program, dialect.load(), mission=None, issued_at_us=world.ISSUED)
    world.hold(compiled.diagnostics, compiled.sources)
    if compiled.policy is not None and compiled.mission is not None:
        board.flies(compiled.policy, compiled.mission)
