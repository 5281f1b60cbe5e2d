"""`rtshcua test --generate`: tests for every limit of a policy, to the standard output or into a new file."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.writing import write_out
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.files import overwriting_a_source
from rtshcua.app.programs import Reading, examine, read_sources, read_text
from rtshcua.app.wording import many
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.span import Source
from rtshcua.diagnostics.suggest import nearest
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.findings import Findings
from rtshcua.front.cli.stdout import out_source
from rtshcua.ground.checker.checks.tests import MAX_CASES
from rtshcua.ground.format.format import formatted
from rtshcua.ground.language.paths import on_a_shelf, shown
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.testing.boundaries.generation import GeneratedTests, GenerationPlan
from rtshcua.ground.testing.boundaries.generation import generate as generated
from rtshcua.ground.testing.case import CaseSuite, PolicyUnderTest
from rtshcua.mavlink import dialect
from rtshcua.model.flat.zone import MAX_COORDINATE, project
from rtshcua.model.ir.tests import NominalDecl

#: what a source is called that goes to the standard output: it imports as a file of the working folder would
_IN_MEMORY = "generated_tests.rts"

_TESTS = "generated tests"
_FEWER = "`--skill` says for which skills, one file after the other"


class Wanted(NamedTuple):
    """What the command line asks for."""

    policy: str | None
    skills: tuple[str, ...]
    nominal: str | None
    output: Path | None
    force: bool


class _Found(NamedTuple):
    """A policy, and the program that it was found in."""

    tested: PolicyUnderTest
    reading: Reading


def generate(files: Sequence[Path], wanted: Wanted, findings: Findings, *, quiet: bool) -> ExitCode:
    """Write the tests of one policy; quiet: as a field of the JSON object."""
    output = wanted.output
    refused = None if output is None else overwriting_a_source(output, files, _TESTS)
    if refused is not None:
        return findings.end(refused)
    if output is not None and os.path.lexists(output) and not (wanted.force and output.is_file()):
        help = "`--force` replaces it" if output.is_file() else None
        return findings.refuse(ExitCode.USAGE, "output", f"`{output}` exists, and is not written over", help)
    found: dict[tuple[str, str, str], _Found] = {}
    for path in files:
        reading = read_sources([path])
        refused = None if output is None else overwriting_a_source(output, reading.program.sources, _TESTS)
        if refused is not None:
            return findings.end(refused)
        checked = examine(reading)
        if findings.report(_wrong(checked.diagnostics), reading.program.sources):
            return findings.finish(exit_code(checked.diagnostics))
        for ground in checked.grounds:
            lowered = ground.lowered
            place = (lowered.declaration.name.span.file, lowered.policy.name, lowered.vehicle.name.text)
            found.setdefault(place, _Found(PolicyUnderTest(lowered, ground.prepared), reading))
    one = _chosen(list(found.values()), {shown(str(path)) for path in files}, wanted, findings)
    if isinstance(one, ExitCode):
        return one
    return _write(one, wanted, findings, quiet=quiet)


def _wrong(found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """What forbids going on: the rest is for `check`."""
    return tuple(each for each in found if each.severity is Severity.ERROR)


def _chosen(found: list[_Found], asked: set[str], wanted: Wanted, findings: Findings) -> _Found | ExitCode:
    """The policy that is meant: the one that is named, or else the only one, first of those that the files declare."""
    names = list(dict.fromkeys(each.tested.name for each in found))
    if wanted.policy is not None:
        named = [each for each in found if each.tested.name == wanted.policy]
        if named:
            return named[0]
        near = nearest(wanted.policy, names)
        help = f"did you mean `{near}`?" if near else _listed(names)
        return findings.refuse(ExitCode.USAGE, "usage", f"there is no policy `{wanted.policy}`", help)
    own = [each for each in found if each.tested.lowered.declaration.name.span.file in asked]
    for few in (own, found):
        if len({each.tested.name for each in few}) == 1:
            return few[0]
    if not names:
        help = "name a source that declares one, or imports it"
        return findings.refuse(ExitCode.USAGE, "usage", "there is no policy to write tests of", help)
    message = f"there are {len(names)} policies"
    return findings.refuse(
        ExitCode.USAGE, "usage", message, f"`--policy` says which one is meant{_listed(names, ': ')}"
    )


def _listed(names: Sequence[str], before: str = "") -> str:
    return before + ", ".join(f"`{name}`" for name in names) if names else ""


def _write(one: _Found, wanted: Wanted, findings: Findings, *, quiet: bool) -> ExitCode:
    policy = one.tested.lowered.policy
    skills = [contract.name for contract in policy.contracts]
    unknown = next((name for name in wanted.skills if name not in skills), None)
    if unknown is not None:
        near = nearest(unknown, skills)
        help = f"did you mean `{near}`?" if near else f"its skills are {_listed(skills)}"
        return findings.refuse(ExitCode.USAGE, "usage", f"`{policy.name}` has no skill `{unknown}`", help)
    nominal = _nominal(one, wanted)
    if nominal is None and wanted.nominal is not None:
        message = f"there is no nominal `{wanted.nominal}` under `{policy.name}`"
        return findings.refuse(ExitCode.USAGE, "usage", message)
    name = str(wanted.output or _IN_MEMORY)
    sources: dict[str, Source] = {}

    def play(text: str) -> CaseSuite:
        found = suite(read_text(name, text).program, dialect.load())
        sources.update(found.sources)
        return found

    made = generated(one.tested, _plan(one, nominal, wanted, name), play)
    if made.text is None:
        findings.report(made.refused, sources)
        message = f"no tests of `{policy.name}` could be written"
        if made.cases:
            message = f"{message}: a file has at most {MAX_CASES:,} cases, and these are {made.cases:,}"
        elif not made.refused:
            message = f"{message}: it permits nothing"
        fewer = _FEWER if made.cases else None
        return findings.refuse(ExitCode.DIAGNOSTICS, "not-generated", message, fewer)
    text = formatted(Source(name, made.text)).text or made.text
    if wanted.output is not None:
        write_out(wanted.output, text.encode())
    elif not quiet:
        out_source(text)
    _tell(made, policy.name, wanted.output, quiet=quiet)
    return findings.finish(
        ExitCode.OK,
        policy=policy.name,
        cases=made.cases,
        limits=len(made.limits),
        without=list(made.without),
        unreached=[each._asdict() for each in made.unreached],
        text=text,
        path=None if wanted.output is None else str(wanted.output),
    )


def _tell(made: GeneratedTests, policy: str, output: Path | None, *, quiet: bool) -> None:
    """On the standard error, for the text may be on the standard output."""
    if quiet:
        return
    where = "" if output is None else f", in {output}"
    counted = f"{many(made.cases, 'case')} on {many(len(made.limits), 'limit')} of {policy}"
    say(f"{counted}{where}: read them before you keep them")
    for label in made.without:
        say(f"nothing was found that makes `{label}` allowed; it has one case, as it is")
    for each in made.unreached:
        say(f"not reached: {each.words}")


def _nominal(one: _Found, wanted: Wanted) -> NominalDecl | None:
    """The nominal to start from: the one that is named, or else the first of this policy and vehicle, if any."""
    every = (nominal for unit in one.reading.program.units for nominal in unit.nominals)
    vehicle = one.tested.lowered.vehicle.name.text
    fitting = [each for each in every if each.policy.text == one.tested.name and each.vehicle.text == vehicle]
    return next((each for each in fitting if wanted.nominal in (None, each.name.text)), None)


def _plan(one: _Found, nominal: NominalDecl | None, wanted: Wanted, name: str) -> GenerationPlan:
    program, lowered = one.reading.program, one.tested.lowered
    files = [lowered.declaration.name.span.file, lowered.vehicle.name.span.file]
    if nominal is not None:
        files.append(nominal.name.span.file)
    imports = [_import(file, program.stable.get(file, file), name) for file in dict.fromkeys(files)]
    entries = [zone.entry for unit in program.units for zone in unit.zones if zone.entry is not None]
    places = [project(lowered.policy.projection, each.latitude, each.longitude) for each in entries]
    phase = None if nominal is None or nominal.premises.phase is None else nominal.premises.phase.phase.text
    near = tuple(place for place in places if max(map(abs, place)) < MAX_COORDINATE)
    return GenerationPlan(wanted.skills, tuple(imports), None if nominal is None else nominal.name.text, phase, near)


def _import(file: str, stable: str, importer: str) -> str:
    """How a file is imported from another: as one that ships, or relative to its folder."""
    if on_a_shelf(stable):
        return stable
    return Path(os.path.relpath(file, Path(importer).parent)).as_posix()
