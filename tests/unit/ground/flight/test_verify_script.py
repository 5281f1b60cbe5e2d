"""The verifier of a page, in a browser, against the verifiers in Python: the same verdict, slug and record."""

import json
from base64 import b64encode
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import pytest
from msgspec.structs import replace
from playwright.sync_api import Browser

from reference import independent_root, log_vectors
from reference.attested_flight import attested
from reference.browser import CHROMIUM
from reference.forgery import (
    LOG_KEY,
    STRANGER,
    as_log_key,
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
    write,
)
from reference.independent_records import unbase64
from reference.page_script import Script, compare, script_of
from reference.resealing import resealed
from reference.verifiers import ROOT_KEY
from rtshcua.ground.flight.embedding import redact
from rtshcua.wire import cbor
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import TrustRoot
from virtual import case

VECTORS = Path(__file__).parents[3] / "vectors"
LOGS = VECTORS / "log"
FLIPS = 400

pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]


@pytest.fixture(scope="module")
def script(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Script]:
    with script_of(browser, tmp_path_factory.mktemp("page")) as made:
        yield made


# ------------------------------------------------------------------------------------------------ whole logs


def recovered() -> list[bytes]:
    """A real flight that a crash ended, recovered and closed after a restart."""
    lines = flight()[:11]
    last = read(lines[-1])
    anew = {"at_us": 5, "utc_us": last["utc_us"] + 60_000_000, "utc_error_us": last["utc_error_us"]}
    seal, close = read(flight()[7]), read(flight()[-1])
    more = {"discarded_bytes": 7, "discarded_digest": "5a" * 32}
    again = {name: value for name, value in seal.items() if name != "checkpoint"} | more | anew
    end = close | anew | {"at_us": 6, "ending": "recovered"}
    return signed([*lines, write(again | {"type": "recover", "checkpoint": None}), write(end)])


def with_gap() -> list[bytes]:
    """A real flight whose computer stood still for a minute."""
    lines = list(flight())
    silent = 60_000_000
    before = read(lines[8])
    later = [edit(line, at_us=read(line)["at_us"] + silent, utc_us=read(line)["utc_us"] + silent) for line in lines[9:]]
    gap = before | {"event": "stalled", "detail": f"{silent} us", "durability": 1}
    gap |= {name: before[name] + silent for name in ("at_us", "utc_us")}
    return signed([*lines[:9], write(gap), *later])


@cache
def whole() -> dict[str, tuple[str, bytes]]:
    """Logs that hold, with the verdict."""
    lines = flight()
    torn = b"".join(lines[:-3]) + lines[-3][:90]
    logs = {
        "closed": ("verified", b"".join(lines)),
        "attested": ("verified", b"".join(attested())),
        "other": ("verified", b"".join(other_flight())),
        "recovered": ("verified", b"".join(recovered())),
        "gap": ("verified", b"".join(with_gap())),
        "incomplete": ("incomplete", b"".join(lines[:-4])),
        "genesis alone": ("incomplete", lines[0]),
        "torn": ("incomplete", torn),
        "zeros": ("incomplete", b"".join(lines[:-3]) + bytes(512)),
    }
    names = json.loads((LOGS / "expected.json").read_text())
    words = {"closed": "verified", "incomplete": "incomplete"}
    for name, said in names.items():
        logs[f"vector {name}"] = words[said["verdict"]], (LOGS / f"{name}.jsonl").read_bytes()
    return logs


def test_logs_that_hold_are_verified(script: Script) -> None:
    for key in (ROOT_KEY, case.KEYS[Duty.ROOT].kid):
        found = compare(script, [(name, data, key) for name, (_, data) in whole().items()])
        assert {name: each[0] for name, each in found.items()} == {name: word for name, (word, _) in whole().items()}


def test_every_gap_and_recovery_is_named(script: Script) -> None:
    def not_shown(name: str) -> str:
        return "\n".join(script.result(whole()[name][1])["notShown"])

    assert "a gap of 60 s before record 9" in not_shown("gap")
    assert not_shown("vector stalled").count("what happened in a gap") == 3
    assert "recovered once" in not_shown("recovered")
    assert "a removal of records from the end cannot be detected" in not_shown("incomplete")
    assert "that the frames of the telemetry are those that the boundary passed" in not_shown("attested")
    assert "the trust root has no key of duty `boundary`" in not_shown("closed")
    assert "24 records are unanchored" in not_shown("closed")


