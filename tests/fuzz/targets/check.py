"""Source text: loaded with the library and checked; without errors also compiled, signed and
loaded on board.
"""

from collections.abc import Iterable

from fuzz import board, corpus, world
from fuzz.mutation.sentences import mutated as mutated
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import check_program, compile_program
from rtshcua.mavlink import dialect

MAX_LENGTH = 8_000


def seeds() -> Iterable[bytes]:
    return corpus.sources()


def one(data: bytes) -> None:
    program = load([world.PROBE], world.reading({world.PROBE: data}), world.LIBRARY, world.listing)
    if not any(unit.missions for unit in program.units):
        world.hold(check_program(program, dialect.load()), program.sources)
        return
    compiled = compile_program(program, dialect.load(), mission=None, issued_at_us=world.ISSUED)
    world.hold(compiled.diagnostics, compiled.sources)
    assert (compiled.policy is None) == has_errors(compiled.diagnostics)
    if compiled.policy is not None and compiled.mission is not None:
        board.flies(compiled.policy, compiled.mission)
