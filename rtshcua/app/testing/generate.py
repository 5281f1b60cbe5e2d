"""Tests for every limit of a policy: on both sides of it, decided before they are written."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.writing import write_out
from rtshcua.app.files import overwriting_a_source
from rtshcua.app.programs import Reading, examine, read_sources, read_text
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.checker.checks.tests import MAX_CASES
from rtshcua.ground.format.format import formatted
from rtshcua.ground.language.paths import on_a_shelf, shown
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.testing.boundaries.generation import GeneratedTests, GenerationPlan
from rtshcua.ground.testing.boundaries.generation import generate as generate_tests
from rtshcua.ground.testing.case import CaseSuite, PolicyUnderTest
from rtshcua.mavlink import dialect
from rtshcua.model.flat.zone import MAX_COORDINATE, project
from rtshcua.model.ir.tests import NominalDecl

#: what a source is called that goes to the standard output: it imports as a file of the working folder would
_IN_MEMORY = "generated_tests.rts"

_TESTS = "generated tests"
_FEWER = "use `--skill` to generate one file for each skill"


class GenerateRequest(NamedTuple):
    """What the command line asks for."""

    policy: str | None
    skills: tuple[str, ...]
    nominal: str | None
    output: Path | None
    force: bool


class _Candidate(NamedTuple):
    """A policy, and the program that it was found in."""

    tested: PolicyUnderTest
    reading: Reading


class WrittenTests(NamedTuple):
    """Tests of both sides of every limit of a policy: as text, which is written already where a file was named."""

    policy: str
    made: GeneratedTests
    text: str


class NotGenerated(NamedTuple):
    """Findings for which there are no tests; a refusal where they do not say it all."""

    diagnostics: tuple[Diagnostic, ...]
    sources: dict[str, Source]
    refusal: Refusal | None = None


def generate(files: Sequence[Path], request: GenerateRequest) -> WrittenTests | NotGenerated | Refusal:
    """Write the tests of one policy. Raises OSError."""
    output = request.output
    refused = None if output is None else overwriting_a_source(output, files, _TESTS)
    if refused is not None:
        return refused
    if output is not None and os.path.lexists(output) and not (request.force and output.is_file()):
        help = "replace it with `--force`" if output.is_file() else ""
        return Refusal("output", f"`{output}` exists, and is not overwritten", help)
    found: dict[tuple[str, str, str], _Candidate] = {}
    for path in files:
        reading = read_sources([path])
        refused = None if output is None else overwriting_a_source(output, reading.program.sources, _TESTS)
        if refused is not None:
            return refused
        checked = examine(reading)
        wrong = tuple(each for each in checked.diagnostics if each.severity is Severity.ERROR)
        if wrong:
            return NotGenerated(wrong, reading.program.sources)
        for ground in checked.grounds:
            lowered = ground.lowered
            place = (lowered.declaration.name.span.file, lowered.policy.name, lowered.vehicle.name.text)
            found.setdefault(place, _Candidate(PolicyUnderTest(lowered, ground.prepared), reading))
    one = _chosen(list(found.values()), {shown(str(path)) for path in files}, request)
    return one if isinstance(one, Refusal) else _write(one, request)


def _chosen(found: list[_Candidate], asked: set[str], request: GenerateRequest) -> _Candidate | Refusal:
    """The policy that is meant: the one that is named, or else the only one, first of those that the files declare."""
    names = list(dict.fromkeys(each.tested.name for each in found))
    if request.policy is not None:
        named = [each for each in found if each.tested.name == request.policy]
        if named:
            return named[0]
        near = nearest(request.policy, names)
        help = f"did you mean `{near}`?" if near else _listed(names)
        return Refusal("usage", f"there is no policy `{request.policy}`", help)
    own = [each for each in found if each.tested.lowered.declaration.name.span.file in asked]
    for few in (own, found):
        if len({each.tested.name for each in few}) == 1:
            return few[0]
    if not names:
        return Refusal(
            "usage", "there is no policy to generate tests for", "name a source that declares or imports a policy"
        )
    return Refusal("usage", f"there are {len(names)} policies", f"select one with `--policy`{_listed(names, ': ')}")


def _listed(names: Sequence[str], before: str = "") -> str:
    return before + ", ".join(f"`{name}`" for name in names) if names else ""


def _write(one: _Candidate, request: GenerateRequest) -> WrittenTests | NotGenerated | Refusal:
    policy = one.tested.lowered.policy
    skills = [contract.name for contract in policy.contracts]
    unknown = next((name for name in request.skills if name not in skills), None)
    if unknown is not None:
        near = nearest(unknown, skills)
        help = f"did you mean `{near}`?" if near else f"its skills are {_listed(skills)}"
        return Refusal("usage", f"`{policy.name}` has no skill `{unknown}`", help)
    nominal = _nominal(one, request)
    if nominal is None and request.nominal is not None:
        return Refusal("usage", f"there is no nominal `{request.nominal}` under `{policy.name}`")
    name = str(request.output or _IN_MEMORY)
    sources: dict[str, Source] = {}

    def play(text: str) -> CaseSuite:
        found = suite(read_text(name, text).program, dialect.load())
        sources.update(found.sources)
        return found

    made = generate_tests(one.tested, _plan(one, nominal, request, name), play)
    if made.text is None:
        return NotGenerated(made.refused, sources, _why_not(made, policy.name))
    text = formatted(Source(name, made.text)).text or made.text
    if request.output is not None:
        write_out(request.output, text.encode())
    return WrittenTests(policy.name, made, text)


def _why_not(made: GeneratedTests, policy: str) -> Refusal:
    message = f"no tests of `{policy}` could be written"
    if made.cases:
        message = f"{message}: a file has at most {MAX_CASES:,} cases, and these are {made.cases:,}"
    elif not made.refused:
        message = f"{message}: it permits nothing"
    return Refusal("not-generated", message, _FEWER if made.cases else "")


def _nominal(one: _Candidate, request: GenerateRequest) -> NominalDecl | None:
    """The nominal to start from: the one that is named, or else the first of this policy and vehicle, if any."""
    every = (nominal for unit in one.reading.program.units for nominal in unit.nominals)
    vehicle = one.tested.lowered.vehicle.name.text
    fitting = [each for each in every if each.policy.text == one.tested.name and each.vehicle.text == vehicle]
    return next((each for each in fitting if request.nominal in (None, each.name.text)), None)


def _plan(one: _Candidate, nominal: NominalDecl | None, request: GenerateRequest, name: str) -> GenerationPlan:
    program, lowered = one.reading.program, one.tested.lowered
    files = [lowered.declaration.name.span.file, lowered.vehicle.name.span.file]
    if nominal is not None:
        files.append(nominal.name.span.file)
    imports = [_import(file, program.stable.get(file, file), name) for file in dict.fromkeys(files)]
    entries = [zone.entry for unit in program.units for zone in unit.zones if zone.entry is not None]
    places = [project(lowered.policy.projection, each.latitude, each.longitude) for each in entries]
    phase = None if nominal is None or nominal.premises.phase is None else nominal.premises.phase.phase.text
    near = tuple(place for place in places if max(map(abs, place)) < MAX_COORDINATE)
    return GenerationPlan(request.skills, tuple(imports), None if nominal is None else nominal.name.text, phase, near)


def _import(file: str, stable: str, importer: str) -> str:
    """How a file is imported from another: as one that ships, or relative to its folder."""
    if on_a_shelf(stable):
        return stable
    return Path(os.path.relpath(file, Path(importer).parent)).as_posix()
