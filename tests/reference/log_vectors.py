"""The test vectors of docs/log-format.md: logs, keys and expected results, made without `rtshcua.evidence`.

`python tests/reference/log_vectors.py` writes them to tests/vectors/log, always the same octets.
"""

import json
import sys
from base64 import b64encode
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from hashlib import sha256
from pathlib import Path

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).parents[1]))

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from msgspec.structs import replace

from reference.attested_flight import attested
from reference.forgery import LOG_KEY, flight, public_of, read, resealed, seed_of
from reference.independent_boundary import Boundary
from reference.independent_note import read_note
from reference.independent_records import canonical, unbase64
from reference.independent_root import open_root
from reference.independent_verifier import leaf, merkle
from reference.resealing import Fields, line_of
from rtshcua.wire.keys import ANY, Duty, SigningKey
from rtshcua.wire.trust import Thresholds, TrustRoot
from virtual import case

FOLDER = Path(__file__).parents[1] / "vectors" / "log"
WITNESSES = {f"rtshcua/witness/{n}": bytes([0xA0 + n]) * 32 for n in (1, 2, 3)}
MONOTONIC_US, UTC_US = 7_000_000, case.flat.ISSUED + 60_000_000
NULL = "0" * 64
#: a name with characters that the origin escapes
ODD = "M\u00f6we 7/+~%"


@cache
def root() -> bytes:
    """A trust root with three witnesses, two of which must have cosigned."""
    made, _ = case.root()
    witnesses = [SigningKey.from_seed(seed, duty=Duty.WITNESS, development=True) for seed in WITNESSES.values()]
    keys = [key for key in made.keys if key.duty is not Duty.WITNESS]
    keys += [key.verification(vehicles=(ANY,)) for key in witnesses]
    return TrustRoot(
        version=1, development=True, issued_at_us=made.issued_at_us, expires_at_us=made.expires_at_us,
        keys=tuple(keys), thresholds=Thresholds(witness=2),
    ).sign(case.KEYS[Duty.ROOT])  # fmt: skip


def times(ms: int, begun_us: int = MONOTONIC_US) -> Fields:
    """Placeholders for number and link, and the time, some milliseconds after the start."""
    at_us = begun_us + ms * 1000
    return {"_prev": NULL, "seq": 0, "at_us": at_us, "utc_us": UTC_US + ms * 1000, "utc_error_us": 1_000}


def _epoch(number: int) -> str:
    """The key of an epoch, as `reference.seeds` draws the secrets."""
    return public_of((number + 1).to_bytes(32)).hex()


def genesis(**fields: object) -> Fields:
    """A genesis at 0 ms."""
    first = read(flight()[0]) | times(0)
    first["received_us"] = first["at_us"] - 2_000
    return first | {"root": b64encode(root()).decode(), "next_key": _epoch(0)} | fields


def bundle(vehicle: str, **signers: SigningKey) -> str:
    """The bundle of the short mission for a vehicle in a genesis, with the usual keys unless given."""
    shipped = case.policy()
    under = replace(shipped, vehicle=replace(shipped.vehicle, identity=vehicle))
    keys = case.KEYS | {Duty(duty): key for duty, key in signers.items()}
    mission = case.mission(case.short_steps())
    return b64encode(case.seal(replace(mission, vehicle=vehicle), under, keys)).decode()


def effect(ms: int, **fields: object) -> Fields:
    """An effect after some milliseconds."""
    made: Fields = {"type": "effect", "event": "note", "detail": "", "durability": 1}
    return made | dict.fromkeys(("kind", "link", "step", "token"), -1) | times(ms) | fields


def sealing(kind: str, ms: int, **fields: object) -> Fields:
    """A signed record of a kind, with placeholders."""
    made = {"type": kind, "bytes": 0, "checkpoint": None, "digest": NULL, "epoch": 0, "records": 0}
    return made | times(ms) | fields


def seal(ms: int, number: int, **fields: object) -> Fields:
    """A seal that names the key of epoch `number`."""
    return sealing("seal", ms, next_key=_epoch(number)) | fields


def close(ms: int, **fields: object) -> Fields:
    """A close."""
    return sealing("close", ms, ending="completed", tlog=None) | fields


def log(*records: Fields) -> list[bytes]:
    """The lines of these records, numbered, linked and signed."""
    return resealed(map(line_of, records), seed_of)


