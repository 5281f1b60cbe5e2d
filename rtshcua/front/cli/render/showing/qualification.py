"""A qualification record for a person: a line a check; of those that fail, what was expected and what to do."""

from collections.abc import Iterator, Mapping
from struct import calcsize, unpack
from typing import Any, Final

import msgspec

from rtshcua.adapters.doctor.identity import unflown
from rtshcua.app.wording import utc
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.onboard.ports import Ending
from rtshcua.wire import cose, names
from rtshcua.wire.qualification import MAX_QUALIFICATION, CheckOutcome, Qualification, read_qualification

_MARKS: Final[Mapping[int, str]] = {
    CheckOutcome.HELD: "ok",
    CheckOutcome.FAILED: "FAIL",
    CheckOutcome.TOLD: "note",
    CheckOutcome.UNCHECKED: "-",
}


def told(record: Qualification, broken: Ending | None) -> Iterator[str]:
    """The table. `broken`: how a qualification was broken off, of which no record is made."""
    width = max((len(each.slug) for each in record.checks), default=0)
    yield f"{record.vehicle}: {record.firmware.text}, parameters {record.digest.hex()[:16]}"
    for each in record.checks:
        yield f"{_MARKS[each.outcome]:<5} {each.slug:<{width}}  {each.measured}"
        wanted = each.outcome in (CheckOutcome.FAILED, CheckOutcome.TOLD)
        for label, text in (("expected", each.expected), ("help", each.advice)):
            if wanted and text:
                yield f"{'':<5} {'':<{width}}  {label}: {text}"
    counts = {mark: sum(each.outcome == outcome for each in record.checks) for outcome, mark in _MARKS.items()}
    flown = f"{record.flown_us // 1_000_000} s of flight"
    if broken is not None:
        yield f"broken off ({broken}) after {flown}: no record is made"
        return
    left_out = unflown(record)
    end = "NOT qualified" if not record.qualifies else "partly qualified" if left_out else "qualified"
    yield f"{end}: {counts['ok']} hold, {counts['FAIL']} do not, {counts['-']} not checked, in {flown}"
    if left_out:
        yield f"not flown: {', '.join(left_out)}; `doctor` and `run` accept it after all sorties were flown"


def _number(octets: bytes) -> str:
    """A parameter's value as it is set; as its octets where they are no number."""
    return f"{unpack('>d', octets)[0]:.10g}" if len(octets) == calcsize(">d") else octets.hex()


def described(record: Qualification) -> dict[str, Any]:
    """The record for a program."""
    return {
        "vehicle": record.vehicle,
        "firmware": record.firmware.text,
        "parameters": record.digest.hex(),
        "pilot": record.pilot,
        "flown_us": record.flown_us,
        "qualified": record.qualifies and not unflown(record),
        "not_flown": unflown(record),
        "checks": [
            msgspec.structs.asdict(each) | {"outcome": CheckOutcome(each.outcome).name.lower()}
            for each in record.checks
        ],
    }


def is_qualification(data: bytes) -> bool:
    """Whether these bytes, which look like a signed envelope, say that they hold a record. Raises `EnvelopeError`."""
    limit = max(len(data), MAX_QUALIFICATION)
    return cose.unverified(data, limit=limit).content_type == names.QUALIFICATION.content_type


def show_qualification(page: TextPage, data: bytes) -> dict[str, object]:
    """Add a record to the page, and return it as JSON. Raises `Untrusted`."""
    envelope = cose.unverified(data, limit=max(len(data), MAX_QUALIFICATION))
    record = read_qualification(envelope.payload)
    page.head(f"Qualification record of {len(data)} bytes (not verified: `run` and `doctor` do that)")
    page.row("signed by", f"key {envelope.kid.hex()}")
    page.row("issued", utc(record.issued_at_us))
    page.row("consent", f"pilot {record.pilot}" if record.pilot else "a simulation")
    page.row("policy", record.policy.hex())
    page.rows("logs", record.logs)
    page.rows("parameters", [f"{name} {_number(value)}" for name, value in record.parameters])
    for line in told(record, None):
        page.text(line)
    return {"kind": "qualification", "verified": False, "key": envelope.kid.hex()} | described(record)