# ------------------------------------------------------------------------------------------------ forgeries


def _root(change: Any = None, signer: SigningKey = case.KEYS[Duty.ROOT], **fields: Any) -> str:
    """A trust root in base64. `change` is applied to its keys; nobody checks it before it is signed."""
    made = case.root()[0]
    if change is not None:
        fields["keys"] = tuple(change(key) for key in made.keys)
    return b64encode(_signed(replace(made, **fields), signer)).decode()


def _signed(root: TrustRoot, signer: SigningKey) -> bytes:
    payload = root.encode()
    protected = cbor.encode({1: -19, 3: "application/vnd.rtshcua.root+cbor", 4: signer.kid})
    signature = signer.sign(cbor.encode(("Signature1", protected, b"rtshcua/duty/root", payload)), duty=Duty.ROOT)
    return b"\xd2" + cbor.encode((protected, {}, payload, signature))


def _only(duty: Duty, **fields: Any) -> Any:
    return lambda key: replace(key, **fields) if key.duty is duty else key


def _small_order_root() -> str:
    """A root whose log key is a point of small order, for which anybody can sign."""
    weak = bytes([1]) + bytes(31)
    own = case.root()[0].encode().replace(LOG_KEY.public, weak)
    signer = case.KEYS[Duty.ROOT]
    protected = cbor.encode({1: -19, 3: "application/vnd.rtshcua.root+cbor", 4: signer.kid})
    signature = signer.sign(cbor.encode(("Signature1", protected, b"rtshcua/duty/root", own)), duty=Duty.ROOT)
    return b64encode(b"\xd2" + cbor.encode((protected, {}, own, signature))).decode()


def _flip(text: bytes, at: int) -> bytes:
    return text[:at] + bytes([text[at] ^ 1]) + text[at + 1 :]


def _with(number: int, line: bytes) -> list[bytes]:
    lines = list(flight())
    lines[number] = line
    return lines


def _begun(**fields: object) -> list[bytes]:
    """The flight with another genesis, signed by all of its keys."""
    return signed(_with(0, edit(flight()[0], **fields)))


def _rooted(change: Any = None, **fields: Any) -> list[bytes]:
    """The same, with another trust root (see `_root`)."""
    return _begun(root=_root(change, **fields))


def _flipped(field: str, at: int) -> list[bytes]:
    """The same, with one bit changed in what a field of the genesis has in base64."""
    return _begun(**{field: b64encode(_flip(unbase64(read(flight()[0])[field]), at)).decode()})


def _note(number: int, change: Any) -> list[bytes]:
    return _with(number, edit(flight()[number], checkpoint=change(read(flight()[number])["checkpoint"])))


def _texts(number: int, change: Any) -> list[bytes]:
    """The flight with another signed text in one record, signed by all keys."""
    return resealed(flight(), seed_of, text=lambda n, text: change(text) if n == number else text)


def _other_key(text: str) -> str:
    key = text.split("\n")[4]
    return text.replace(key, f"key {'A' * 43}=")


def _swapped(text: str) -> str:
    lines = text.splitlines(True)
    return "".join([*lines[:4], lines[5], lines[4]])


