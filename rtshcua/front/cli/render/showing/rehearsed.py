"""Show the result of `run --dry-run` as text or JSON."""

import msgspec

from rtshcua.app.fly.dry_run import FlightRehearsal
from rtshcua.app.telling import prose
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.render.showing.page import TextPage, for_terminal
from rtshcua.front.cli.stdout import out_json, out_rendered
from rtshcua.model.outcome import Outcome
from rtshcua.model.step_number import number_of


def show_rehearsal(rehearsal: FlightRehearsal, *, as_json: bool) -> ExitCode:
    """Print the result, and return the exit code."""
    if as_json:
        out_json(msgspec.json.encode(_object(rehearsal)).decode())
    else:
        page = _page(rehearsal)
        if rehearsal.interrupted:
            page.text("(interrupted: the state at that time)")
        out_rendered(str(page))
    return rehearsal.exit_code


def _page(rehearsal: FlightRehearsal) -> TextPage:
    loaded, found, _, refusal, unready, _ = rehearsal
    mission, page = loaded.bundle.mission, for_terminal()
    page.head(f"Rehearsal of {mission.name} on {loaded.vehicle}: nothing is sent, and the bundle can still fly")
    if refusal is not None:
        page.row("would not begin", refusal)
    if unready is not None:
        page.row("not ready", unready)
    for each in found:
        invocation, decision = mission.invocations[each.step], each.decision
        outcome = decision.outcome.name.lower()
        called = prose.call(loaded.bundle.policy, invocation)
        page.text(f"{number_of(each.step):>3}  {outcome:<8}  {mission.phases[invocation.phase]:<12}  {called}")
        if decision.outcome is not Outcome.ALLOW:
            quoted = prose.quoted(loaded.bundle.policy, invocation, decision.clause)
            clause = f": {quoted}" if quoted else ""
            page.row("because", f"{decision.reason.value}{clause}", indent=7, width=10)
            if each.observing:
                page.row(
                    "waits",
                    "until the condition was observed for its whole window, from the start of the run",
                    indent=7,
                    width=10,
                )
            page.rows("would pass", [prose.would_pass(one) for one in each.nearest], indent=7, width=10)
    page.text("")
    waits = sum(each.hopeful and each.decision.outcome is not Outcome.ALLOW for each in found)
    admitted = sum(each.decision.outcome is Outcome.ALLOW for each in found)
    others = len(found) - admitted - waits
    page.text(f"{admitted} of {len(found)} steps admitted, {waits} waiting for later events, {others} would not fly")
    page.text("(a later step is judged at the end position of the previous ones, with the present state)")
    return page


def _object(rehearsal: FlightRehearsal) -> dict[str, object]:
    loaded, found, notes, refusal, unready, interrupted = rehearsal
    mission = loaded.bundle.mission
    steps = []
    for each in found:
        invocation, decision = mission.invocations[each.step], each.decision
        steps.append(
            {
                "step": each.step,
                "step_number": number_of(each.step),
                "phase": mission.phases[invocation.phase],
                "text": prose.call(loaded.bundle.policy, invocation),
                "outcome": decision.outcome.name.lower(),
                "reason": decision.reason.value,
                "clause": None if decision.clause is None else decision.clause.text,
                "target": None if decision.target is None else decision.target.text,
                "nearest": [one._asdict() for one in each.nearest],
                "hopeful": each.hopeful,
                "observing": each.observing,
            }
        )
    return {
        "event": "rehearsal",
        "mission": mission.name,
        "vehicle": loaded.vehicle,
        "ready": unready is None,
        "unready": unready,
        "steps": steps,
        "exit_code": int(rehearsal.exit_code),
        "refusal": refusal,
        "notes": list(notes),
        "interrupted": interrupted,
    }
