"""Threat: a recovery hides records, changes the clock, or is recorded without a crash."""

import pytest

from reference.forgery import STRANGER, by_one_key, expect, flight, prove, read, rewritten, seed_of, write
from reference.log_vectors import MONOTONIC_US, close, effect, genesis, line_of, log, recovered, seal
from reference.resealing import resealed
from reference.verifiers import agree, careful
from rtshcua.evidence.report import LogVerdict

LINES = recovered()[0]
AT = next(number for number, line in enumerate(LINES) if read(line)["type"] == "recover")


def changed(number: int, **fields: object) -> list[bytes]:
    return [*LINES[:number], write(read(LINES[number]) | fields), *LINES[number + 1 :]]


def test_genuine_recovery_verifies() -> None:
    assert prove(LINES).report.verdict is LogVerdict.VERIFIED
    assert read(LINES[AT])["at_us"] < read(LINES[AT - 1])["at_us"], "monotonic time began anew"


@pytest.mark.parametrize("fields", [{"discarded_bytes": 0}, {"discarded_digest": "00" * 32}, {"utc_error_us": 0}])
def test_wrong_discarded_digest_is_rejected(fields: dict[str, object]) -> None:
    assert expect(changed(AT, **fields)) == ("seal/self", AT)
    assert expect(rewritten(changed(AT, **fields))) == ("seal/self", AT)


def test_removed_recovery_is_detected() -> None:
    """The log then claims that there was no damage."""
    without = [*LINES[:AT], *LINES[AT + 1 :]]
    assert expect(without)[0] in ("chain/sequence", "chain/broken")
    assert expect(rewritten(without))[0] in ("clock/backwards", "clock/utc-jump", "seal/key")


def test_recovery_without_log_key_signature_is_rejected() -> None:
    epoch = seed_of(read(LINES[AT - 3])["next_key"])
    log_key = read(LINES[0])["log_key"]
    for secret in (epoch, STRANGER):
        forged = by_one_key(LINES, secret)
        turns = iter([b"", secret])
        kept = resealed(LINES, lambda public, turns=turns: next(turns) if public == log_key else seed_of(public))
        assert expect(kept) == ("seal/key", AT)
        assert expect(forged) == ("seal/key", 0)


def test_monotonic_time_restarts_only_at_recovery() -> None:
    for restart in (effect(0), seal(0, 1), close(0)):
        early = restart | {"at_us": 1}
        tail = [] if early["type"] == "close" else [close(30)]
        assert expect(log(genesis(), effect(10), early, *tail)) == ("clock/backwards", 2)


def test_utc_does_not_restart_at_recovery() -> None:
    """A recovery does not allow the time of day to go back."""
    fields = read(LINES[AT])
    back = [line_of(fields | {"utc_us": fields["utc_us"] - 3_600_000_000})]
    assert expect(resealed([*LINES[:AT], *back, *LINES[AT + 1 :]], seed_of)) == ("clock/utc-backwards", AT)


def test_clocks_advance_alike_after_recovery() -> None:
    fields = read(LINES[AT + 1])
    late = write(fields | {"utc_us": fields["utc_us"] + 10_000_000})
    assert expect(resealed([*LINES[: AT + 1], late], seed_of)) == ("clock/utc-jump", AT + 1)


def test_recovery_does_not_extend_epoch() -> None:
    """Recoveries are signed: the limit of records between two is that between two seals."""
    recover = read(LINES[AT]) | {"at_us": MONOTONIC_US, "utc_us": read(LINES[0])["utc_us"] + 20_000}
    many = [genesis(), *(effect(10) for _ in range(2_048)), recover]
    data = b"".join(log(*many))
    audit = careful(data)
    assert audit.report.failure is None
    agree(data, audit)
    assert expect(log(*many[:-1], effect(10), recover)) == ("seal/missing", 2_049)


def test_data_after_close_of_recovered_log_is_rejected() -> None:
    assert expect([*LINES, LINES[AT]]) == ("close/junk-after", len(LINES))


def test_unsigned_records_are_excluded_from_claims() -> None:
    """Records of the last epoch were rewritten while the log had no end: the recovery signs what it finds."""
    claims = {claim.slug: claim.text for claim in prove(LINES).report.proven}
    last = max(number for number in range(AT) if read(LINES[number])["type"] in ("genesis", "seal"))
    many = AT - last - 1
    said = f"; except {many} record{'' if many == 1 else 's'}, unsigned when the log broke off, and the data after them"
    assert said in claims["signed-close"]
    sound = {claim.slug: claim.text for claim in prove(flight()).report.proven}["signed-close"]
    assert sound.endswith("changed, added or removed a record")
