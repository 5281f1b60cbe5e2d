"""Run `rtshcua check` from parsed options and print the result."""

import textwrap
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rtshcua.app.check import CheckedMission, CheckRequest, CheckResult, check, draw, nothing_compared
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.files import SPECIFICATION
from rtshcua.app.pictures import STANDARD_OUTPUT
from rtshcua.app.wording import moment, utc
from rtshcua.diagnostics.codes import UNKNOWN_NAME
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.render.bounds import bounds_dict, bounds_told, steps_told
from rtshcua.front.cli.render.drawn import tell_drawn
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.render.progress import watched
from rtshcua.front.cli.stdout import out
from rtshcua.ground.prove.survey_quality import pictures_text
from rtshcua.ground.report.report_model import ChangeView


def check_sources(
    paths: Sequence[Path],
    *,
    since: Path | None = None,
    with_: Sequence[Path] = (),
    map_: Path | None = None,
    picture: Path | None = None,
    at: str | None = None,
    deny_warnings: bool = False,
    as_json: bool = False,
) -> ExitCode:
    """Check sources and print the findings; `rtshcua.front.cli.commands.check` describes the options."""
    findings = Findings(json=as_json, deny_warnings=deny_warnings)
    issued_at_us = 0 if at is None else moment(at)
    if issued_at_us is None:
        return findings.refuse(ExitCode.USAGE, "usage", f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
    now_us = time.time_ns() // 1_000
    request = CheckRequest(paths, since, with_, map_, issued_at_us, now_us, picture=picture, as_json=as_json)
    quiet = as_json or picture == STANDARD_OUTPUT
    found = check(request, watched)
    if isinstance(found, Refusal):
        return findings.end(found)
    code = exit_code(found.diagnostics) if findings.report(found.diagnostics, found.sources) else ExitCode.OK
    root = found.programs[0]
    alone = len(root.asked) == 1 and not with_ and root.name.lower().endswith(SPECIFICATION)
    if alone and not as_json and any(each.code is UNKNOWN_NAME for each in found.diagnostics):
        say(" help: the names in a specification are declared in its policy's sources; pass them with `--with FILE`")
    if code is ExitCode.OK and not quiet:
        _tell(found, since, request.now_us)
    if map_ is not None or picture is not None:
        drawn = draw(found, request)
        if isinstance(drawn, Refusal):
            return findings.end(drawn)
        tell_drawn(drawn, picture, findings, quiet=quiet)
    refused = nothing_compared(found, since) if code is ExitCode.OK and since is not None else None
    return findings.end(refused) if refused is not None else findings.finish(code, **_as_json(found))


def _as_json(found: CheckResult) -> dict[str, object]:
    """Return the members that `check` adds to the object of `--json`."""
    versions = [
        {
            "policy": each.name,
            "version": each.version,
            "earlier": each.earlier,
            "changes": [asdict(change) for change in each.changes],
        }
        for each in found.versions
    ]
    return {
        "missions": [
            {"mission": each.name, "file": each.file}
            | bounds_dict(each.bounds)
            | {"pictures": [one._asdict() for one in each.pictures]}
            for each in found.missions
        ],
        "versions": versions,
        "not_here": found.not_here,
        "left_out": [each._asdict() for each in found.left_out],
        "issued_now": [{"code": each.code.id, "message": each.message} for each in found.now],
    }


def _tell(found: CheckResult, since: Path | None, now_us: int) -> None:
    """Print the result for sources without errors."""
    empty = [name for name, source in found.sources.items() if not source.text.strip()]
    out(f"no errors in {len(found.sources)} file{'s' * (len(found.sources) > 1)}")
    for name in empty:
        out(f"note: `{name}` is empty")
    for mission in found.missions:
        out(f"{_named(mission, found.missions)}: {bounds_told(mission.bounds)}")
        _tell_steps(mission)
    for left_out in found.left_out:
        out(left_out.told())
    for refused in found.now:
        out(f"if issued now, it would be refused: {refused.code.id}, {refused.message}")
    if found.now:
        at = utc(now_us).replace(" ", "T")
        out(f"the dates of zones apply at the time of issue; run `rtshcua check --at {at}` for the locations")
    for each in found.versions:
        same = "" if each.changes else "; no change in meaning"
        out(f"{each.name}: version {each.version}, and {each.earlier} in {since}{same}")
        for change in each.changes:
            _tell_change(change)
    for name in found.not_here if found.versions else ():
        out(f"{name}: only in {since}; no policy here to compare with")


def _tell_steps(mission: CheckedMission) -> None:
    """Print the bounds of each step, and the pictures of its survey."""
    pictures = {each.step_number: pictures_text(each) for each in mission.pictures}
    for number, line in enumerate(steps_told(mission.bounds), 1):
        out(line)
        if number in pictures:
            out_wrapped("    ", pictures[number])


def _tell_change(change: ChangeView) -> None:
    """Print one change of a policy: its direction, and its text before and now."""
    out_wrapped(f"  {change.direction:<11}  ", change.what)
    for what, lines in (("before", change.before), ("now", change.after)):
        for line in lines or ("(absent)" if what == "before" else "(removed)",):
            out_wrapped(f"  {'':11}    {what:<6}  ", line)


def out_wrapped(head: str, text: str) -> None:
    """Print text wrapped at 80 columns, with continuation lines indented to the width of `head`."""
    body = " ".join(text.split())
    beneath = " " * len(head)
    for line in textwrap.wrap(body, 80, initial_indent=head, subsequent_indent=beneath, break_on_hyphens=False):
        out(line)


def _named(mission: CheckedMission, missions: tuple[CheckedMission, ...]) -> str:
    """Return a mission's name, with its file if another mission has the same name."""
    alone = sum(each.name == mission.name for each in missions) == 1
    return mission.name if alone else f"{mission.name} ({mission.file})"