def forgeries() -> dict[str, tuple[list[bytes], bytes]]:
    """Forged logs by name, each with the pinned key."""
    lines = list(flight())
    genesis, note, decision, seal, close = lines[0], lines[1], lines[3], lines[7], lines[-1]
    stranger = SigningKey.from_seed(STRANGER, duty=Duty.LOG, development=True)
    strange_root = SigningKey.from_seed(STRANGER, duty=Duty.ROOT, development=True)
    bundle = read(genesis)["bundle"]
    strange_policy = SigningKey.from_seed(STRANGER, duty=Duty.POLICY, development=True)
    first_key = read(genesis)["next_key"]
    odd = log_vectors.ODD
    made: dict[str, list[bytes]] = {
        "genesis edited": _with(0, edit(genesis, mode="none")),
        "effect edited": _with(1, edit(note, detail="another")),
        "decision edited": _with(3, edit(decision, outcome="deny")),
        "seal edited": _with(7, edit(seal, at_us=read(seal)["at_us"] + 1)),
        "close edited": _with(23, edit(close, ending="aborted")),
        "edited and linked": rehashed(_with(1, edit(note, detail="another"))),
        "edited and counted": rewritten(_with(1, edit(note, detail="another"))),
        "edited, and signed with one epoch key": captured(_with(9, edit(lines[9], outcome="deny")), seed_of(first_key)),
        "line removed": [*lines[:5], *lines[6:]],
        "line removed and numbered": renumbered([*lines[:5], *lines[6:]]),
        "line removed and rewritten": rewritten([*lines[:5], *lines[6:]]),
        "line added": [*lines[:5], lines[4], *lines[5:]],
        "line added and rewritten": rewritten([*lines[:5], lines[4], *lines[5:]]),
        "lines swapped": [*lines[:4], lines[5], lines[4], *lines[6:]],
        "beginning removed": lines[1:],
        "seal removed": [*lines[:7], *lines[8:]],
        "seal removed and rewritten": rewritten([*lines[:7], *lines[8:]]),
        "seals removed by a holder of all keys": signed([*lines[:18], *lines[22:]]),
        "last epoch of another flight": [*lines[:18], *other_flight()[18:]],
        "two logs": [*lines, *lines],
        "line after the close": [*lines, note],
        "blank after the close": [*lines, b"\n"],
        "zeros after the close": [*lines, bytes(64)],
        "junk instead of a torn line": [*lines[:5], b'{"at_us":'],
        "genesis torn": [genesis[:200]],
        "empty": [],
        "newline": [b"\n"],
        "next key swapped": _with(7, edit(seal, next_key=stranger.public.hex())),
        "log key swapped": _with(0, edit(genesis, log_key=stranger.public.hex())),
        "log key of a stranger": signed(as_log_key(lines, stranger), stranger),
        "seal by a stranger": resealed(lines, lambda key: STRANGER if key == first_key else seed_of(key)),
        "checkpoint of another root": _note(7, lambda text: text.replace(text.split("\n")[2], "A" * 43 + "=")),
        "checkpoint of another size": _note(7, lambda text: text.replace("\n7\n", "\n8\n")),
        "checkpoint with a leading zero": _note(7, lambda text: text.replace("\n7\n", "\n07\n")),
        "checkpoint signature": _note(7, lambda text: text[:-6] + ("A" if text[-6] != "A" else "B") + text[-5:]),
        "checkpoint signature not canonical": _note(7, lambda text: text[:-3] + "=\n"),
        "checkpoint signature cut": _note(7, lambda text: text[:-10] + "\n"),
        "checkpoint signed twice": _note(7, lambda text: text + text.rpartition("\n\n")[2]),
        "checkpoint of the next seal": _note(7, lambda _: read(lines[12])["checkpoint"]),
        "no checkpoint": _note(7, lambda _: None),
        "empty checkpoint": _note(7, lambda _: ""),
        "bundle changed": _flipped("bundle", 900),
        "bundle of another vehicle": _begun(bundle=log_vectors.bundle(odd)),
        "vehicle of another bundle": _begun(vehicle=odd),
        "bundle not canonical base64": _begun(bundle=bundle + "\n"),
        "bundle by a stranger": _begun(bundle=log_vectors.bundle("quad-07", policy=strange_policy)),
        "another mission": _begun(mission="another"),
        "root by a stranger": _rooted(signer=strange_root),
        "root changed": _flipped("root", 300),
        "root without its tag": _begun(root=b64encode(unbase64(read(genesis)["root"])[1:]).decode()),
        "root expired": _rooted(issued_at_us=1, expires_at_us=2),
        "root of version 0": _rooted(version=0),
        "root without a development mark": _rooted(development=False),
        "root that revokes nothing": _rooted(revoked=()),
        "root that revokes its key": _rooted(revoked=(LOG_KEY.kid,)),
        "root that revokes twice": _rooted(revoked=(bytes(16), bytes(16))),
        "log key of another vehicle": _rooted(_only(Duty.LOG, vehicles=("quad-08",))),
        "log key expired": _rooted(_only(Duty.LOG, expires_us=read(genesis)["utc_us"])),
        "policy key of another vehicle": _rooted(_only(Duty.POLICY, vehicles=())),
        "mission key of another policy": _rooted(_only(Duty.MISSION, policies=("another",))),
        "mission key of another role": _rooted(_only(Duty.MISSION, roles=("nobody",))),
        "mission key of another source": _rooted(_only(Duty.MISSION, sources=("onboard",))),
        "policy key with policies": _rooted(_only(Duty.POLICY, policies=("*",))),
        "approval key of nobody": _rooted(_only(Duty.APPROVAL, person="Ada")),
        "log key of small order": _begun(root=_small_order_root()),
        "log key with another name": _begun(log_kid="00" * 16),
        "space": _with(1, note.replace(b",", b", ", 1)),
        "escape": _with(1, note.replace(b'"type":"effect"', b'"type":"\\u0065ffect"')),
        "key twice": _with(1, note.replace(b'"seq":1', b'"seq":1,"seq":1')),
        "keys in another order": _with(1, b"{" + b",".join(note[1:-2].split(b",")[::-1]) + b"}\n"),
        "fraction": _with(1, note.replace(b'"seq":1', b'"seq":1.0')),
        "exponent": _with(1, note.replace(b'"seq":1', b'"seq":1e0')),
        "minus zero": _with(1, note.replace(b'"token":-1', b'"token":-0')),
        "integer beyond 2^53": _with(1, note.replace(b'"token":-1', b'"token":9007199254740993')),
        "true": _with(1, note.replace(b'"durability":1', b'"durability":true')),
        "durability": signed(_with(1, edit(note, durability=4))),
        "field missing": _with(1, write({name: each for name, each in read(note).items() if name != "link"})),
        "field more": _with(1, edit(note, other=1)),
        "prototype": _with(1, note.replace(b'"seq":1', b'"__proto__":null,"seq":1')),
        "another type": _with(1, edit(note, type="toString")),
        "carriage return": _with(1, note[:-1] + b"\r\n"),
        "half a surrogate pair": _with(1, note.replace(b'"detail":"', b'"detail":"\\ud800')),
        "not UTF-8": _with(1, note.replace(b'"detail":"', b'"detail":"\xff')),
        "byte order mark": [b"\xef\xbb\xbf" + genesis, *lines[1:]],
        "null": _with(1, b"null\n"),
        "list": _with(1, b"[]\n"),
        "deep": _with(1, b"[" * 100_000 + b"\n"),
        "version": _with(0, edit(genesis, version=5)),
        "format": _begun(format="other"),
        "received later": _begun(received_us=read(genesis)["at_us"] + 1),
        "clock back": signed(_with(5, edit(lines[5], at_us=1))),
        "clocks apart": signed(_with(5, edit(lines[5], utc_us=0))),
        "late": signed(_with(6, edit(lines[6], at_us=40_000_000, utc_us=read(lines[6])["utc_us"] + 27_780_000))),
        "gap that is not there": signed(_with(8, edit(lines[8], event="stalled", detail="1 us"))),
        "genesis twice": signed([genesis, *lines]),
        "epoch": resealed(_with(7, edit(seal, epoch=9)), seed_of, keep=("epoch",)),
        "records": resealed(_with(7, edit(seal, records=9)), seed_of, keep=("records",)),
        "octets": resealed(_with(7, edit(seal, bytes=9)), seed_of, keep=("bytes",)),
        "genesis after another log": resealed(_with(0, edit(genesis, _prev="11" * 32)), seed_of, relink=False),
        "checkpoint of another key": _texts(7, lambda text: text.replace("\nkey ", f"\nkey {'A' * 43}=\nother ")),
        "checkpoint names another key": _texts(7, _other_key),
        "checkpoint without a key": _texts(7, lambda text: text.replace(text.split("\n")[4] + "\n", "")),
        "checkpoint with a word": _texts(7, lambda text: text.replace("\nrecord ", "\nRecord ")),
        "checkpoint with a line": _texts(7, lambda text: text + "more\n"),
        "checkpoint with its lines swapped": _texts(7, _swapped),
        "checkpoint with a short root": _texts(7, lambda text: text.replace(text.split("\n")[2], "AAAA")),
        "digest": resealed(_with(7, edit(seal, digest="00" * 32)), seed_of, keep=("digest",)),
    }  # fmt: skip
    found = {name: (lines, ROOT_KEY) for name, lines in made.items()}
    found["another root key"] = lines, strange_root.public
    found["name of another root key"] = lines, strange_root.kid
    found["root key of small order"] = lines, bytes([1]) + bytes(31)
    return found


