"""Threat: who holds the key of the last epoch closes the log over invented fields, to show a sealed record in part."""

import errno
import json
import os
from pathlib import Path

import pytest

from reference.forgery import ROOT_KEY, captured, edit, flight, prove, read, seed_of, signers
from rtshcua.adapters.files.logs import SECRET, write_secret
from rtshcua.cli import app
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.merkle_proofs import inclusion_ranges, proof_of
from rtshcua.evidence.proofs.check import Proven, check_proof
from rtshcua.evidence.proofs.disclosure import Disclosure, disclosure_root
from rtshcua.evidence.proofs.file import Extra, Kind, ProofFile
from rtshcua.evidence.proofs.make import find, prove_disclosure
from rtshcua.evidence.records import encode, unsigned
from rtshcua.evidence.report import Verdict

KEY = bytes(range(32))
HONEST = flight()
SIGNED = signers(HONEST)
TARGET = next(number for number, line in enumerate(HONEST) if b'"type":"decision"' in line)
#: what the thief would have the record say
INVENTED = (*HONEST[:TARGET], edit(HONEST[TARGET], outcome="deny"), *HONEST[TARGET + 1 : -1])


def closed_over(lines: tuple[bytes, ...]) -> list[bytes]:
    """The honest log, with a close by the last epoch's key over the fields of other lines."""
    last = seed_of(read(HONEST[SIGNED[-2]])["next_key"])
    return captured([*HONEST[:-1], edit(HONEST[-1], disclosure=disclosure_root(lines, KEY).hex())], last)


FORGED = closed_over(INVENTED)


def shown() -> bytes:
    """The invented record, shown in part."""
    found = find(FORGED, TARGET, None, closed=True)
    assert not isinstance(found, Flaw)
    tree = Disclosure(KEY)
    path = proof_of(inclusion_ranges(TARGET, found.signed.seq), [tree.leaf(*each) for each in enumerate(INVENTED)])
    *chain, note = found.chain
    fields = tree.shown(TARGET, INVENTED[TARGET], {"_prev", "state"})
    extra = Extra(tuple(chain), found.root, encode(unsigned(found.signed)), b"", fields)
    return ProofFile(Kind.DISCLOSURE, extra.encode(), TARGET, tuple(path), note).encode()


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of the run, with the secret, and the thief's proof."""
    (tmp_path / "log.jsonl").write_bytes(b"".join(FORGED))
    (tmp_path / "shown").write_bytes(shown())
    write_secret(tmp_path, KEY)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def verify(command: str, *words: str) -> int:
    return app.main([command, *words, "--root", ROOT_KEY.hex()])


def test_the_thief_closes_the_log() -> None:
    """The target was sealed by a key that is gone, and stands unchanged; only the close is the thief's."""
    assert SIGNED[1] > TARGET or SIGNED[-2] > TARGET
    assert FORGED[:-1] == list(HONEST[:-1])
    assert prove(FORGED).report.verdict is Verdict.VERIFIED
    assert isinstance(check_proof(shown(), ROOT_KEY), Proven)


def test_a_proof_says_who_stated_the_fields(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify("verify-proof", "shown", "--json") == ExitCode.OK
    told = json.loads(capsys.readouterr().out)
    assert told["record"]["outcome"] == "deny"
    proven = {claim["slug"]: claim["text"] for claim in told["proven"]}
    assert proven["disclosure"].endswith(
        f"as whoever signed the close of the log of {len(HONEST) - 1} records stated them"
    )
    unproven = {claim["slug"]: claim["text"] for claim in told["not_proven"]}
    assert "who held the last epoch's key could have stated others" in unproven["fields"]


def test_an_audit_beside_the_secret_finds_it(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for how in ([], ["--fast"]):
        assert verify("verify-log", ".", *how) == ExitCode.OK
        out = " ".join(capsys.readouterr().out.split())
        assert "- that the fields which the close states, to show records in part, are those of the records" in out
    for how in (["--audit"], ["--audit", "--no-derive"], ["--explain", str(TARGET)]):
        assert verify("verify-log", ".", *how, "--json") == ExitCode.EVIDENCE
        told = json.loads(capsys.readouterr().out)
        assert told["verdict"] == "failed"
    assert verify("verify-log", ".", "--audit", "--json") == ExitCode.EVIDENCE
    told = json.loads(capsys.readouterr().out)
    honest, invented = (disclosure_root(lines, KEY).hex() for lines in (HONEST[:-1], INVENTED))
    failure = told["failure"]
    assert (failure["slug"], failure["record"]) == ("close/disclosure", len(HONEST) - 1)
    assert (failure["found"], failure["expected"]) == (invented, honest)
    assert failure["offset"] == sum(map(len, HONEST[:-1]))


def test_the_owner_makes_no_proof_of_such_a_log() -> None:
    made = prove_disclosure(lambda: FORGED, TARGET, KEY, {"state"})
    assert isinstance(made, Flaw)
    assert made.slug == "proof/secret"
    assert "or the close states other fields" in made.text


def test_an_honest_close_is_borne_out(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (run / "log.jsonl").write_bytes(b"".join(closed_over(HONEST[:-1])))
    assert verify("verify-log", ".", "--audit") == ExitCode.OK
    out = " ".join(capsys.readouterr().out.split())
    assert "+ the fields which the close states, to show records in part, are those of the records" in out


def test_without_a_secret_that_serves_it_is_not_shown(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def said() -> str:
        assert verify("verify-log", "log.jsonl", "--audit") == ExitCode.OK
        return " ".join(capsys.readouterr().out.split())

    (run / SECRET).chmod(0o644)
    assert "others may read the secret" in said()
    (run / SECRET).unlink()
    assert "`log.secret` does not lie beside the log" in said()
    os.mkfifo(run / SECRET)
    assert "`log.secret` cannot be read: no regular file" in said()
    (run / SECRET).unlink()
    write_secret(run, KEY)
    (run / "log.jsonl").rename(run / "kept.jsonl")
    assert verify("verify-log", "kept.jsonl", "--audit") == ExitCode.OK
    assert "`log.secret` does not lie beside the log" in " ".join(capsys.readouterr().out.split())


def test_a_secret_that_the_disk_does_not_give(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: Path) -> bytes:
        raise PermissionError(errno.EACCES, "permission denied")

    monkeypatch.setattr("rtshcua.cli.disclosed.read_secret", refuse)
    assert verify("verify-log", ".", "--audit") == ExitCode.OK
    assert "`log.secret` cannot be read: permission denied" in " ".join(capsys.readouterr().out.split())
