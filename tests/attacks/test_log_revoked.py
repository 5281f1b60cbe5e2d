"""Threat: a log rests on a revoked key, and its own, older trust root does not say so.

A holder of a stolen log key writes logs under the old root with earlier dates; a holder of another stolen key made
a vehicle use it that did not know of the revocation.
"""

import json
from functools import cache
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference import log_vectors as vectors
from reference.attested_flight import attested
from reference.documents import approval, hand, low
from reference.flat_case import ISSUED, S
from reference.forgery import edit, read, signed
from reference.log_vectors import WITNESSES, anchor, close, effect, genesis, log, seal
from reference.verifiers import ROOT_KEY as VECTORS_KEY
from reference.world import (
    APPROVAL_KEY,
    LOG_KEY,
    MISSION_KEY,
    POLICY_KEY,
    ROOT,
    ROOT_KEY,
    START,
    Run,
    _signed_root,
    renewed,
)
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.report import LogReport, LogVerdict
from rtshcua.front.cli.app import main
from rtshcua.ground.audit.audit import Auditor
from rtshcua.ground.audit.revoked_keys import RevokedKeys
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import TrustRoot, open_root
from rtshcua.wire.untrusted import Untrusted
from virtual import case
from virtual.rows import rows

BEFORE, AFTER = ISSUED, START.utc_us + 3_600 * S
ONE, TWO, THREE = WITNESSES
#: a log of the test vectors, whose root requires two of three witnesses
LINES = log(genesis(), effect(10), seal(20, 1), effect(30), close(60))
SEEN_S = vectors.UTC_US // S + 3
NEW_ROOT_KEY = SigningKey.from_seed(b"new root key".ljust(32), duty=Duty.ROOT, development=True)


@cache
def flown() -> tuple[bytes, ...]:
    """A flight with an approval, which its supervisor gave."""
    run = Run(renewed(low()))
    assert hand(run, approval(run.loaded)) == "accepted"
    run.until_over()
    return (*run.lines, run.recorder.close(run.clock.now(), ending=str(run.ending), tlog=None))


def newer(
    issued_us: int, *keys: SigningKey, version: int = 2, of: TrustRoot = ROOT, by: SigningKey = ROOT_KEY
) -> bytes:
    """The root of a version that revokes these keys, and those revoked by the previous root."""
    names = (*sorted(of.revocations), *(key.kid for key in keys))
    kept = tuple(key for key in of.keys if key.kid not in names)
    made = replace(of, version=version, issued_at_us=issued_us, expires_at_us=issued_us + ISSUED, keys=kept)
    return (replace(made, revoked=names) if names else made).sign(by)


def judged(
    *roots: bytes, lines: tuple[bytes, ...] = (), pinned: bytes = ROOT_KEY.public, anchors: tuple[str, ...] = ()
) -> LogReport:
    """The report on a log (of the flight) under these roots."""
    auditor, revoked = Auditor(pinned, anchors=anchors), RevokedKeys(roots)
    for line in lines or flown():
        auditor.take(line)
        if auditor.record is not None:
            revoked.take(auditor.record)
    return revoked.judged(auditor.audit()).report


def found(report: LogReport) -> tuple[str, str, int]:
    """The verdict and the flaw, with its record."""
    finding = report.failure or report.shortfall
    return report.verdict.value, finding.slug if finding else "", finding.record if finding else -1


def told(report: LogReport) -> set[str]:
    """The slugs of the claims about revocations."""
    proven = {f"+{each.slug}" for each in report.proven}
    return {each for each in proven | {each.slug for each in report.unproven} if "revo" in each}


APPROVED = next(number for number, line in enumerate(flown()) if read(line).get("event") == "approval")


@rows(
    ("key", "slug", "record"),
    [
        (LOG_KEY, "trust/revoked-key", 0),
        (POLICY_KEY, "trust/revoked-key", 0),
        (MISSION_KEY, "trust/revoked-key", 0),
        (APPROVAL_KEY, "document/revoked-key", APPROVED),
    ],
)
def test_signature_after_revocation_is_not_trusted(key: SigningKey, slug: str, record: int) -> None:
    report = judged(newer(BEFORE, key))
    assert found(report) == ("failed", slug, record)
    assert report.failure is not None
    assert "by root version 2 of " in report.failure.text
    assert report.failure.found == key.kid.hex()


@rows("key", [POLICY_KEY, MISSION_KEY, APPROVAL_KEY])
def test_signature_before_revocation_stays_valid(key: SigningKey) -> None:
    """The log key proves the time; the report mentions the later revocation."""
    report = judged(newer(AFTER, key))
    assert found(report) == ("verified", "", -1)
    assert told(report) == {"revoked"}