def sealed() -> list[bytes]:
    """Four epochs, one of them empty, with texts that JCS treats specially."""
    odd = 'quote " backslash \\ tab \t bell \x07 delete \x7f line \u2028 \u00e9 \U0001f681 <&>/'
    records = [
        genesis(), effect(10), effect(20, detail=odd), effect(20, event="landed", durability=2), seal(30, 1),
        seal(40, 2), *(effect(50 + n, token=n) for n in range(5)), seal(9_000, 3), effect(29_000),
    ]  # fmt: skip
    return log(*records, close(29_001, tlog="ab" * 32))


def recovered() -> tuple[list[bytes], bytes]:
    """A torn log that was closed after a restart of the machine, and its discarded bytes."""
    records = [genesis(), effect(10), seal(20, 1), effect(30), effect(40)]
    torn = log(*records, effect(50))[-1][:200]
    again = {"discarded_bytes": len(torn), "discarded_digest": sha256(torn).hexdigest(), "next_key": _epoch(2)}
    anew = times(90_000, 1_000_000 - 90_000_000)
    recover = sealing("recover", 0, **again) | anew
    return log(*records, recover, close(0, ending="recovered") | anew | {"at_us": 1_000_400}), torn


def anchor(line: bytes, names: Sequence[str], time_s: int = UTC_US // 1_000_000 + 3) -> str:
    """The checkpoint of a signed record with cosignatures of these witnesses."""
    note = read(line)["checkpoint"]
    text = note.partition("\n\n")[0] + "\n"
    for name in names:
        key = Ed25519PrivateKey.from_private_bytes(WITNESSES[name])
        ident = sha256(name.encode() + b"\n\x04" + key.public_key().public_bytes_raw()).digest()[:4]
        signature = key.sign(f"cosignature/v1\ntime {time_s}\n{text}".encode())
        note += f"\u2014 {name} {b64encode(ident + time_s.to_bytes(8) + signature).decode()}\n"
    return note


def anchored() -> tuple[list[bytes], bytes]:
    """Two of three witnesses saw the first seal (recorded), one of them the second (beside the log)."""
    one, two, _ = WITNESSES
    head = [genesis(), effect(10), seal(20, 1)]
    note = anchor(log(*head)[-1], [one, two])
    records = [*head, effect(30, event="anchored", detail=note), seal(40, 2), effect(50), close(60)]
    lines = log(*records)
    return lines, (anchor(lines[4], [one]) + "\n").encode()


def stalled() -> list[bytes]:
    """Three gaps: before a seal with nothing else between, one of 27 s with records behind it, one before the close."""
    return log(
        genesis(), effect(10), seal(30_000, 1), effect(31_000), effect(58_000, event="stalled", detail="27000000 us"),
        effect(58_500), effect(77_000), seal(77_001, 2), effect(77_002), close(140_000),
    )  # fmt: skip


def imaged() -> list[bytes]:
    """Images of one camera that restarts, a picture that failed, and the lists of missing ones."""
    plain: Fields = {
        "above_home_mm": 20_000, "above_sea_mm": 508_000, "asked": 0, "attitude": "camera", "camera": 100,
        "file": "IMG_0001.JPG", "horizontal_mm": 900, "index": 0, "latitude": 473_977_400, "longitude": 85_455_900,
        "pitch_cd": -9_000, "result": 1, "roll_cd": 0, "series": 0, "unit": 0, "utc_us": UTC_US,
        "vertical_mm": None, "yaw_cd": 12_345,
    }  # fmt: skip

    def image(at: int, **changed: object) -> Fields:
        return effect(at, event="image", detail=canonical({**plain, **changed}).decode())

    def missing(at: int, *lost: list[int], **told: int) -> Fields:
        detail = {"camera": 100, "lost": list(lost), **told}
        return effect(at, event="images-missing", detail=canonical(detail).decode())

    return log(
        genesis(), image(10), image(20, index=3, asked=1), image(30, index=None, result=0, file=""),
        missing(40, [1, 2], [4, 4], failed=1, first=0, last=4, missing=3, series=0, taken=2),
        image(50, index=1, asked=2), image(60, series=1, latitude=None, longitude=None, above_sea_mm=None),
        missing(70, failed=0, first=0, last=0, missing=0, series=1, taken=1), close(80),
    )  # fmt: skip


def _rejected() -> Iterator[tuple[str, str, list[bytes]]]:
    """The rejected logs: name, violated rule of the page, lines."""
    good = sealed()
    text = good[1]
    yield "chain", "4: a record edited", [*good[:1], text.replace(b'"note"', b'"nose"'), *good[2:]]
    yield "not_canonical", "1: a space", [*good[:1], text.replace(b",", b", ", 1), *good[2:]]
    yield "duplicate_key", "1: a key twice", [*good[:1], text.replace(b'"seq":1', b'"seq":1,"seq":1'), *good[2:]]
    yield "after_close", "7: a record after the close", [*good, good[1]]
    edited = [*good[:1], line_of(read(text) | {"detail": "edited"}), *good[2:]]
    yield "rehashed", "6: root", resealed(edited, seed_of, keep=("checkpoint",))
    yield "later_key", "2: sealed by a later key", _with_key(good, 2)
    yield "stripped", "2: no signature", [*good[:-1], line_of(read(good[-1]) | {"checkpoint": None})]
    yield "unsealed", "3: more than 20 s and no seal", log(genesis(), effect(20_001), close(20_002))
    gap = {"event": "stalled", "detail": "30000000 us"}
    yield "gap_untold", "3: records after a silence that no record tells of", log(
        genesis(), effect(0), effect(30_000, event="late", detail="30000000 us"), seal(30_000, 1), close(30_001)
    )  # fmt: skip
    yield "gap_longer", "3: a gap that is longer than the silence", log(
        genesis(), effect(1), effect(30_000, **gap), seal(30_000, 1), close(30_001)
    )  # fmt: skip
    yield "gap_twice", "3: two gaps in an epoch", log(
        genesis(), effect(30_000, **gap), effect(60_000, **gap), seal(60_000, 1), close(60_001)
    )  # fmt: skip
    yield "gap_unsealed", "3: more than 20 s besides the gap", log(
        genesis(), effect(10_000), effect(40_000, **gap), effect(50_001), close(50_002)
    )  # fmt: skip
    yield "clock", "5: monotonic time goes back", log(genesis(), effect(10), effect(9), close(20))
    later = genesis(received_us=MONOTONIC_US + 1)
    yield "received", "5: the bundle received after the log began", log(later, effect(10), close(20))
    yield "utc_jump", "5: the clocks part", log(genesis(), effect(10, utc_us=UTC_US + 2_011_000), close(20))
    yield "origin", "2: the origin of another boot", _with_text(good, lambda _, text: text.replace("00\n", "01\n", 1))
    larger = _with_text(good, lambda n, text: text.replace(f"\n{n}\n", f"\n{n + 1}\n", 1))
    yield "size", "2: the size one too large", larger
    zeros = f"after {'A' * 43}=\n"
    other = _with_text(good, lambda n, text: text if n != 4 else text.rpartition("after ")[0] + zeros)
    yield "after", "2: it names another checkpoint than the one before", other
    left = _with_text(good, lambda n, text: text if n != 4 else text.rpartition("after ")[0])
    yield "after_none", "2: it names no checkpoint before", left
    yield "wrong_kid", "5, step 2: the name of another key", log(genesis(log_kid="00" * 16), close(10))
    yield "other_vehicle", "3: the bundle of another vehicle", log(genesis(vehicle=ODD), close(10))
    yield "other_mission", "3: the bundle of another mission", log(genesis(mission="another"), close(10))
    own = read(flight()[0])["vehicle"]
    for duty in ("policy", "mission"):
        stranger = SigningKey.from_seed(b"\x77" * 32, duty=Duty(duty), development=True)
        forged = log(genesis(bundle=bundle(own, **{duty: stranger})), close(10))
        yield f"bundle_{duty}", f"3: the {duty} signed by a stranger", forged
    own_evidence = list(attested())
    number = next(n for n, line in enumerate(own_evidence) if read(line)["type"] == "decision")
    altered = line_of(read(own_evidence[number]) | {"valid_until_us": 0})
    lie = [*own_evidence[:number], altered, *own_evidence[number + 1 :]]
    yield "boundary_altered", "7: a decision altered by the holder of the log key", resealed(lie, seed_of)
    lie = [*own_evidence[:1], *own_evidence[2:]]
    yield "boundary_unsigned", "7: no statement before the first entry", resealed(lie, seed_of)
    lie = [line for n, line in enumerate(own_evidence) if n != len(own_evidence) - 2]
    yield "boundary_cut", "7: no final statement", resealed(lie, seed_of)
    yield "second_genesis", "1: a genesis that is not line 0", log(genesis(), genesis(), close(10))


def _with_text(lines: list[bytes], text: Callable[[int, str], str]) -> list[bytes]:
    """Replace every checkpoint by the result of `text`, signed."""
    return resealed(lines, seed_of, text=text)


def _with_key(lines: list[bytes], epoch: int) -> list[bytes]:
    """Seal the first epoch with the key of another."""
    own = read(lines[0])["next_key"]
    return resealed(lines, lambda public: (epoch + 1).to_bytes(32) if public == own else seed_of(public))


def digests(lines: list[bytes]) -> list[str]:
    """D(0), D(1), ... of the boundary's own evidence."""
    first, *rest = map(read, lines)
    trust = open_root(unbase64(first["root"]), case.KEYS[Duty.ROOT].public, first["utc_us"])
    boundary = Boundary(first, trust)
    for record in rest:
        boundary.line(record)
    return [digest.hex() for digest in boundary.digests]


def expected(lines: list[bytes]) -> Fields:
    """The results that every reader must find in a valid log."""
    leaves = [leaf(line) for line in lines]
    signed = {}
    for number, line in enumerate(lines):
        record = read(line)
        if "checkpoint" in record:
            note = read_note(record["checkpoint"])
            signed[str(number)] = {
                "root": note.root.hex(), "record": note.record.hex(), "key": note.key.hex() if note.key else None,
                "after": note.after.hex() if note.after else None, "note": record["checkpoint"],
            }  # fmt: skip
    return {
        "lines": len(lines),
        "leaves": [each.hex() for each in leaves],
        "root": merkle(leaves).hex(),
        "roots": [merkle(leaves[:n]).hex() for n in range(len(leaves) + 1)],
        "signed": signed,
    }


def made() -> dict[str, bytes]:
    """All files by name."""
    whole, torn = recovered()
    witnessed, beside = anchored()
    odd = log(genesis(vehicle=ODD, bundle=bundle(ODD)), effect(10), close(20))
    logs = {
        "closed": (list(flight()), "closed", 0),
        "attested": (list(attested()), "closed", 0),
        "sealed": (sealed(), "closed", 0),
        "stalled": (stalled(), "closed", 0),
        "imaged": (imaged(), "closed", 0),
        "named": (odd, "closed", 0),
        "recovered": (whole, "closed", 0),
        "anchored": (witnessed, "closed", 2),
        "cut": (sealed()[:-2], "incomplete", 0),
        "torn": ([*sealed()[:7], sealed()[7][:100]], "incomplete", 0),
    }
    files = {f"{name}.jsonl": b"".join(lines) for name, (lines, _, _) in logs.items()}
    files["anchored.anchors"] = beside
    files["recovered.discarded"] = torn
    of: Fields = {
        name: {"verdict": verdict, "anchored": size} | expected([line for line in lines if line.endswith(b"\n")])
        for name, (lines, verdict, size) in logs.items()
    }
    of["attested"]["boundary"] = digests(list(attested()))
    of["stalled"]["gaps"] = [[2, 29_990_000], [4, 27_000_000], [9, 62_998_000]]
    rejected = {}
    for name, why, lines in _rejected():
        rejected[name] = why
        files[f"rejected/{name}.jsonl"] = b"".join(lines)
    keys = {
        "root": {"public": case.KEYS[Duty.ROOT].public.hex(), "kid": case.KEYS[Duty.ROOT].kid.hex()},
        "log": {"seed": LOG_KEY.private.private_bytes_raw().hex(), "public": LOG_KEY.public.hex()},
        "boundary": {
            "seed": case.BOUNDARY_KEY.private.private_bytes_raw().hex(),
            "public": case.BOUNDARY_KEY.public.hex(),
        },
        "epochs": [{"seed": n.to_bytes(32).hex(), "public": public_of(n.to_bytes(32)).hex()} for n in range(1, 13)],
        "witnesses": {n: {"seed": s.hex(), "public": public_of(s).hex()} for n, s in WITNESSES.items()},
    }
    for name, value in (("keys", keys), ("expected", of), ("rejected", rejected)):
        files[f"{name}.json"] = json.dumps(value, indent=1, ensure_ascii=False).encode() + b"\n"
    return files


if __name__ == "__main__":
    (FOLDER / "rejected").mkdir(parents=True, exist_ok=True)
    for file, data in made().items():
        (FOLDER / file).write_bytes(data)
