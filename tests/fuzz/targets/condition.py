"""The text of a condition in a skill: typed, lowered and evaluated, compared with a naive interpreter."""

from collections.abc import Iterable
from random import Random
from zlib import crc32

from fuzz import corpus, world
from fuzz.mutation.sentences import mutated as mutated
from reference.naive_expression import truth
from reference.random_expressions import PHASES
from rtshcua.diagnostics.span import Source
from rtshcua.ground.checker.condition_nodes import walk
from rtshcua.ground.checker.conditions import check_condition
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.name_scope import Scope
from rtshcua.ground.checker.report import Report
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.expression import Grow
from unit.ground.lower.test_expression_meaning import NAMES, SOURCE, declared, histories, lowered, on_board

MAX_LENGTH = 1_000
BEFORE = "skill x() { require "


def seeds() -> Iterable[bytes]:
    return corpus.conditions()


def one(data: bytes) -> None:
    source = Source(world.PROBE, BEFORE + data.decode("utf-8", errors="replace") + "\n}")
    sources = {source.file: source, "x": Source("x", SOURCE)}
    parsed = parse(source)
    world.hold(parsed.diagnostics, sources)
    symbols, known = declared()
    for clause in (clause for skill in parsed.unit.skills for clause in skill.require):
        report = Report(sources)
        context = CheckContext(symbols, report, known)
        check_condition(Scope(symbols, report, context.arguments(symbols.skills["probe"])), clause.condition)
        world.hold(report.found, sources)
        grown = any(isinstance(part, Grow) for part in walk(clause.condition))  # of these circles, none is built
        found = None if report.found or grown else lowered(clause.condition)
        if found is not None:
            random = Random(crc32(data))
            history, phase = histories(random), random.choice([*PHASES, "other"])
            said, meant = on_board(found, history, phase), truth(clause.condition, history, NAMES, phase)
            assert said == meant, (said, meant, history, phase)
