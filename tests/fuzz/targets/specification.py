"""A mission specification, as an agent proposes it."""

import json
from collections.abc import Iterable

from fuzz import board, corpus, world
from fuzz.mutation.trees import mutated_json as mutated
from rtshcua.ground.agent.specification import load_specification
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect

MAX_LENGTH = 6_000
PROBE = "probe/probe.json"

__all__ = ["MAX_LENGTH", "mutated", "one", "seeds"]


def seeds() -> Iterable[bytes]:
    return corpus.specifications()


def one(data: bytes) -> None:
    read = world.reading({PROBE: data})
    program, specification = load_specification(PROBE, [], read, world.LIBRARY, world.listing)
    compiled = compile_program(program, dialect.load(), mission=None, issued_at_us=world.ISSUED)
    found = specification.pointed(compiled.diagnostics)
    world.hold(found, compiled.sources)
    value = json.loads(data) if any(each.pointer for each in found) else None
    for each in found:
        if each.pointer:
            _resolve(value, each.pointer)
    if compiled.policy is not None and compiled.mission is not None:
        board.flies(compiled.policy, compiled.mission)


def _resolve(value: object, pointer: str) -> None:
    """Check that a pointer (RFC 6901) leads to a value, or to a missing or duplicate key under one."""
    *path, last = [part.replace("~1", "/").replace("~0", "~") for part in pointer.split("/")[1:]]
    for part in path:
        assert isinstance(value, dict | list), pointer
        value = value[int(part)] if isinstance(value, list) else value[part]
    assert isinstance(value, dict) or (isinstance(value, list) and int(last) <= len(value)), pointer
