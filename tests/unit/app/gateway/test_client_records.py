"""Lines about clients: each client has its own share of the flight's log, and `gateway.jsonl` has all as plain JSON."""

import json
from pathlib import Path

from rtshcua.app.gateway.gateway_service import ClientJournal, ClientRecords, answers_first
from rtshcua.ground.gateway.client_frames import made
from rtshcua.ground.gateway.interface import Action, Cancel, ClientNote, ToClient, Withdraw, Withhold
from rtshcua.mavlink import layouts
from rtshcua.mavlink.framing import frames_in


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


def test_answers_come_before_everything_else_and_together() -> None:
    """In order for each client, in datagrams that are not fragmented; what is withheld stays between them."""
    texts = [made(layouts.STATUSTEXT, {"text": f"text {each}".encode() * 7}, (1, 1), each) for each in range(30)]
    withheld, note = Withhold(1, frozenset({layouts.HEARTBEAT})), ClientNote({"client": "script", "effect": "refused"})
    actions: list[Action] = [note, Withdraw(1), ToClient(1, texts[0]), ToClient(1, texts[1]), ToClient(2, texts[2])]
    actions += [withheld, Cancel(1, "why"), *(ToClient(1, each) for each in texts[3:])]
    done = [*answers_first(actions)]
    assert done[:3] == [ToClient(1, texts[0] + texts[1]), ToClient(2, texts[2]), withheld]
    assert done[-3:] == [note, Withdraw(1), Cancel(1, "why")]
    rest = [each.frame for each in done[3:-3] if isinstance(each, ToClient)]
    assert [*frames_in(b"".join(rest))] == texts[3:]
    assert 1 < len(rest) < 4
    assert max(map(len, rest)) <= 1_400
