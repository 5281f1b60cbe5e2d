"""Theorem 3: every action has evidence, and the evidence cannot be altered undetected.

Statement. Each sent command follows, in a log that verifies, a record that permits it, with all inputs of the decision
(the evidence tuple); the decision derives again from it. Without a key, no change, addition or removal in a closed log
remains undetected. An attacker who took the vehicle, and with it the key of the present epoch, cannot change records
that an earlier epoch sealed.

Attacker: a holder of the file. First without keys: lines are edited, moved, duplicated, cut, or swapped with those of
another log, and all hashes, counts and links that need no key are recomputed. Then with the secrets of the last epoch.

Enforced by: `rtshcua/evidence/log_writer.py`, `rtshcua/evidence/merkle.py`, `rtshcua/evidence/verify.py`,
`rtshcua/evidence/seal_verification.py`, `rtshcua/ground/audit`, `rtshcua/onboard/runtime/journal.py`,
`rtshcua/wire/boundary_chain.py`.

Not covered: a holder of the log key can write another log from the start; only a witness detects that
(`tests/attacks/test_log_anchored.py`), or the boundary's own evidence (`tests/attacks/test_log_boundary.py`). A
fallback goes ahead when nothing can be recorded any more, and the log then has a gap that is recorded later.
"""

from collections.abc import Callable
from random import Random

import pytest
from hypothesis import given, settings

from reference import worlds
from reference.forgery import (
    as_log_key,
    by_one_key,
    captured,
    edit,
    flight,
    other_flight,
    read,
    rehashed,
    renumbered,
    rewritten,
    seed_of,
    signed,
    signers,
    sound,
)  # fmt: skip
from reference.verifiers import ROOT_KEY
from rtshcua.evidence import note
from rtshcua.evidence import seal_verification as seals
from rtshcua.evidence.report import LogVerdict
from rtshcua.ground.audit import record_audit
from rtshcua.ground.audit.audit import audit
from rtshcua.wire.keys import Duty, SigningKey

STRANGER = SigningKey.from_seed(b"\x77" * 32, duty=Duty.LOG, development=True)
#: how an attacker without a key recomputes the rest of a log
FITTED = (list, renumbered, rehashed, rewritten, lambda lines: rewritten(renumbered(lines)))
#: the fields of a record for each part of the paper's evidence tuple
TUPLE = ("invocation", "state", "context", "outcome", "reason", "at_us", "utc_us", "binding", "target_link")


def bent(of: Random, lines: tuple[bytes, ...], least: int = 0) -> list[bytes]:
    """The log with a change in or after line `least`, and everything recomputed that needs no key."""
    made = list(lines)
    for _ in range(of.choice([1, 1, 2, 3])):
        at, other = (of.randrange(least, len(made)) for _ in range(2))
        match of.randrange(8):
            case 0 if len(made) > least + 2:
                del made[at]
            case 1:
                made.insert(at, made[other])
            case 2:
                made[at], made[other] = made[other], made[at]
            case 3 if len(made) > least + 2:
                del made[max(at, least + 1) :]
            case 4:
                made[at] = of.choice(other_flight())
            case _:
                made[at] = edited(of, made[at])
    return made


def edited(of: Random, line: bytes) -> bytes:
    """A line with one changed field, of the same type."""
    fields = read(line)
    name = of.choice(sorted(fields))
    value = fields[name]
    match value:
        case int():
            return edit(line, **{name: max(value + of.choice([-1, 1, 1_000]), 0)})
        case str() if value:
            at = of.randrange(len(value))
            return edit(line, **{name: value[:at] + of.choice("0a9f") + value[at + 1 :]})
        case dict():
            inner = of.choice(sorted(value))
            if isinstance(value[inner], int):
                return edit(line, **{name: value | {inner: value[inner] + 1}})
            if isinstance(value[inner], list) and value[inner]:
                return edit(line, **{name: value | {inner: [5, *value[inner][1:]]}})
    return edit(line, event="noted")


def accepted(lines: list[bytes]) -> bool:
    """Whether the log verifies under the pinned root key."""
    return audit(lines, ROOT_KEY).report.verdict is LogVerdict.VERIFIED


