"""`rtshcua test`: run the tests of sources, measure coverage, and generate tests for the limits of a policy."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.project import Projects
from rtshcua.adapters.store.writing import write_out
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.files import overwriting_a_source
from rtshcua.app.testing.generate import GenerateRequest, NotGenerated, generate
from rtshcua.app.testing.run import TestResults, least_share, run_all, select_files
from rtshcua.app.wording import many
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.report.junit import junit
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.render.progress import counting, watched
from rtshcua.front.cli.render.test_report import TestReport
from rtshcua.front.cli.stdout import out_source
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


Paths = Annotated[list[Path] | None, typer.Argument(help="sources (.rts) or folders (default: here)")]
Chosen = Annotated[str, typer.Option("-k", metavar="TEXT", help="only cases whose name contains this text")]
Coverage = Annotated[bool, typer.Option("--coverage", help="report the coverage of the policies by clause")]
FailUnder = Annotated[int | None, typer.Option(min=0, max=100, metavar="N", help="fail if coverage is below N %")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="list also the rows of tables and the covered clauses")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")]
JunitFile = Annotated[
    Path | None, typer.Option("--junit", metavar="FILE", help="write a JUnit report; an existing one is replaced")
]
Generating = Annotated[
    bool, typer.Option("--generate", help="generate tests for both sides of every limit of a policy")
]
Policy = Annotated[str | None, typer.Option(help="--generate: the policy, if there are several")]
Skill = Annotated[list[str] | None, typer.Option(help="--generate: only for this skill (repeatable)")]
Nominal = Annotated[str | None, typer.Option(help="--generate: the nominal state to start from (default: the first)")]
Output = Annotated[Path | None, typer.Option("--output", "-o", help="--generate: the file to write")]
Force = Annotated[bool, typer.Option("--force", help="--generate: replace an existing file")]
Config = Annotated[Path | None, typer.Option(help="use this configuration, not the nearest")]
Isolated = Annotated[bool, typer.Option("--isolated", help="ignore all configuration files")]


@app.command()
def run_tests(
    paths: Paths = None,
    chosen: Chosen = "",
    coverage: Coverage = False,
    fail_under: FailUnder = None,
    verbose: Verbose = False,
    as_json: AsJson = False,
    junit_file: JunitFile = None,
    generating: Generating = False,
    policy: Policy = None,
    skill: Skill = None,
    nominal: Nominal = None,
    output: Output = None,
    force: Force = False,
    config: Config = None,
    isolated: Isolated = False,
) -> ExitCode:
    """Run the `test` blocks of sources, fly their scenarios in virtual time, and report what they cover.

    The tests of a file run if the file is named or found in a folder, not if it is only imported. A failure names the
    clause that decided and the nearest value that gives the expected result. Coverage counts clauses and outcomes, not
    lines. Details: docs/testing.md.

    Exit codes: 0 all passed; 13 a test failed, no test was found, or coverage is below `--fail-under` (also
    `fail-under` in the configuration); 1 the sources have errors; 2 wrong command line; 3 a file cannot be read.
    """
    findings = Findings(json=as_json)
    if not generating and any([policy, skill, nominal, output, force]):
        help = "add `--generate`, or leave out `--policy`, `--skill`, `--nominal`, `--output` and `--force`"
        return findings.refuse(ExitCode.USAGE, "usage", "`--generate` is missing", help)
    projects, here = Projects(config, isolated=isolated), paths or [Path()]
    files = select_files(here, projects, keep=generating)
    if isinstance(files, Refusal):
        return findings.end(files)
    if generating:
        request = GenerateRequest(policy, tuple(skill or ()), nominal, output, force)
        return _generate(files, request, findings, quiet=as_json)
    refused = None if junit_file is None else overwriting_a_source(junit_file, files, _REPORT)
    if refused is not None:
        return findings.end(refused)
    whole = not chosen and all(path.is_dir() for path in here)  # the required coverage applies to whole folders only
    least = fail_under if fail_under is not None or not whole else least_share(here, projects)
    with_coverage = coverage or least is not None
    done = run_all(files, chosen, with_coverage=with_coverage, progress=watched, say=counting(quiet=as_json))
    refused = None if junit_file is None else overwriting_a_source(junit_file, done.sources, _REPORT)
    if refused is not None:
        return findings.end(refused)
    show = TestReport(done, chosen, verbose=verbose, quiet=as_json)
    show.results()
    findings.report((*done.diagnostics, *done.failures), done.sources)
    if junit_file is not None:
        every = (*case_suites(done.ran, done.sources, done.covered), *scenario_suites(done.flown, done.sources))
        write_out(junit_file, junit(every).encode())
    show.summary(least)
    return _finished(done, least, findings)


def _finished(done: TestResults, least: int | None, findings: Findings) -> ExitCode:
    shares = None if done.covered is None else coverage_json(done.covered, done.sources)
    return findings.finish(
        done.code(least),
        tests=tests_json(done.ran, done.sources),
        scenarios=scenarios_json(done.flown, done.sources),
        summary=summary_json(done.ran) | {"left_out": done.left_out},
        coverage=None if shares is None else shares | {"least": least, "enough": not done.falls_short(least)},
    )


def _generate(files: Sequence[Path], request: GenerateRequest, findings: Findings, *, quiet: bool) -> ExitCode:
    """Generate the tests of one policy; `quiet`: only as a member of the JSON object."""
    done = generate(files, request)
    if isinstance(done, Refusal):
        return findings.end(done)
    if isinstance(done, NotGenerated):
        findings.report(done.diagnostics, done.sources)
        if done.refusal is not None:
            return findings.end(done.refusal)
        return findings.finish(exit_code(done.diagnostics))
    made = done.made
    if not quiet:
        if request.output is None:
            out_source(done.text)
        where = "" if request.output is None else f", in {request.output}"
        counted = f"{many(made.cases, 'case')} on {many(len(made.limits), 'limit')} of {done.policy}"
        say(f"{counted}{where}: review them before you keep them")  # the text may be on the standard output
        for label in made.without:
            say(f"no state was found that permits `{label}`; it has one case, with its present result")
        for each in made.unreached:
            say(f"not reached: {each.words}")
    return findings.finish(
        ExitCode.OK,
        policy=done.policy,
        cases=made.cases,
        limits=len(made.limits),
        without=list(made.without),
        unreached=[each._asdict() for each in made.unreached],
        text=done.text,
        path=None if request.output is None else str(request.output),
    )