def test_revoked_log_key_does_not_prove_time() -> None:
    assert found(judged(newer(AFTER, LOG_KEY))) == ("incomplete", "trust/revoked-log-key", 0)
    report = judged(newer(AFTER, LOG_KEY, MISSION_KEY))
    assert found(report) == ("incomplete", "trust/revoked-log-key", 0)
    assert told(report) == {"revoked"}


def test_missing_root_leaves_time_of_revocation_unknown() -> None:
    """Version 3 names what version 2 may have revoked long before."""
    third = newer(AFTER + S, MISSION_KEY, APPROVAL_KEY, version=3)
    report = judged(third)
    assert found(report) == ("incomplete", "trust/revoked-when", 0)
    assert told(report) == {"trust/revoked-when"}, "one in the verdict, the other told beside it"
    assert found(judged(third, newer(AFTER, version=2))) == ("verified", "", -1)
    assert found(judged(third, newer(BEFORE, version=2))) == ("verified", "", -1), "it did not revoke it"
    assert found(judged(newer(BEFORE, MISSION_KEY), third)) == ("failed", "trust/revoked-key", 0)
    assert found(judged(newer(BEFORE, MISSION_KEY, version=3))) == ("failed", "trust/revoked-key", 0)


def test_a_boundary_key_that_was_revoked() -> None:
    own = case.root(boundary=True)[0]
    (last,) = [n for n, line in enumerate(attested()) if read(line).get("event") == "boundary"][-1:]
    for issued_us, verdict, slug in ((ISSUED, "failed", "trust/revoked-key"), (AFTER, "verified", "")):
        root = newer(issued_us, case.BOUNDARY_KEY, of=own, by=case.KEYS[Duty.ROOT])
        report = judged(root, lines=attested(), pinned=VECTORS_KEY)
        assert found(report) == (verdict, slug, last if slug else -1)
        assert slug or told(report) == {"revoked"}


def test_signature_at_time_of_revocation_is_undecided() -> None:
    for off, what in ((0, "incomplete"), (START.utc_error_us + 1, "verified"), (-START.utc_error_us, "failed")):
        assert judged(newer(START.utc_us + off, MISSION_KEY)).verdict.value == what


def vectors_root(*keys: SigningKey, issued_us: int = AFTER) -> bytes:
    own = open_root(vectors.root(), pinned=VECTORS_KEY, now_us=0)
    return newer(issued_us, *keys, of=own, by=case.KEYS[Duty.ROOT])


