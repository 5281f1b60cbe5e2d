"""`rtshcua test`: run the tests of sources, say what they cover, and write tests for every limit of a policy."""

from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.project import Projects
from rtshcua.adapters.store.writing import write_out
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.files import SPECIFICATION, overwriting_a_source, source_files
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.report.junit import junit
from rtshcua.diagnostics.suggest import nearest
from rtshcua.front.cli.findings import Findings
from rtshcua.front.cli.stdout import out, out_rendered
from rtshcua.front.cli.testing.generating import Wanted, generate
from rtshcua.front.cli.testing.running import Results, run_all
from rtshcua.front.cli.testing.told import Told
from rtshcua.front.cli.width import fitted
from rtshcua.ground.testing.clause_coverage import enough, share
from rtshcua.ground.testing.reporting import (
    case_suites,
    coverage_json,
    scenario_suites,
    scenarios_json,
    summary_json,
    tests_json,
)

app = typer.Typer(add_completion=False)

_REPORT = "a report"


@app.command()
def run_tests(
    paths: Annotated[list[Path] | None, typer.Argument(help="sources (.rts), folders of them (default: here)")] = None,
    chosen: Annotated[str, typer.Option("-k", metavar="TEXT", help="only the cases whose name has this in it")] = "",
    coverage: Annotated[
        bool, typer.Option("--coverage", help="say what of the policies is covered, by clause")
    ] = False,
    fail_under: Annotated[
        int | None, typer.Option(min=0, max=100, metavar="N", help="fail where less than N % is covered")
    ] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="also each row of a table, each covered clause")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
    junit_file: Annotated[
        Path | None, typer.Option("--junit", metavar="FILE", help="write a JUnit report, over an earlier one")
    ] = None,
    generating: Annotated[
        bool, typer.Option("--generate", help="write tests for both sides of every limit of a policy")
    ] = False,
    policy: Annotated[str | None, typer.Option(help="--generate: of which policy, where there are several")] = None,
    skill: Annotated[list[str] | None, typer.Option(help="--generate: for this skill alone (repeatable)")] = None,
    nominal: Annotated[
        str | None, typer.Option(help="--generate: the nominal to start from (default: the first)")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="--generate: into this file")] = None,
    force: Annotated[bool, typer.Option("--force", help="--generate: replace the file if it exists")] = False,
    config: Annotated[Path | None, typer.Option(help="the configuration, in place of the nearest")] = None,
    isolated: Annotated[bool, typer.Option("--isolated", help="without any configuration")] = False,
) -> ExitCode:
    """Run the `test` blocks of sources, fly their scenarios in virtual time, and say what of their policies they cover.

    A file's tests run where the file itself is asked for, not where it is imported. What fails is shown with the clause
    that decided, and the nearest value that would have met what was expected. Coverage counts clauses and outcomes,
    never lines. docs/testing.md has it all.

    Ends with 0 where all passed, 13 where a test failed, none was found, or less is covered than is asked
    (`--fail-under`, or `fail-under` of the configuration), 1 where sources have errors, 2 where the command line is
    wrong, 3 where a file cannot be read.
    """
    findings = Findings(json=as_json)
    only = [policy, skill, nominal, output, force or None]
    if not generating and any(only):
        help = "`--policy`, `--skill`, `--nominal`, `--output` and `--force` go with `--generate`"
        return findings.refuse(ExitCode.USAGE, "usage", "there is nothing to write without `--generate`", help)
    projects = Projects(config, isolated=isolated)
    lost = next((path for path in paths or () if not path.exists() and path.suffix == ""), None)
    if lost is not None:
        return findings.refuse(ExitCode.INPUT, "input", f"no such file or directory: `{lost}`", _meant(lost))
    files = _files(paths or [Path()], projects, keep=generating)
    if isinstance(files, Refusal):
        return findings.end(files)
    if generating:
        return generate(files, Wanted(policy, tuple(skill or ()), nominal, output, force), findings, quiet=as_json)
    refused = None if junit_file is None else overwriting_a_source(junit_file, files, _REPORT)
    if refused is not None:
        return findings.end(refused)
    whole = not chosen and all(path.is_dir() for path in paths or [Path()])  # of a part, nobody asked for a share
    least = fail_under if fail_under is not None or not whole else _least(paths or [Path()], projects)
    results = run_all(files, chosen, with_coverage=coverage or least is not None, quiet=as_json)
    return _finish(results, chosen, findings, least, junit_file, verbose=verbose, quiet=as_json)


