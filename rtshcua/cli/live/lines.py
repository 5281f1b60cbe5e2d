"""The view in a pipe: one plain line an event, or one JSON object."""

from collections.abc import Iterable

import msgspec

from rtshcua.cli.live.story import Happened, Happening, Message, Note, Plan, Snapshot, Summary, duration
from rtshcua.cli.shown import many
from rtshcua.diagnostics.excerpt import escaped, visible
from rtshcua.evidence.gaps import seconds
from rtshcua.model.step_number import number_of
from rtshcua.onboard.runtime.dispatcher import UNCONFIRMED


def plain(message: Message) -> Iterable[str]:
    """The lines for a person."""
    return map(visible, _plain(message))


def _plain(message: Message) -> Iterable[str]:
    match message:
        case Plan():
            yield f"mission {message.mission} under {message.policy} on {message.vehicle}, mode {message.mode}"
        case Happened(what):
            yield f"{what.t_us / 1_000_000:9.2f} s  {_sentence(what)}"
        case Note(text):
            yield f"{'':11}  {text}"
        case Summary():
            yield from _ending(message)


def sentence(what: Happening) -> str:
    """A happening as one line: the outcome or event, what it is about, and why."""
    return visible(_sentence(what))


def _sentence(what: Happening) -> str:
    subject = what.subject
    if what.event != "decision":
        detail = "" if what.event == "dispatched" and subject else what.detail
        return f"{what.event:<11}  {subject}{'  ' if subject and detail else ''}{detail}".rstrip()
    why = ""
    if what.outcome != "allow":
        why = f"  because {what.reason}{f': `{what.clause}`' if what.clause else ''}"
        why += f"; instead {what.target}" if what.target else ""
        why += f"; {what.waits}" if what.waits else ""
    return f"{what.outcome:<11}  {subject}{why}"


def ending(summary: Summary) -> Iterable[str]:
    """The last lines: what flew, what was decided, where the log is, what to do next."""
    return map(visible, _ending(summary))


def _ending(summary: Summary) -> Iterable[str]:
    counts = ", ".join(f"{count} {name}" for name, count in summary.outcomes.items() if count) or "nothing decided"
    whole = "whole" if summary.whole else "evidence NOT whole"
    if summary.gaps_us:
        whole += f", but for a gap of {seconds(summary.gaps_us)}: the computer stood still"
    yield f"{summary.ending}: {summary.steps_done} of {summary.steps} steps done in {duration(summary.flight_us)}"
    yield f"  decided  {counts}"
    yield from (f"  unseen   {what}: {UNCONFIRMED}" for what in summary.unconfirmed)
    yield f"  log      {summary.log} ({many(summary.records, 'record')}, {whole})"
    yield from (f"  missing  {what}" for what in summary.missing)
    yield f"  next     {summary.next}"


def as_json(message: Message) -> Iterable[str]:
    """One object a line; snapshots are for screens."""
    match message:
        case Snapshot():
            return
        case Happened(what):
            told = msgspec.to_builtins(what)
            if what.step >= 0:
                told["step_number"] = number_of(what.step)
            yield escaped(msgspec.json.encode(told).decode())
        case _:
            yield escaped(msgspec.json.encode(message).decode())