def test_witnesses_prove_signatures_before_revocation() -> None:
    """A log is complete if they saw it to its end before the revocation; later logs may be forged."""
    key = case.KEYS[Duty.LOG]

    def under(root: bytes, *notes: str) -> tuple[str, str, int]:
        return found(judged(root, lines=tuple(LINES), pinned=VECTORS_KEY, anchors=notes))

    whole, short = ("verified", "", -1), ("incomplete", "trust/revoked-log-key", 0)
    newest = vectors_root(key)
    assert under(newest) == short
    assert under(newest, anchor(LINES[4], [ONE, TWO])) == whole
    assert under(newest, anchor(LINES[4], [ONE])) == short, "two are asked for"
    assert under(newest, anchor(LINES[2], [ONE, TWO])) == short, "not to its end"
    assert under(newest, anchor(LINES[4], [ONE]), anchor(LINES[2], [TWO])) == short
    late = anchor(LINES[4], [THREE], AFTER // S)
    assert under(newest, anchor(LINES[4], [ONE, TWO]), late) == whole, "two saw it in time"
    assert under(newest, anchor(LINES[4], [ONE]), late) == short
    assert under(vectors_root(key, issued_us=SEEN_S * S), anchor(LINES[4], [ONE, TWO])) == short, "within the second"
    witness = SigningKey.from_seed(WITNESSES[TWO], duty=Duty.WITNESS, development=True)
    own = open_root(newest, pinned=VECTORS_KEY, now_us=0)
    both = replace(
        own, keys=tuple(each for each in own.keys if each.kid != witness.kid), revoked=(key.kid, witness.kid)
    )
    both = replace(both, thresholds=replace(both.thresholds, witness=1)).sign(case.KEYS[Duty.ROOT])
    assert under(both, anchor(LINES[4], [ONE, TWO])) == short, "whoever took a witness's key dates as they like"
    assert under(both, anchor(LINES[4], [ONE, THREE])) == whole


def test_root_of_a_revoked_root_key_is_accepted_if_given_directly() -> None:
    both = replace(ROOT, keys=(*ROOT.keys, NEW_ROOT_KEY.verification()))
    chain = newer(AFTER, of=both), newer(AFTER + S, ROOT_KEY, version=3, of=both, by=NEW_ROOT_KEY)
    assert found(judged(*chain)) == ("failed", "trust/root-revoked-key", 0)
    report = judged(*chain, _signed_root())
    assert found(report) == ("verified", "", -1)
    assert told(report) == {"+revocations"}


def test_root_of_same_time_must_contain_revocation() -> None:
    """A holder of the root key signs a later version that omits the revocations."""
    forged = vectors.b64encode(newer(BEFORE - S, version=5)).decode()
    lines = tuple(signed([edit(flown()[0], root=forged), *flown()[1:]], LOG_KEY))
    assert found(judged(newer(AFTER, MISSION_KEY), lines=lines)) == ("failed", "trust/revoked-key", 0)


def test_unaffected_log_is_reported_under_newest_root() -> None:
    assert told(judged()) == told(judged(_signed_root())) == set()
    assert told(judged(newer(AFTER))) == {"+revocations"}
    stranger = newer(AFTER, of=replace(ROOT, keys=(NEW_ROOT_KEY.verification(),)), by=NEW_ROOT_KEY)
    assert told(judged(stranger)) == {"revocations"}, "a root of somebody else says nothing of this log"
    assert judged(newer(AFTER, version=9)).verdict is LogVerdict.VERIFIED
    assert told(judged(newer(AFTER, version=9))) == {"revocations"}


def test_failing_log_fails_independent_of_root() -> None:
    lines = (*flown()[:-2], flown()[-1])
    assert judged(newer(BEFORE, LOG_KEY), lines=lines).failure == judged(lines=lines).failure
    cut = flown()[:-1]
    assert found(judged(newer(AFTER, LOG_KEY), lines=cut)) == found(judged(lines=cut))
    assert told(judged(newer(AFTER, LOG_KEY), lines=cut)) == {"trust/revoked-log-key"}


def test_invalid_trust_root_is_refused() -> None:
    with pytest.raises(Untrusted):
        RevokedKeys([b"nothing"])


@pytest.fixture
def beside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("log.jsonl").write_bytes(b"".join(LINES))
    Path("root-1.trust").write_bytes(vectors.root())
    Path("mission.trust").write_bytes(vectors_root(case.KEYS[Duty.MISSION]))
    Path("early.trust").write_bytes(vectors_root(case.KEYS[Duty.MISSION], issued_us=BEFORE))
    Path("log.trust").write_bytes(vectors_root(case.KEYS[Duty.LOG]))
    return tmp_path


@pytest.mark.parametrize("how", [(), ("--fast",), ("--audit", "--no-derive"), ("--explain", "0", "--no-derive")])
def test_an_auditor_gives_the_newer_root(
    how: tuple[str, ...], beside: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verify = ("verify-log", "log.jsonl", *how, "--root")
    assert main([*verify, "root-1.trust"]) == ExitCode.OK
    assert main([*verify, "root-1.trust", "--revocations", "mission.trust"]) == ExitCode.OK
    assert main([*verify, "root-1.trust", "--revocations", "early.trust"]) == ExitCode.UNTRUSTED
    assert main([*verify, "early.trust"]) == ExitCode.UNTRUSTED, "a root that is given to trust by revokes too"
    assert main([*verify, "log.trust"]) == ExitCode.INCOMPLETE
    capsys.readouterr()
    assert main([*verify, VECTORS_KEY.hex(), "--revocations", "log.trust", "--json"]) == ExitCode.INCOMPLETE
    said = json.loads(capsys.readouterr().out)
    assert said["verdict"] == "incomplete"
    if "--explain" not in how:
        assert said["shortfall"]["slug"] == "trust/revoked-log-key"
        assert "--anchors" in said["shortfall"]["help"]


def test_report_lists_revoked_keys(beside: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify-log", "log.jsonl", "--root", "log.trust"]) == ExitCode.INCOMPLETE
    out = " ".join(capsys.readouterr().out.split())
    assert "INCOMPLETE at record 0, line 1: trust/revoked-log-key" in out
    assert f"key {case.KEYS[Duty.LOG].kid.hex()} was revoked by root version 2 of " in out
    assert main(["verify-log", "log.jsonl", "--root", "root-1.trust", "--revocations", "log.jsonl"]) != ExitCode.OK
