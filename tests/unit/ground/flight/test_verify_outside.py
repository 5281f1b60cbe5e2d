"""What others than the log's keys show, in a browser: the boundary's own evidence, and cosignatures of witnesses."""

import re
from base64 import b64decode, b64encode
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from random import Random
from typing import Any

import pytest
from msgspec.structs import replace
from playwright.sync_api import Browser

from reference import log_vectors
from reference.attested_flight import attested, second
from reference.browser import CHROMIUM
from reference.forgery import edit, read, signed, write
from reference.log_vectors import WITNESSES, anchor, close, effect, genesis, log, seal
from reference.page_script import Script, compare, script_of
from reference.verifiers import ROOT_KEY
from rtshcua.ground.flight.embedding import script as script_text
from rtshcua.model.outcome import WIRE_REASONS
from rtshcua.wire.statement import Statement, open_statement, sign
from virtual import case

pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]
KEYS = {case.BOUNDARY_KEY.kid: case.BOUNDARY_KEY.verification()}
LINES = list(attested())
#: of all forged fields of the boundary's flight
SAMPLE = 150


@pytest.fixture(scope="module")
def script(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Script]:
    with script_of(browser, tmp_path_factory.mktemp("page")) as made:
        yield made


def test_reasons_have_their_numbers() -> None:
    listed = re.search(r"const REASONS = \[(.*?)\];", script_text(), re.DOTALL)
    assert listed is not None
    assert re.findall(r'"([^"]+)"', listed[1]) == [reason.value for reason in WIRE_REASONS]


# ------------------------------------------------------------------------------------------------ the boundary


def _other(value: object) -> object:
    match value:
        case int():
            return value + 1
        case str() if re.fullmatch("[0-9a-f]{2,}", value):
            return value[:-1] + ("0" if value[-1] != "0" else "1")
        case str():
            return value + "x"
        case dict():
            return value | {name: _other(each) for name, each in value.items() if isinstance(each, int | list)}
        case [first, *rest]:
            return [_other(first), *rest]
    return value


def _altered() -> Iterator[tuple[str, list[bytes]]]:
    """Every record with each of its fields changed, by a holder of all keys but the boundary's."""
    structural = {"_prev", "seq", "type", "checkpoint", "digest", "next_key", "epoch", "bytes", "records", "utc_us"}
    for number, line in enumerate(LINES[1:], 1):
        record = read(line)
        for name in sorted({*record} - structural):
            if _other(record[name]) != record[name]:
                forged = edit(line, **{name: _other(record[name])})
                yield f"{number}: {name}", [*LINES[:number], forged, *LINES[number + 1 :]]


def _stalled(number: int) -> list[bytes]:
    """A gap of 30 s before a record, which the boundary's clock does not show."""
    times = [{name: read(line)[name] + 30_000_000 for name in ("at_us", "utc_us")} for line in LINES[number:]]
    silent = read(LINES[number])["at_us"] - read(LINES[number - 1])["at_us"] + 30_000_000
    gap = read(LINES[number]) | times[0] | {"event": "stalled", "detail": f"{silent} us"}
    later = [edit(line, **moved) for line, moved in zip(LINES[number:], times, strict=True)]
    return [*LINES[:number], write(gap), *later]


def _moved() -> Iterator[tuple[str, list[bytes]]]:
    for number in range(1, len(LINES) - 1):
        if read(LINES[number]).get("event") == "boundary":
            yield f"gap before {number}", _stalled(number)
        yield f"{number} removed", [*LINES[:number], *LINES[number + 1 :]]
        yield f"{number} twice", [*LINES[:number], LINES[number], *LINES[number:]]
        before, line = LINES[number - 1 : number + 1]
        if number > 1:
            times = {name: read(before)[name] for name in ("at_us", "utc_us", "utc_error_us")}
            yield f"{number} moved", [*LINES[: number - 1], edit(line, **times), before, *LINES[number + 1 :]]
        lost = read(line) | dict.fromkeys(("kind", "step", "link", "token"), -1)
        if lost["type"] == "effect":
            lost |= {"event": "boundary-lost", "detail": "", "durability": 1}
            yield f"lost before {number}", [*LINES[:number], write(lost), *LINES[number:]]
            yield f"lost at {number}", [*LINES[:number], write(lost)]


