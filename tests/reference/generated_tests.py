"""Tests generated from a policy, and the changes of the policy that they detect."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from rtshcua.diagnostics.codes import Severity
from rtshcua.ground.language.load import load
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.testing import case as cases
from rtshcua.ground.testing.boundaries.generation import GeneratedTests, GenerationPlan, generate
from rtshcua.ground.testing.case_result import run_case
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).resolve().parents[2]
DIALECT = dialect.load()
ENTRY = ((104_967, 113_402),)  # of bridge_a, local mm


def play(text: str, others: Mapping[str, str]) -> cases.CaseSuite:
    """The test cases of a text; `others` are files beside it."""

    def read(path: str) -> bytes:
        name = Path(path).name
        if name == "tests.rts":
            return text.encode()
        return others[name].encode() if name in others else (CHECKOUT / path).read_bytes()

    return suite(load(["tests.rts"], read, str(CHECKOUT)), DIALECT)


def generated(text: str, name: str, imports: str, skills: tuple[str, ...] = ()) -> GeneratedTests:
    """The tests generated from the only policy in a text, in the file `name`, imported as `imports`."""

    def read(path: str) -> bytes:
        return text.encode() if Path(path).name == name else (CHECKOUT / path).read_bytes()

    checked = examine_program(load([name], read, str(CHECKOUT)), DIALECT)
    (ground,) = checked.grounds
    plan = GenerationPlan(skills, (imports,), None, None, ENTRY)
    return generate(
        cases.PolicyUnderTest(ground.lowered, ground.prepared), plan, lambda draft: play(draft, {name: text})
    )


def wrong(of: GeneratedTests, others: Mapping[str, str]) -> Iterator[str]:
    """Yield the cases that the language refuses, then those that fail."""
    assert of.text is not None
    played = play(of.text, others)
    yield from (each.code.id for each in played.diagnostics if each.severity is Severity.ERROR)
    yield from (case.name for case in played.cases if not run_case(case).met)


def failures(of: GeneratedTests, others: Mapping[str, str]) -> list[str]:
    """Return the cases that fail or that the language refuses."""
    return list(wrong(of, others))


def noticed(of: GeneratedTests, others: Mapping[str, str]) -> bool:
    """Whether any case fails or is refused."""
    return next(wrong(of, others), None) is not None
