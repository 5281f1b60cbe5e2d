"""Threat: an untrusted bundle, trust root, document, proof or record contains as many tiny items as its size allows,
so that a tool that only displays it is busy for seconds, and needs hundreds of megabytes.
"""

import json
import tracemalloc
from base64 import b64encode
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import pytest

from hostile.documents import enveloped, head
from rtshcua.app.documents import claimed, recorded_replacement
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.proofs.cose_receipt import check_receipt
from rtshcua.evidence.proofs.file import MAX_PROOF, read_extra
from rtshcua.front.cli import app
from rtshcua.ground.checker import geojson
from rtshcua.ground.checker.geojson import NoArea, read_area
from rtshcua.ground.language.size_limits import MAX_SIZE
from rtshcua.wire import cbor, cose, names
from rtshcua.wire.bundle import MAX_BUNDLE, claimed_vehicle, envelopes
from rtshcua.wire.document import MAX_DOCUMENT, kind_of
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.names import Artefact
from rtshcua.wire.qualification import read_qualification
from rtshcua.wire.statement import claimed as claimed_statement
from rtshcua.wire.trust import MAX_ROOT, open_root
from rtshcua.wire.untrusted import Untrusted
from virtual.sampling import each_once

ANYONE = SigningKey.from_seed(bytes([5]) * 32, duty=Duty.POLICY)
#: the limit of decoded items of unverified input: 0.3 s on a slow machine
ITEMS = 1 << 17
MOST_BYTES = 64 << 20
#: seconds of the processor with every call counted and all memory traced: several times the bound
BOUND_S = 6.0