def survives(of: Random) -> bool:
    """Whether some forgery without a key verifies."""
    lines = flight()
    forged = of.choice(FITTED)(bent(of, lines))
    if of.random() < 0.1:
        forged = signed(as_log_key(forged, STRANGER), STRANGER)
    return tuple(forged) != lines and tuple(forged) != other_flight() and accepted(forged)


def survives_captured(of: Random) -> bool:
    """Whether a holder of the last epoch's key can change sealed records undetected."""
    lines = flight()
    sealed = signers(lines)[:-1]
    last = read(lines[sealed[-1]])["next_key"]
    head = bent(of, lines[: sealed[-1] + 1])
    forged = captured([*head, *lines[sealed[-1] + 1 :]], seed_of(last))
    return tuple(forged[: len(head)]) != lines[: len(head)] and accepted(forged)


@pytest.mark.claim("T3")
@given(worlds.CHANCES)
def test_every_change_without_key_is_detected(of: Random) -> None:
    assert not survives(of)


@pytest.mark.claim("T3")
@given(worlds.CHANCES)
def test_last_epoch_key_cannot_change_sealed_records(of: Random) -> None:
    assert not survives_captured(of)


@pytest.mark.claim("T3")
@pytest.mark.soak
@settings(max_examples=20_000)
@given(worlds.CHANCES)
def test_many_more_changes_are_detected(of: Random) -> None:
    assert not survives(of)
    assert not survives_captured(of)


@pytest.mark.parametrize("lines", [flight, other_flight], ids=["completed", "came home early"])
def test_each_command_has_its_evidence_tuple_before_it(lines: Callable[[], tuple[bytes, ...]]) -> None:
    """The log verifies and each decision derives again, so the tuples belong to the decisions."""
    records = [read(line) for line in lines()]
    sound(lines())
    granted: set[tuple[int, int]] = set()
    genesis = records[0]
    assert {"bundle", "mode", "received_us", "root"} <= genesis.keys()
    for record in records:
        if record["type"] == "decision":
            assert all(name in record for name in TUPLE)
            assert record["context"]["policy_version"] == 7
            granted |= {(record["kind"], record["step"])} if record["outcome"] == "allow" else set()
        if record.get("event") == "dispatched":
            assert granted & {(record["kind"], record["step"]), (0, record["step"])} or record["kind"] == 2
    assert sum(record.get("event") == "dispatched" for record in records) >= 3


def breaks(survivor: Callable[[Random], bool], most: int = 150) -> bool:
    return any(survivor(Random(seed)) for seed in range(most))


@pytest.mark.claim("T3", broken="a verifier that checks no signatures")
def test_search_detects_verifier_without_signatures(monkeypatch: pytest.MonkeyPatch) -> None:
    """If signatures are not checked, no hash reveals a forged segment."""
    monkeypatch.setattr(seals, "open_note", lambda text, *_: note.parse(note.split(text)[0]))
    assert breaks(by_a_stranger)


def by_a_stranger(of: Random) -> bool:
    """All counts, roots and texts are recomputed and signed by a stranger: it only verifies if signatures are not
    checked.
    """
    lines = flight()
    forged = by_one_key(bent(of, lines, 1), STRANGER.private.private_bytes_raw())
    return tuple(forged) != lines and accepted(forged)


@pytest.mark.claim("T3")
@given(worlds.CHANCES)
def test_signatures_of_strangers_are_refused(of: Random) -> None:
    assert not by_a_stranger(of)


@pytest.mark.claim("T3", broken="an auditor that does not derive decisions again")
def test_search_detects_auditor_without_derivation(monkeypatch: pytest.MonkeyPatch) -> None:
    """With all keys a decision can be signed that does not follow from its inputs: only derivation detects it."""
    lines = flight()
    number = next(n for n, line in enumerate(lines) if read(line)["type"] == "decision")
    forged = signed([*lines[:number], edit(lines[number], reason="state/violated"), *lines[number + 1 :]])
    assert not accepted(forged)
    monkeypatch.setattr(record_audit.DecisionAudit, "check", lambda *_: None)
    assert accepted(forged)