def _meant(lost: Path) -> str:
    """A source below this folder that is called almost so, or how cases are chosen by their names."""
    if str(lost) == "-":
        return "a source must be a file, because imports are found beside it"
    by_name = f"`-k {lost}` chooses tests by name"
    below = source_files([Path()])
    near = None if isinstance(below, Refusal) else nearest(lost.name, {each.stem for each in below})
    if near is None or isinstance(below, Refusal):
        return by_name
    return f"did you mean `{next(each for each in below if each.stem == near)}`? {by_name}"


def _files(paths: list[Path], projects: Projects, *, keep: bool) -> tuple[Path, ...] | Refusal:
    """The sources that are meant, but for those that a configuration leaves out; `keep` says to keep these too."""
    files = source_files(paths)
    if isinstance(files, Refusal):
        return files
    left: list[Path] = []
    for path in files:
        if path.suffix.lower() == SPECIFICATION:
            return Refusal("usage", f"`{path}` is a mission specification, and has no tests")
        project = projects.of(path)
        if isinstance(project, Refusal):
            where, _, what = project.text.partition(": ")
            return project._replace(text=f"`{where}`: {what}")
        if keep or path in paths or not project.excludes(path, project.settings.test.exclude):
            left.append(path)
    return tuple(left)


def _least(paths: list[Path], projects: Projects) -> int | None:
    """The greatest of the thresholds that the configurations of what was asked for set."""
    found = [projects.of(path) for path in paths]
    set_ = [one.settings.test.fail_under for one in found if not isinstance(one, Refusal)]
    return max((each for each in set_ if each is not None), default=None)


def _finish(
    results: Results,
    chosen: str,
    findings: Findings,
    least: int | None,
    junit_file: Path | None,
    *,
    verbose: bool,
    quiet: bool,
) -> ExitCode:
    """Say what was found, write the report, and end."""
    ran, flown, covered = results.ran, results.flown, results.covered
    refused = None if junit_file is None else overwriting_a_source(junit_file, results.sources, _REPORT)
    if refused is not None:
        return findings.end(refused)
    told = Told(results.sources)
    if not quiet:
        for line in (*told.tests(ran, verbose=verbose), *told.scenarios(flown, verbose=verbose)):
            for each in fitted(line):
                out_rendered(each)
    failed = tuple(each.finding for each in ran if each.finding is not None)
    failed += tuple(finding for each in flown for finding in each.findings)
    findings.report((*results.diagnostics, *failed), results.sources)
    if junit_file is not None:
        write_out(
            junit_file,
            junit((*case_suites(ran, results.sources, covered), *scenario_suites(flown, results.sources))).encode(),
        )
    code = exit_code(results.diagnostics) if has_errors(results.diagnostics) else ExitCode.OK
    short = covered is not None and least is not None and not enough([one.coverage for one in covered], least)
    if code is ExitCode.OK and (failed or not (ran or flown) or short):
        code = ExitCode.TESTS
    if not quiet:
        for line in told.coverage(covered or (), verbose=verbose):
            for each in fitted(line):
                out_rendered(each)
        out_rendered(told.summary(ran, flown, results.left_out) if ran or flown else _none(results, chosen))
        if short:
            reached = sum(one.coverage.covered for one in covered or ())
            found = share(reached, sum(one.coverage.total for one in covered or ()))
            out(f"{found} is covered, less than {least} % (`--fail-under`, or `fail-under` of the configuration)")
    shares = None if covered is None else coverage_json(covered, results.sources)
    return findings.finish(
        code,
        tests=tests_json(ran, results.sources),
        scenarios=scenarios_json(flown, results.sources),
        summary=summary_json(ran) | {"left_out": results.left_out},
        coverage=None if shares is None else shares | {"least": least, "enough": not short},
    )


def _none(results: Results, chosen: str) -> str:
    if has_errors(results.diagnostics):
        return "no test could be run: the sources have errors"
    if results.left_out:
        by_word = {word: name for name in sorted(results.names) for word in (*name.split(), name)}
        near = nearest(chosen, by_word)
        help = "" if near is None else f"; the nearest is `{by_word[near]}`"
        return f"no test was run: none of {results.left_out} has `{chosen}` in its name{help}"
    return "no test was found; docs/testing.md says how to write one"
