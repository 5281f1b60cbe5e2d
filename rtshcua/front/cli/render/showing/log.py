"""Show a log as a timeline, without verification; it ends at the first line that is not a record."""

from collections.abc import Iterable, Iterator

import msgspec

from rtshcua.adapters.boundary.optee import DEVELOPMENT
from rtshcua.app.telling.record_prose import Names, bundle_of
from rtshcua.app.wording import true_to, utc
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, DecisionRecord, Effect, Genesis
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.model.step_number import number_of


def show_log(page: TextPage, lines: Iterable[bytes]) -> dict[str, object]:
    """Add a log to the page, and return it as JSON."""
    start_us, names, entries, stopped = 0, Names(None), [], None
    for number, record in enumerate(_records(lines)):
        if isinstance(record, Flaw):
            stopped = f"line {number + 1} is not a record: {record.text}"
            break
        if isinstance(record, Genesis):
            start_us, names = record.at_us, Names.of(record)
            _head(page, record)
            page.head("Timeline (not verified: `rtshcua verify-log` does that)")
        names.follow(record)
        what = names.tell(record)
        entries.append(_entry(record, what))
        page.text(f"{record.seq:>5} {(record.at_us - start_us) / 1_000_000:>10.3f} s  {what}")
    if stopped is not None:
        page.head("The rest is not shown")
        page.row("because", stopped)
    return {"kind": "log", "verified": False, "records": entries, "stopped": stopped}


def _records(lines: Iterable[bytes]) -> Iterator[AnyRecord | Flaw]:
    return (read(line) for line in lines)


def _head(page: TextPage, genesis: Genesis) -> None:
    page.head(f"Log of mission {genesis.mission} on {genesis.vehicle}")
    page.row("begun", f"{utc(genesis.utc_us)}, {true_to(genesis.utc_error_us)}")
    found = bundle_of(genesis)
    if found is not None:
        page.row("received", _received(genesis, found.mission.issued_at_us))
    page.row("mode", f"optee, a model for development: {DEVELOPMENT}" if genesis.mode == "optee" else genesis.mode)
    page.row("log key", genesis.log_kid)
    page.row("boot", genesis.boot)
    if genesis.before is not None:
        page.row("follows", f"the log whose last line has the hash {genesis.before}")


def _received(genesis: Genesis, issued_at_us: int) -> str:
    """How long the bundle took to come on board: what the paper calls `L_src` and `L_comp`, and the way."""
    took_us = genesis.utc_us - (genesis.at_us - genesis.received_us) - issued_at_us
    return f"{took_us / 1_000_000:.3f} s after the mission was issued"


def _entry(record: AnyRecord, what: str) -> dict[str, object]:
    """A record for a program, without the genesis' bulk."""
    fields: dict[str, object] = msgspec.to_builtins(record)
    about = (
        {"step_number": number_of(record.step)}
        if isinstance(record, DecisionRecord | Effect) and record.step >= 0
        else {}
    )
    return {"what": what, **{name: value for name, value in fields.items() if name not in ("bundle", "root")}, **about}
