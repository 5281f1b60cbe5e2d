"""Small sources with tests, and their results. They use the frozen library of the checker's twins."""

from pathlib import Path

from reference.sources import LIBRARY
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.testing.case import CaseSuite
from rtshcua.ground.testing.case_result import CaseResult, run_case
from rtshcua.mavlink import dialect

IMPORT = 'import "lib:policies/bridge_inspection.rts"\n'
#: above bridge A, in good weather
NOMINAL = """nominal morning {
  under bridge_inspection  on quad  by role operator through agent
  at    "2026-06-01T08:00:00Z"
  phase inspection of departure, inspection, recovery
  given position = bridge_a.entry, height = 20 m, battery = 80 %, gps.fix = fix_3d, landed = in_air
  given link.quality = 90 %, wind.speed = 3 m/s, obstacle.distance = 40 m
}
"""
WHEN = "when inspect_area(bridge_a, altitude = 20 m)"


def program(text: str, **files: str) -> Program:
    """Load a source, with other files by their names without `.rts`."""
    beside = {f"{name}.rts": content for name, content in files.items()}

    def read(path: str) -> bytes:
        if path == "probe.rts":
            return text.encode()
        return beside[path].encode() if path in beside else Path(path).read_bytes()

    return load(["probe.rts"], read, LIBRARY)


def made(text: str, before: str = IMPORT + NOMINAL, **files: str) -> CaseSuite:
    """Return the test suite of a source."""
    return suite(program(before + text, **files), dialect.load())


def found(text: str, before: str = IMPORT + NOMINAL, **files: str) -> list[tuple[str, str, str | None]]:
    """Return codes, messages and helps of the findings in a source."""
    return [(each.code.id, each.message, each.help) for each in made(text, before, **files).diagnostics]


def ran(text: str, before: str = IMPORT + NOMINAL, **files: str) -> list[CaseResult]:
    """Decide the test cases of a source without findings."""
    cases = made(text, before, **files)
    assert cases.diagnostics == (), cases.diagnostics
    return [run_case(case) for case in cases.cases]


def decided(*parts: str, before: str = IMPORT + NOMINAL) -> str:
    """Return outcome, target and reason of one test with these parts."""
    (one,) = ran('test "it" {\n  ' + "\n  ".join((*parts, "expect allow")) + "\n}\n", before)
    decision = one.trace.decision
    flies = [] if decision.target is None else [decision.target.text]
    return " ".join([decision.outcome.name.lower(), *flies, decision.reason.value])
