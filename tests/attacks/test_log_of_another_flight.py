"""Threat: logs are swapped, or a record is spliced in from another mission."""

from base64 import b64decode

from reference.forgery import ROOT_KEY, edit, expect, flight, other_flight, read, rewritten, signed, signers
from rtshcua.ground.audit.audit import audit

LINES, OTHER = flight(), other_flight()


def bundle_of(lines: tuple[bytes, ...]) -> bytes:
    return b64decode(read(lines[0])["bundle"])


def test_two_logs_swapped_do_not_fit_the_bundle_beside_them() -> None:
    report = audit(OTHER, ROOT_KEY, bundle=bundle_of(LINES)).report
    assert report.failure is not None
    assert (report.failure.slug, report.failure.record) == ("genesis/other-bundle", 0)
    assert audit(LINES, ROOT_KEY, bundle=bundle_of(LINES)).report.failure is None


def test_the_genesis_of_one_before_the_records_of_another() -> None:
    assert expect([OTHER[0], *LINES[1:]]) == ("chain/broken", 0)
    assert expect(rewritten([OTHER[0], *LINES[1:]])) == ("seal/root", signers(LINES)[1])
    assert expect(signed([OTHER[0], *LINES[1:]]))[0] == "decision/invocation"


def test_the_close_of_another_log_is_refused() -> None:
    assert expect([*LINES[:-1], OTHER[-1]])[0] in ("chain/sequence", "chain/broken")
    last = read(LINES[-1])
    timed = edit(OTHER[-1], at_us=last["at_us"], utc_us=last["utc_us"])
    assert expect(rewritten([*LINES[:-1], timed])) == ("seal/key", len(LINES) - 1)


def test_a_decision_of_another_mission_spliced_in() -> None:
    number = next(n for n, line in enumerate(LINES) if read(line)["type"] == "decision")
    foreign = next(line for line in OTHER if read(line)["type"] == "decision")
    spliced = [*LINES[:number], foreign, *LINES[number + 1 :]]
    assert expect(spliced)[0] in ("chain/broken", "chain/sequence")
    assert expect(rewritten(spliced)) == ("seal/root", signers(LINES)[1])
    assert expect(signed(spliced)) == ("decision/invocation", number)


def test_a_whole_log_put_behind_another() -> None:
    assert expect([*LINES, *OTHER]) == ("close/junk-after", len(LINES))
    assert expect([*LINES[:-1], *OTHER]) == ("genesis/repeated", len(LINES) - 1)
