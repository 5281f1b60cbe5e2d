"""Small programs with the shipped library, and their lint findings."""

from collections.abc import Mapping
from pathlib import Path

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.lint.filter import filter_findings
from rtshcua.ground.lint.linter import lint
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.mavlink import dialect

CHECKOUT = Path(__file__).resolve().parents[2]

HEAD = """
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"
import "lib:policies/site.rts"
"""
TAIL = "permit return_home, emergency_land by any contingency return_home, emergency_land"
POLICY = f"role a policy p version 1 {{ {TAIL} }}"
RISE = """
skill rise(top: altitude in 5 m .. 50 m, tag: one of a, b = a) {
  motion climb to top class tactical deadline 5 s valid for 40 min lasts at most 1 min
  fallback return_home, emergency_land energy at most 5 % record intent, decision, state, authorization, effect
}
"""


def program(files: Mapping[str, str], first: str = "main.rts") -> Program:
    """Load a program from files by name and the shipped library."""

    def read(path: str) -> bytes:
        name = Path(path).name
        return files[name].encode() if name in files else (CHECKOUT / path).read_bytes()

    return load([first], read, str(CHECKOUT))


def linted(one: Program) -> tuple[Diagnostic, ...]:
    """Return the lint findings in the first file of a program, with its policies lowered and its ignores applied."""
    grounds = examine_program(one, dialect.load()).grounds
    return filter_findings(lint(one, None, grounds), one.sources, [one.units[0].file], {}).found


def decided(text: str) -> list[tuple[str, str]]:
    """Return code and underlined text of each finding of `linted`."""
    one = program({"main.rts": text})
    return [(each.code.id, underlined(one, each)) for each in linted(one)]


def found(text: str, **others: str) -> list[tuple[str, str]]:
    """Return code and underlined text of each finding."""
    one = program({"main.rts": text} | {f"{name}.rts": other for name, other in others.items()})
    return [(each.code.id, underlined(one, each)) for each in lint(one)]


def underlined(one: Program, each: Diagnostic) -> str:
    """Return the text under a finding."""
    assert each.span is not None
    return one.sources[each.span.file].slice(each.span)
