"""The test vectors of docs/log-format.md: two independent verifiers give the expected results."""

import json
from pathlib import Path
from typing import Any

import pytest

from reference import independent_verifier
from reference.log_vectors import FOLDER, made
from reference.verifiers import agree
from rtshcua.evidence.attested import BoundaryEvidence
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.merkle import MerkleTree, leaf_hash
from rtshcua.evidence.note import Checkpoint, parse, split
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Genesis
from rtshcua.evidence.report import LogVerdict
from rtshcua.evidence.rooted import rooted
from rtshcua.evidence.verify import verify
from rtshcua.evidence.witnessing.anchors import AnchoredExtent, Anchors, notes
from rtshcua.ground.audit.audit import audit
from rtshcua.wire.boundary_chain import START
from rtshcua.wire.trust import TrustRoot
from virtual.rows import rows

FILES = made()
EXPECTED: dict[str, dict[str, Any]] = json.loads(FILES["expected.json"])
KEYS: dict[str, Any] = json.loads(FILES["keys.json"])
REJECTED: dict[str, str] = json.loads(FILES["rejected.json"])
ROOT_KEY = bytes.fromhex(KEYS["root"]["public"])
ROOT_KID = bytes.fromhex(KEYS["root"]["kid"])
WORDS = {"closed": "verified", "incomplete": "incomplete", "broken": "failed"}


def lines_of(name: str) -> list[bytes]:
    return (FOLDER / f"{name}.jsonl").read_bytes().splitlines(keepends=True)


def test_the_files_are_those_that_the_script_makes() -> None:
    found = {str(path.relative_to(FOLDER)): path.read_bytes() for path in FOLDER.rglob("*.*") if path.suffix != ".md"}
    assert found.keys() == FILES.keys()
    assert [name for name, data in FILES.items() if found[name] != data] == []


@rows("name", EXPECTED)
@rows("pinned", [ROOT_KEY, ROOT_KID], ids=["key", "name"])
def test_the_independent_verifier(name: str, pinned: bytes) -> None:
    beside = FOLDER / f"{name}.anchors"
    anchors = [beside.read_bytes()] if beside.exists() else []
    found = independent_verifier.verify(b"".join(lines_of(name)), pinned, anchors)
    wanted = EXPECTED[name]
    assert (found.kind, found.why, found.lines, found.anchored) == (
        wanted["verdict"], "", wanted["lines"], wanted["anchored"],
    )  # fmt: skip
    assert [list(gap) for gap in found.gaps] == wanted.get("gaps", [])


@rows("name", EXPECTED)
def test_this_verifier(name: str) -> None:
    report = verify(lines_of(name))
    assert report.failure is None
    assert report.verdict.value == WORDS[EXPECTED[name]["verdict"]]
    assert (report.records, report.root.hex()) == (EXPECTED[name]["lines"], EXPECTED[name]["root"])
    assert [[gap.record, gap.us] for gap in report.gaps] == EXPECTED[name].get("gaps", [])


@rows("name", EXPECTED)
def test_the_audit_and_the_quick_verifier(name: str) -> None:
    """Every check of this program, including the bundle; its results agree with the page."""
    found = audit(lines_of(name), ROOT_KEY)
    assert found.report.failure is None
    assert found.report.verdict.value == WORDS[EXPECTED[name]["verdict"]]
    agree(b"".join(lines_of(name)), found)


@rows("name", REJECTED)
def test_audit_rejects_vector(name: str) -> None:
    found = audit(lines_of(f"rejected/{name}"), ROOT_KEY)
    assert found.report.verdict is LogVerdict.FAILED
    agree(b"".join(lines_of(f"rejected/{name}")), found)


@rows("name", EXPECTED)
def test_leaves_roots_and_checkpoints(name: str) -> None:
    wanted, tree = EXPECTED[name], MerkleTree()
    for number, leaf in enumerate(wanted["leaves"]):
        line = lines_of(name)[number]
        assert leaf_hash(line).hex() == leaf
        assert tree.root().hex() == wanted["roots"][number]
        tree.push(leaf_hash(line))
        if str(number) in wanted["signed"]:
            signed = wanted["signed"][str(number)]
            checkpoint = parse(split(signed["note"])[0])
            assert isinstance(checkpoint, Checkpoint)
            key = None if checkpoint.key is None else checkpoint.key.hex()
            assert (checkpoint.size, checkpoint.root.hex()) == (number, signed["root"])
            assert (checkpoint.record.hex(), key) == (signed["record"], signed["key"])
            assert (None if checkpoint.after is None else checkpoint.after.hex()) == signed["after"]
            assert json.loads(line)["checkpoint"] == signed["note"]


@rows("name", REJECTED)
def test_verifiers_reject_vector(name: str) -> None:
    lines = lines_of(f"rejected/{name}")
    assert audit(lines, ROOT_KEY).report.failure is not None
    assert independent_verifier.verify(b"".join(lines), ROOT_KEY).kind in ("broken", "untrusted", "boundary")


def test_the_boundary_s_digests() -> None:
    first, *rest = map(read, lines_of("attested"))
    assert isinstance(first, Genesis)
    root = rooted(first, ROOT_KEY)
    assert isinstance(root, TrustRoot)
    evidence = BoundaryEvidence(root, first)
    digests = [START.hex()]
    for record in rest:
        assert not isinstance(record, Flaw)
        assert evidence.check(record, 0) is None
        if evidence.digest.hex() != digests[-1]:
            digests.append(evidence.digest.hex())
    assert digests == EXPECTED["attested"]["boundary"]


def test_the_anchored_part() -> None:
    lines = lines_of("anchored")
    records = [json.loads(line) for line in lines]
    witnesses = [bytes.fromhex(key["public"]) for key in KEYS["witnesses"].values()]
    boot = records[0]["boot"]
    anchors = Anchors(f"rtshcua/log/{records[0]['vehicle']}/{boot}", witnesses, 2)
    given = [anchors.checkpoint(record["checkpoint"]) for record in records if "checkpoint" in record]
    recorded = [record["detail"] for record in records if record.get("event") == "anchored"]
    beside = (FOLDER / "anchored.anchors").read_text(encoding="utf-8")
    given += [anchors.anchor(note) for note in (*recorded, *notes(beside))]
    assert given == [None] * len(given)
    found = anchors.finish(len(lines))
    assert isinstance(found, AnchoredExtent)
    assert found.records == EXPECTED["anchored"]["anchored"] + 1  # and the signed record that carries the checkpoint
    assert [each.size for each in found.witnessed] == [4, 2]


def test_log_under_another_pin_is_untrusted() -> None:
    for pinned in (bytes(32), bytes(16), ROOT_KEY[:16]):
        assert independent_verifier.verify(b"".join(lines_of("closed")), pinned).kind == "untrusted"


def test_the_independent_verifier_runs_by_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = FOLDER / "closed.jsonl"
    assert independent_verifier.main([str(log), ROOT_KEY.hex()]) == 0
    assert independent_verifier.main([str(FOLDER / "cut.jsonl"), ROOT_KEY.hex()]) == 1
    assert "closed" in capsys.readouterr().out


def test_its_two_ways_to_a_root_agree() -> None:
    leaves = [bytes([n]) * 32 for n in range(70)]
    growing = independent_verifier.Growing()
    for n, leaf in enumerate(leaves):
        assert growing.root() == independent_verifier.merkle(leaves[:n])
        growing.push(leaf)