def test_forgeries_fail_at_the_record_that_python_names(script: Script) -> None:
    made = forgeries()
    found = compare(script, [(name, b"".join(lines), pinned) for name, (lines, pinned) in made.items()])
    assert [name for name, each in found.items() if each[0] != "failed"] == []
    assert len(made) > 90
    slugs = {slug for _, slug, _ in found.values()}
    assert len(slugs) > 30, sorted(slugs)


def test_long_lines_are_refused(script: Script) -> None:
    body = """const log = new Uint8Array(2 ** 26 + 1).fill(120);
    log[log.length - 1] = given;
    return (await tested.verifyLog(log, new Uint8Array(32))).failure.slug;"""
    assert [script.call(body, last) for last in (10, 120)] == ["record/too-long"] * 2


def test_rejected_vectors_fail(script: Script) -> None:
    names = json.loads((LOGS / "rejected.json").read_text())
    logs = [(name, (LOGS / f"rejected/{name}.jsonl").read_bytes(), ROOT_KEY) for name in names]
    assert {each[0] for each in compare(script, logs).values()} == {"failed"}


def test_random_changes_fail_alike(script: Script) -> None:
    chance = Random(6)
    logs = []
    names = ("closed", "attested", "recovered", "gap", "vector sealed", "incomplete", "torn")
    for number in range(FLIPS):
        name = names[number % len(names)]
        data = bytearray(whole()[name][1])
        at = chance.randrange(len(data))
        data[at] ^= 1 << chance.randrange(8)
        logs.append((f"{name}, octet {at}, {data[at]:02x}", bytes(data), ROOT_KEY))
    for number in range(FLIPS // 4):
        data = whole()[names[number % len(names)]][1]
        logs.append((f"cut {number}", data[: chance.randrange(len(data))], ROOT_KEY))
    found = compare(script, logs)
    # What is cut off from the end of an incomplete log, and a changed octet in its torn line, cannot be noticed.
    assert all(each[0] == "failed" for name, each in found.items() if name.startswith(("closed", "attested", "vector")))


# ------------------------------------------------------------------------------------------------ signatures


@pytest.mark.parametrize("path", ["browser", "noble", None])
def test_signatures_count_by_the_rule(script: Script, path: str | None) -> None:
    groups = json.loads((VECTORS / "ed25519.json").read_text())["testGroups"]
    body = """const unhex = text => Uint8Array.from(text.match(/../g) ?? [], pair => parseInt(pair, 16)), wrong = [];
    for (const { publicKey, tests } of given[0]) for (const { tcId, sig, msg, result } of tests) {
      const found = await tested.signatureCounts(unhex(publicKey.pk), unhex(sig), unhex(msg), given[1]);
      if (found !== (result === "valid")) wrong.push(tcId);
    }
    return wrong;"""
    assert script.call(body, [groups, path]) == []


# ------------------------------------------------------------------------------------------------ trust roots


def test_signer_of_a_trust_root_file(script: Script) -> None:
    body = "return tested.signerOf(octets(given)).then(kid => Array.from(kid), error => error.slug);"
    data = case.root()[1]
    assert bytes(script.call(body, b64encode(data).decode())) == case.KEYS[Duty.ROOT].kid
    assert independent_root.open_root(data, ROOT_KEY, 0)
    for wrong in (b"", data[:-1], _flip(data, len(data) - 1), data + b"\0", b"duty: root"):
        assert isinstance(script.call(body, b64encode(wrong).decode()), str)


# ------------------------------------------------------------------------------------------------ redacted logs


def _keep_effects(line: bytes) -> bool:
    return read(line)["type"] == "effect"


def _keep_signed(line: bytes) -> bool:
    return read(line)["type"] in ("genesis", "effect", "seal")


@pytest.mark.parametrize("keep", [_keep_effects, _keep_signed, lambda line: True, lambda line: False])
@pytest.mark.parametrize("checkpoints", [False, True])
def test_redacted_log_is_consistent_but_never_verified(script: Script, keep: Any, checkpoints: bool) -> None:
    for name in ("closed", "recovered", "attested"):
        lines = whole()[name][1].splitlines(keepends=True)
        found = script.redacted(redact(lines, keep, checkpoints=checkpoints), ROOT_KEY)
        assert (found["verdict"], found["failure"], found["records"]) == ("redacted", None, len(lines)), found
        assert found["shown"][0].startswith("consistent with a log of root ")
        assert found["shown"][0].endswith(": this is a redacted picture, not a record; ask for the log")
        everything = keep(lines[0]) and checkpoints
        signers = sum("checkpoint" in read(line) for line in lines)
        assert any(f"{signers} of {signers} checkpoints" in each for each in found["shown"]) or not everything


def test_changed_redacted_log_fails(script: Script) -> None:
    data = redact(flight(), _keep_signed, checkpoints=True)
    bare = redact(flight(), _keep_effects)
    document = json.loads(data)
    strange = redact(other_flight(), _keep_signed, checkpoints=True)

    def changed(**fields: Any) -> bytes:
        return json.dumps(document | fields, ensure_ascii=False, separators=(",", ":")).encode()

    leaves = document["leaves"]
    other = json.loads(strange)
    wrong = {
        "leaf": changed(leaves=[*leaves[:3], leaves[4], *leaves[4:]]),
        "leaf removed": changed(leaves=leaves[:-1]),
        "leaves swapped": changed(leaves=[*leaves[:3], leaves[4], leaves[3], *leaves[5:]]),
        "root": changed(root=other["root"]),
        "leaves and root of another": changed(leaves=other["leaves"], root=other["root"]),
        "line": changed(lines=[[1, document["lines"][1][1].replace("noted", "notes")]]),
        "line moved": changed(lines=[[2, document["lines"][1][1]]]),
        "line twice": changed(lines=[document["lines"][1], document["lines"][1]]),
        "line out of range": changed(lines=[[len(leaves), "{}"]]),
        "lines of another": changed(lines=other["lines"]),
        "checkpoints of another": changed(checkpoints=other["checkpoints"]),
        "checkpoint removed": changed(checkpoints=[*document["checkpoints"][:1], *document["checkpoints"][2:]]),
        "checkpoint moved": changed(checkpoints=[[8, document["checkpoints"][1][1]]]),
        "version": changed(version=2),
        "field": changed(more=1),
        "not JSON": data[:-1],
        "a log": flight()[0],
    }
    for name, each in wrong.items():
        assert script.redacted(each, ROOT_KEY)["verdict"] == "failed", name
    assert script.redacted(data, STRANGER)["failure"]["slug"].startswith("trust/root-")
    chance = Random(7)
    flipped = []
    for whole_document in (data, bare):
        for _ in range(100):
            at = chance.randrange(
                whole_document.index(b'"leaves"') if whole_document is data else 0, len(whole_document)
            )
            flipped.append(_flip(whole_document, at))
    assert {script.redacted(each, ROOT_KEY)["verdict"] for each in flipped} == {"failed"}


def test_changed_checkpoint_text_of_a_redacted_log_fails(script: Script) -> None:
    document = json.loads(redact(flight(), lambda line: read(line)["type"] == "genesis", checkpoints=True))
    for number in range(len(document["checkpoints"])):
        for at in (3, 60, 110, 160, 210, -8):
            notes = [list(each) for each in document["checkpoints"]]
            text = notes[number][1]
            notes[number][1] = text[:at] + chr(ord(text[at]) ^ 1) + text[at:][1:]
            data = json.dumps(document | {"checkpoints": notes}, ensure_ascii=False, separators=(",", ":")).encode()
            assert script.redacted(data, ROOT_KEY)["verdict"] == "failed", (number, at)
