"""How `lint` says what it found: for a person, or in a form that a machine takes."""

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rtshcua import __version__
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.folding import folded
from rtshcua.diagnostics.render import render
from rtshcua.diagnostics.serialise import as_json
from rtshcua.front.cli.findings import ended, laid_out
from rtshcua.front.cli.linting.gathered import Gathered
from rtshcua.front.cli.width import columns


def written(form: str, told: Gathered, asked: Sequence[str], code: ExitCode, failing: frozenset[Severity]) -> str:
    """The report in one of the forms, for a file or a machine, ending in a newline, unless it is empty."""
    here = str(Path.cwd())
    if form == "human":
        return laid_out(render(folded(told.found), told.sources, columns()))
    if form == "github":
        from rtshcua.diagnostics.report.github import github

        return github(told.found, told.sources, here)
    if form == "junit":
        from rtshcua.diagnostics.report.junit import junit
        from rtshcua.diagnostics.report.suites import suites

        return junit(suites(told.found, told.sources, asked, failing))
    if form == "sarif":
        return _dumped(_sarif(told, code, here))
    tree = as_json(told.found, told.sources)
    ignored = as_json([each.diagnostic for each in told.ignored], told.sources)["diagnostics"]
    reasons = [{"reason": each.reason} for each in told.ignored]
    tree["ignored"] = [finding | reason for finding, reason in zip(ignored, reasons, strict=True)]
    return _dumped(tree | {"files": len(asked)} | ended(code, told.found))


def _sarif(told: Gathered, code: ExitCode, here: str) -> dict[str, Any]:
    from rtshcua.diagnostics.report.sarif import Ignored, sarif
    from rtshcua.front.cli.pages import read_page

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


def summary(told: Gathered, files: int, left_out: int) -> str:
    """What a run found, in a line: only where there is nothing to show."""
    parts = [f"nothing found in {files} file{'s' * (files != 1)}"]
    if told.ignored:
        parts.append(f"{len(told.ignored)} ignored")
    if left_out:
        parts.append(f"{left_out} file{'s' * (left_out != 1)} left out")
    return ", ".join(parts)


def statistics(told: Gathered) -> str:
    """How often each code was found, the most frequent first, and how often it was ignored."""
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
