"""Lines about clients: each client has its own share of the flight's log, and `gateway.jsonl` has all as plain JSON."""

import json
from pathlib import Path

from rtshcua.app.gateway.gateway_service import ClientJournal, ClientRecords


def test_a_client_that_is_refused_a_lot_leaves_the_others_their_turn() -> None:
    records = ClientRecords()
    assert records.next() is None
    for number in range(300):
        records.add("noisy", f"noisy {number}")
    records.add("calm", "calm 0")
    records.add("calm", "calm 1")
    taken = [records.next() for _ in range(60)]
    assert taken[:5] == ["noisy 250", "calm 0", "noisy 251", "calm 1", "noisy 252"]
    assert taken[51:] == ["noisy 299", *[None] * 8]


def test_the_journal_has_one_object_a_line(tmp_path: Path) -> None:
    journal = ClientJournal(tmp_path / "gateway.jsonl")
    journal.keep({"at_us": 1, "client": "script", "effect": "refused", "answer": "takeoff denied"})
    journal.close()
    (line,) = (tmp_path / "gateway.jsonl").read_text().splitlines()
    assert json.loads(line) == {"at_us": 1, "client": "script", "effect": "refused", "answer": "takeoff denied"}