def _stated() -> Iterator[tuple[str, list[bytes]]]:
    """Statements of another content by the boundary's own key, and those of its other session."""
    numbers = [number for number, line in enumerate(LINES) if read(line).get("event") == "boundary"]
    for number in numbers:
        said = open_statement(b64decode(read(LINES[number])["detail"]), KEYS)
        changes: list[dict[str, Any]] = [
            {name: _other(getattr(said, name))}
            for name in Statement.__struct_fields__
            if isinstance(getattr(said, name), int)
        ]
        changes += [{"final": not said.final}, {"marks": said.marks[:-8]}, {"marks": bytes(len(said.marks))}]
        changes += [{"flight": bytes(16)[:-1] + b"\1"}, {"before": bytes([9]) * 32}, {"digest": bytes(32)}]
        changes += [{"utc_us": said.utc_us + 60_000_000}, {"utc_error_us": 1 << 52}, {"at_us": 0}]
        for change in changes:
            data = sign(replace(said, **change), case.BOUNDARY_KEY)
            line = edit(LINES[number], detail=b64encode(data).decode())
            yield f"{number}: {[*change]}", [*LINES[:number], line, *LINES[number + 1 :]]
    theirs = [line for line in second() if read(line).get("event") == "boundary"]
    for number, line in zip(numbers, theirs, strict=True):
        swapped = edit(LINES[number], detail=read(line)["detail"])
        yield f"{number} of another session", [*LINES[:number], swapped, *LINES[number + 1 :]]


@pytest.mark.parametrize("kind", [_altered, _moved, _stated])
def test_what_the_boundary_did_not_make_fails_as_in_python(script: Script, kind: Any) -> None:
    made = list(kind())
    chosen = made if len(made) <= SAMPLE else Random(8).sample(made, SAMPLE)
    found = compare(script, [(name, b"".join(signed(lines)), ROOT_KEY) for name, lines in chosen])
    slugs = {slug for _, slug, _ in found.values()}
    assert (
        len([slug for slug in slugs if slug.startswith("boundary/")]) >= {_altered: 3, _moved: 6, _stated: 7}[kind]
    ), slugs


# ------------------------------------------------------------------------------------------------ witnesses

ONE, TWO, THREE = WITNESSES
HONEST = log(genesis(), effect(10), seal(20, 1), effect(30), seal(40, 2), effect(50), close(60))
SEALS = (2, 4)


def _anchored(*notes: str, edited: bool = False, short: bool = False) -> list[bytes]:
    """A log that records these notes at its end."""
    ticks = count(50)
    records = [genesis(), effect(10, detail="edited" if edited else ""), seal(20, 1), effect(30)]
    records += [] if short else [seal(40, 2)]
    records += [effect(next(ticks), event="anchored", detail=note) for note in notes]
    return log(*records, close(90))


def notes() -> dict[str, list[bytes]]:
    one, two = (anchor(HONEST[number], [ONE, TWO]) for number in SEALS)
    few, other = anchor(HONEST[4], [THREE]), anchor(log(genesis(boot="11" * 16), effect(10), close(20))[0], [ONE, TWO])
    wrong = one[:-20] + ("A" if one[-20] != "A" else "B") + one[-19:]
    early = log(genesis(), effect(10, event="anchored", detail=two), seal(20, 1), effect(30), seal(40, 2), close(60))
    return {
        "honest": _anchored(one, two),
        "one witness": _anchored(anchor(HONEST[4], [ONE])),
        "the same witness twice": _anchored(anchor(HONEST[4], [ONE, ONE])),
        "different sizes": _anchored(one, few),
        "out of order": _anchored(two, one, few),
        "another log": _anchored(other),
        "wrong signature": _anchored(wrong, two),
        "not a note": _anchored("", "\n\n", one[:-1], one.replace("\n\n", "\n"), "x" * 20_000),
        "rewritten": _anchored(one, two, edited=True),
        "rewritten, and one saw it": _anchored(few, edited=True),
        "cut": _anchored(two, short=True),
        "recorded before": early,
        "longer": _anchored(anchor(log(genesis(), *(effect(n) for n in range(20)), seal(20, 1))[-1], [ONE])),
        "vector": (log_vectors.FOLDER / "anchored.jsonl").read_bytes().splitlines(keepends=True),
    }


def test_witnesses_are_read_as_in_python(script: Script, tmp_path: Path) -> None:
    made = notes()
    found = compare(script, [(name, b"".join(lines), ROOT_KEY) for name, lines in made.items()])
    assert {each[1] for each in found.values()} == {"", "anchor/root", "anchor/beyond"}
    shown = script.result(b"".join(made["honest"]))["shown"]
    assert any("records 0 to 4: seen by enough witnesses" in each for each in shown)
    alone = script.result(b"".join(made["one witness"]))
    assert not any("seen by enough witnesses" in each for each in alone["shown"])
    assert any("7 records are unanchored" in each for each in alone["notShown"])
