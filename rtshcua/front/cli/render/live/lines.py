"""The view in a pipe: one plain line or JSON object for each event."""

import textwrap
from collections.abc import Iterable, Sequence
from typing import Final

import msgspec

from rtshcua.app.fly.story import Asks, FlightPlanView, Happened, Happening, Message, Note, Snapshot, Summary, duration
from rtshcua.app.wording import many
from rtshcua.diagnostics.excerpt import escaped, visible
from rtshcua.evidence.gaps import seconds
from rtshcua.front.cli.width import typed
from rtshcua.model.step_number import number_of, step_words
from rtshcua.onboard.runtime.dispatcher import UNCONFIRMED
from rtshcua.wire.permit import WITHDRAWN

#: columns of a line for a person, where it can be chosen
WIDTH: Final = 80
#: columns that are left beside the time of a line
_BESIDE_TIME: Final = WIDTH - 13
#: what ends a flight early by somebody's word
_ALARMS: Final = {
    "recall": "RECALLED: no further step begins. In the air the policy's contingency flies",
    "cancellation": "CANCELLED by its proposer: no further step begins. In the air the policy's contingency flies",
    "taken-over": "TAKEN OVER: another pilot or program flies the vehicle. Nothing more is sent to it",
}


#: what a detail means to a person
_TOLD: Final = {WITHDRAWN: "nothing was sent: the step is tried again until its deadline"}


def plain(message: Message) -> Iterable[str]:
    """The lines for a person."""
    return map(visible, _plain(message))


def _plain(message: Message) -> Iterable[str]:
    match message:
        case FlightPlanView():
            yield f"mission {message.mission} under {message.policy} on {message.vehicle}, mode {message.mode}"
        case Happened(what):
            yield f"{what.t_us / 1_000_000:9.2f} s  {_sentence(what)}"
            yield from (f"{'':11}  {each}" for each in _banner(what))
        case Note(text):
            yield f"{'':11}  {text}"
        case Summary():
            yield from _ending(message)


def sentence(what: Happening) -> str:
    """Return an event as one line: its outcome or name, its subject, and the reason."""
    return visible(_sentence(what))


def _sentence(what: Happening) -> str:
    subject = what.subject
    if what.event != "decision":
        detail = "" if what.event == "dispatched" and subject else _TOLD.get(what.detail, what.detail)
        return f"{what.event:<11}  {subject}{'  ' if subject and detail else ''}{detail}".rstrip()
    why = ""
    if what.outcome != "allow":
        why = f"  because {what.reason}{f': `{what.clause}`' if what.clause else ''}"
        why += f"; instead {what.target}" if what.target else ""
        why += f"; {what.waits}" if what.waits else ""
    return f"{what.outcome:<11}  {subject}{why}"


def _banner(what: Happening) -> list[str]:
    """What a person must not miss of a happening."""
    if what.asks is None:
        return alarm(what)
    return asked(what.step, what.subject, what.asks)


def asked(step: int, subject: str, asks: Asks, width: int = _BESIDE_TIME) -> list[str]:
    """That a step begins to wait for people, beside whom nobody agreed yet."""
    return waiting_for(step, subject, asks, asks.until_us - asks.asked_us, (), width)


def alarm(what: Happening, width: int = _BESIDE_TIME) -> list[str]:
    """That somebody ended the flight, in words; empty for what is no such thing."""
    text = _ALARMS.get(what.event)
    return [] if text is None else textwrap.wrap(f"** {text} **", width)


def waiting_for(
    step: int, subject: str, asks: Asks, left_us: int | None, agreed: Sequence[str], width: int = _BESIDE_TIME
) -> list[str]:
    """That a step waits for people: whom, how long, and what they type. `agreed` are the roles of those who did."""
    missing = list(asks.roles)
    for role in agreed:
        if role in missing:
            missing.remove(role)
    whom = " and ".join(f"another {role}" if role in agreed else role for role in missing or asks.roles)
    told = [*textwrap.wrap(f"** WAITS FOR A PERSON: {whom} ** {step_words(step)}, {visible(subject)}", width)]
    left = "" if left_us is None else f"{max(0, -(-left_us // 1_000_000))} s left, then it is denied. "
    agrees = f"{' and '.join(agreed)} agreed. " if agreed else ""
    how = "Type in another terminal:" if asks.commands else "Nobody can answer: this run has no `--operator-socket`"
    told += textwrap.wrap(f"{left}{agrees}{how}", width)
    for words in asks.commands:
        if words[words.index("--role") + 1] in (missing or asks.roles):
            told += typed(words, width)
    return told


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
    if summary.images_taken or summary.images_missing or summary.images_failed:
        failed = f", {many(summary.images_failed, 'picture')} failed" if summary.images_failed else ""
        yield f"  images   {summary.images_taken} recorded, {summary.images_missing} missing{failed}"
    if summary.payload_failed:
        yield f"  payload  {many(summary.payload_failed, 'command')} failed"
    if summary.may_fly:
        yield f"  vehicle  {summary.may_fly}"
    yield from (f"  battery  {what}" for what in summary.battery)
    yield f"  log      {summary.log} ({many(summary.records, 'record')}, {whole})"
    yield from (f"  missing  {what}" for what in summary.missing)
    yield f"  next     {summary.next}"


def as_json(message: Message) -> Iterable[str]:
    """Yield one JSON object for each message, except for snapshots."""
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