def items(kind: str, octets: int) -> bytes:
    """One item of at most so many octets that consists of tiny ones."""
    match kind:
        case "arrays":
            return head(4, octets - 5) + b"\x80" * (octets - 5)
        case "maps":
            return head(4, octets - 5) + b"\xa0" * (octets - 5)
        case "nested":
            count = (octets - 5) // 32
            return head(4, count) + (b"\x81" * 30 + b"\x80") * count
        case "pairs":
            count = (octets - 5) // 6
            keys = (65536 + number for number in range(count))
            return head(5, count) + b"".join(b"\x1a" + key.to_bytes(4) + b"\x80" for key in keys)
    return head(4, (octets - 5) // 2) + b"\x61a" * ((octets - 5) // 2)


KINDS = ("arrays", "maps", "nested", "pairs", "texts")


def wrapped(kind: Artefact, body: bytes) -> bytes:
    return b"\x83" + cbor.encode((kind.name, kind.version))[1:] + body


def claiming(kind: Artefact, payload: bytes) -> bytes:
    return cose.sign1(payload, key=ANYONE, duty=Duty.POLICY, content_type=kind.content_type)


def bundle(kind: str) -> bytes:
    """A bundle with a hostile policy payload."""
    policy = claiming(names.POLICY, wrapped(names.POLICY, items(kind, MAX_BUNDLE // 2)))
    return cbor.encode((names.BUNDLE.name, names.BUNDLE.version, (policy, claiming(names.MISSION, b""))))


def replacement(kind: str) -> str:
    body = wrapped(names.REPLACEMENT, items(kind, MAX_DOCUMENT - 300))
    return b64encode(claiming(names.REPLACEMENT, body)).decode()


#: readers of untrusted input by name, with their input made of tiny items of a kind
ENTRIES: dict[str, tuple[Callable[[Any], object], Callable[[str], object]]] = {
    "a bundle": (envelopes, lambda kind: wrapped(names.BUNDLE, items(kind, MAX_BUNDLE - 32))),
    "the vehicle of a bundle": (claimed_vehicle, bundle),
    "a bundle that is shown": (claimed, bundle),
    "an envelope": (cose.unverified, lambda kind: b"\xd2" + items(kind, 8 << 20)),
    "a header": (cose.unverified, lambda kind: enveloped(items(kind, 8 << 20), b"")),
    "a document": (kind_of, lambda kind: enveloped(items(kind, MAX_DOCUMENT - 90), b"")),
    "a replacement in a record": (recorded_replacement, replacement),
    "a root": (
        lambda data: open_root(data, pinned=None, now_us=0),
        lambda kind: claiming(names.ROOT, wrapped(names.ROOT, items(kind, MAX_ROOT - 300))),
    ),
    "a root in a record": (
        lambda data: open_root(data, pinned=bytes(16), now_us=0),
        lambda kind: claiming(names.ROOT, wrapped(names.ROOT, items(kind, MAX_ROOT - 300))),
    ),
    "a qualification": (read_qualification, lambda kind: wrapped(names.QUALIFICATION, items(kind, 8 << 20))),
    "a statement": (
        claimed_statement, lambda kind: claiming(names.STATEMENT, wrapped(names.STATEMENT, items(kind, 1_800)))
    ),
    "a proof": (read_extra, lambda kind: wrapped(names.PROOF, items(kind, MAX_PROOF - 32))),
    "a receipt": (lambda data: check_receipt(data, bytes(16)), lambda kind: b"\xd2" + items(kind, MAX_PROOF - 1)),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("entry", "kind"), each_once(ENTRIES, KINDS))
def test_unsigned_cbor_is_refused_before_decoding(entry: str, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    takes, make = ENTRIES[entry]
    data = make(kind)
    decoded = 0
    item = cbor._item

    def counted(*arguments: Any) -> Any:
        nonlocal decoded
        decoded += 1
        return item(*arguments)

    monkeypatch.setattr(cbor, "_item", counted)
    tracemalloc.start()
    begun = process_time()
    try:
        assert isinstance(takes(data), Flaw)
    except Untrusted:
        pass
    finally:
        took, (_, most) = process_time() - begun, tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert decoded <= ITEMS
    assert most < MOST_BYTES
    assert took < BOUND_S


@pytest.mark.parametrize("entry", ["a bundle", "the vehicle of a bundle", "a root"])
def test_show_reports_hostile_cbor(entry: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "given"
    data = ENTRIES[entry][1]("arrays")
    assert isinstance(data, bytes)
    path.write_bytes(data)
    assert app.main(["show", str(path)]) in (ExitCode.INPUT, ExitCode.UNTRUSTED)
    assert "items" in capsys.readouterr().err


JSON = {"lists": b"[]", "objects": b"{}", "numbers": b"1", "texts": b'""', "features": b'{"type":"Feature"}',
        "positions in lists": b"[[1,2]]", "positions deep down": b"[" * 9 + b"1,2" + b"]" * 9,
        "a position and a list": b"[1,2],[]", "positions never closed": b"[1,2"}  # fmt: skip


#: files and limits of one eighth, because counting octets is slow
_PART = 8


@pytest.mark.slow
@pytest.mark.parametrize("kind", JSON)
def test_geojson_with_too_many_values_is_refused_early(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(geojson, "MAX_VALUES", geojson.MAX_VALUES // _PART)
    item = JSON[kind] + b","
    data = b'{"type":"FeatureCollection","features":[' + item * (MAX_SIZE // _PART // len(item) - 20) + b"1]}"
    tracemalloc.start()
    begun = process_time()
    try:
        with pytest.raises(NoArea, match=f"more than {geojson.MAX_VALUES} values"):
            read_area(data, None)
        took, (_, most) = process_time() - begun, tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < MOST_BYTES // _PART
    assert took < BOUND_S


@pytest.mark.slow
def test_borders_that_fill_a_file_are_read() -> None:
    begins = b'{"type":"Polygon","coordinates":[[[8,47],[9,47],[9,48],[8,47]]]}'
    first = b'{"type":"FeatureCollection","features":[{"type":"Feature","id":"a","geometry":' + begins + b"},"
    first += b'{"type":"Feature","id":"b","geometry":{"type":"Polygon","coordinates":[['
    for position in (b"[8.545612,47.397712],", b"[ 8.5456 ,\n -47.3977, 0.0 ],"):
        borders = position * ((MAX_SIZE // _PART - len(first) - 20) // len(position))
        whole = first + borders + b"[8,47]]]}}]}"
        tracemalloc.start()
        try:
            (area,) = read_area(whole, "a")
            _, most = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert len(area.outer) == 3
        assert most < MOST_BYTES // _PART, "of the positions, only those of the area are read"
        with pytest.raises(NoArea, match="positions; the limit is 4,096 corners"):
            read_area(whole, "b")


def test_a_border_of_many_corners_is_read_however_its_texts_are_written() -> None:
    corners = [[8 + number / 1_000_000, 47.0] for number in range(500)] + [[8.0, 47.1], [8.0, 47.0]]
    told = {"comma": ",[{" * 1_000, "escaped": '"\\' * 1_000}
    feature = {"type": "Feature", "properties": told, "geometry": {"type": "Polygon", "coordinates": [corners]}}
    (area,) = read_area(json.dumps(feature).encode(), None)
    assert len(area.outer) == len(corners) - 1
