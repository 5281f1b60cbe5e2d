"""Run `rtshcua lint` without typer: call the service and print or write its report."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

from rtshcua import __version__
from rtshcua.app.exit_codes import exit_code_of, words_of
from rtshcua.app.lint.findings import LintFindings
from rtshcua.app.lint.scope import LintOptions
from rtshcua.app.lint.service import LintRun, lint
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import folded
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.render import render
from rtshcua.diagnostics.serialise import as_json
from rtshcua.front.cli.faults import say, tell
from rtshcua.front.cli.render.findings import Findings, ended, laid_out
from rtshcua.front.cli.stdout import out, out_json, out_rendered
from rtshcua.front.cli.width import columns


def run(options: LintOptions) -> ExitCode:
    """Lint, apply fixes if requested, and print the report."""
    done = lint(options)
    if isinstance(done, Refusal):
        return Findings(json=options.form == "json" and options.output is None).end(done)
    if done.fixed is not None and options.diff:
        from rtshcua.front.cli.render.diffs import unified

        for name, data in done.fixed.files.items():
            out_rendered("".join(unified(name, done.fixed.before[name], data)), end="")
        return ExitCode.DIAGNOSTICS if done.fixed.files else ExitCode.OK
    code = done.code
    for name, why in done.unwritten.items():
        code = exit_code_of(why)
        tell(code, f"cannot write `{name}`: {words_of(why)}")
    if options.form == "human" and options.output is None:
        _show(done)
        return code
    text = _written(done, code)
    if options.output is None:
        out_json(text, end="") if options.form in ("json", "sarif") else out_rendered(text, end="")
        return code
    from rtshcua.adapters.store.writing import write_out

    write_out(options.output, text.encode("utf-8"))
    _show(done)
    return code


def _show(done: LintRun) -> None:
    """Print the findings for a person."""
    found = done.findings
    for name in () if done.fixed is None else done.fixed.refused:
        say(f"note: the fixes of `{name}` were not applied, because they would cause an error")
    Findings(json=False).report(found.found, found.sources)
    files = 0 if done.fixed is None else len(done.fixed.files)
    if files:
        out(f"fixed {files} file{'s' * (files != 1)}")
    if done.options.statistics and (found.found or found.ignored):
        out(*_statistics(found).split("\n"))
    if not found.found:
        out(_summary(found, len(done.names), done.scope.left_out))
    elif found.ignored:
        say(f"{len(found.ignored)} more {'is' if len(found.ignored) == 1 else 'are'} ignored")


def _written(done: LintRun, code: ExitCode) -> str:
    """Return the report in the requested format; it ends in a newline unless it is empty."""
    here, form, told, asked = str(Path.cwd()), done.options.form, done.findings, done.names
    if form == "human":
        return laid_out(render(folded(told.found), told.sources, columns()))
    if form == "github":
        from rtshcua.diagnostics.report.github import github

        return github(told.found, told.sources, here)
    if form == "junit":
        from rtshcua.diagnostics.report.junit import junit, suites

        failing = frozenset[Severity]().union(*(done.failing(each) for each in told.found))
        return junit(suites(told.found, told.sources, asked, failing))
    if form == "sarif":
        return _dumped(_sarif(told, code, here))
    tree = as_json(told.found, told.sources)
    ignored = as_json([each.diagnostic for each in told.ignored], told.sources)["diagnostics"]
    reasons = [{"reason": each.reason} for each in told.ignored]
    tree["ignored"] = [finding | reason for finding, reason in zip(ignored, reasons, strict=True)]
    return _dumped(tree | {"files": len(asked)} | ended(code, told.found))


def _sarif(told: LintFindings, code: ExitCode, here: str) -> dict[str, Any]:
    from rtshcua.diagnostics.report.sarif import Ignored, sarif
    from rtshcua.front.cli.render.pages import read_page

    every = {each.code for each in told.found} | {each.diagnostic.code for each in told.ignored}
    return sarif(
        told.found,
        told.sources,
        version=__version__,
        code=code,
        ignored=[Ignored(each.diagnostic, each.reason, each.at) for each in told.ignored],
        pages={each.id: read_page(each) for each in every},
        base=here,
    )


def _summary(told: LintFindings, files: int, left_out: int) -> str:
    """Return the summary line of a run without findings to show."""
    parts = [f"nothing found in {files} file{'s' * (files != 1)}"]
    if told.ignored:
        parts.append(f"{len(told.ignored)} ignored")
    if left_out:
        parts.append(f"{left_out} file{'s' * (left_out != 1)} left out")
    return ", ".join(parts)


def _statistics(told: LintFindings) -> str:
    """Return one line for each code, most frequent first: findings, and how many of them are ignored."""
    found = Counter(each.code for each in told.found)
    ignored = Counter(each.diagnostic.code for each in told.ignored)
    rows = sorted(found.keys() | ignored.keys(), key=lambda code: (-found[code], -ignored[code], code.id))
    lines = [
        f"{found[code]:>5}  {code.id} {code.slug}" + (f" ({ignored[code]} ignored)" if ignored[code] else "")
        for code in rows
    ]
    return "\n".join(lines)


def _dumped(tree: dict[str, Any]) -> str:
    return json.dumps(tree, indent=2, ensure_ascii=False) + "\n"
