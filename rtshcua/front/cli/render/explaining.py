"""`rtshcua verify-log --explain N`: audit a log and describe its record N."""

import json
from pathlib import Path

from rtshcua.app.documents import no_log
from rtshcua.app.logs import NO_LOG_HELP, is_log, log_of, logs_meant, report_code
from rtshcua.app.verify_log import VerifyRequest, audited
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.faults import fail
from rtshcua.front.cli.render.showing.page import for_terminal
from rtshcua.front.cli.render.showing.record import Told, show_record
from rtshcua.front.cli.stdout import out_json, out_rendered


def explained(logs: list[Path], number: int, request: VerifyRequest, *, as_json: bool) -> ExitCode:
    """Print record `number` of one log, and return the exit code of the log's audit."""
    logs = logs_meant(logs)
    if len(logs) != 1:
        return fail(ExitCode.USAGE, "`--explain` requires exactly one log", f"found {len(logs)} logs; pass one of them")
    path = log_of(logs[0])
    if not is_log(path):
        return fail(ExitCode.INPUT, *no_log(log_of(logs[0]), logs[0], NO_LOG_HELP))
    told = Told(number)
    report = audited(path, request, each=told.take).report
    if told.record is None:
        if report.failure is None:
            return fail(ExitCode.INPUT, f"`{path}` has no record {number}: it ends after {report.records}")
        slug = report.failure.slug
        text = (
            f"`{path}` fails before record {number}, at record {report.failure.record}: {slug}, {report.failure.text}"
        )
        return fail(report_code(report), text, slug=slug)
    code = report_code(report)
    page = for_terminal()
    shown = show_record(page, told, report)
    if as_json:
        head = {"log": str(path), "verdict": report.verdict.value, "exit_code": int(code)}
        out_json(json.dumps({**head, **shown}, ensure_ascii=False))
    else:
        out_rendered(str(page))
    return code
