"""Anchors: the checkpoints of a log, cosigned by a trusted witness."""

import json
from collections.abc import Sequence

from rtshcua.evidence.witnessing.cosign import cosign
from rtshcua.evidence.witnessing.submission import anchor
from rtshcua.wire.keys import Duty, SigningKey
from virtual import case

WITNESS = case.KEYS[Duty.WITNESS]


def note_of(lines: Sequence[bytes], number: int) -> str:
    """Return the checkpoint of a signed record."""
    note: str = json.loads(lines[number])["checkpoint"]
    return note


def mark(note: str, key: SigningKey = WITNESS) -> str:
    """Return the checkpoint, cosigned."""
    text = note.rpartition("\n\n")[0] + "\n"
    line = cosign(text, 1_750_000_000, key.public, lambda data: key.sign(data, duty=Duty.WITNESS))
    made = anchor(note, line, [key.public])
    assert made is not None
    return made
