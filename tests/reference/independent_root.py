"""An independent reader of the trust root: COSE_Sign1 and deterministic CBOR with the standard library only.

Independent of `rtshcua.wire`, for `independent_verifier`. RFC 9052 section 4.4, RFC 8949 section 4.2.1.
"""

import hashlib
import re
from dataclasses import dataclass
from functools import lru_cache

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

_CONTENT = "application/vnd.rtshcua.root+cbor"
_KEY_FIELDS = {"duty", "public", "roles", "sources", "vehicles", "expires_us", "development", "policies", "person"}
_ROOT_FIELDS = {"version", "development", "issued_at_us", "expires_at_us", "keys", "thresholds"}


class Untrusted(Exception):
    """The root is not signed by the pinned key, or has invalid content."""


@dataclass(frozen=True)
class Root:
    """The parts of a root for a verifier of logs: its keys, and the number of required witnesses."""

    keys: list[dict]
    witnesses: int

    def public(self, duty: str, vehicle: str, now_us: int) -> list[bytes]:
        """The keys of a duty that are valid for a vehicle at a UTC time."""
        return [
            key["public"]
            for key in self.keys
            if key["duty"] == duty
            and (vehicle in key["vehicles"] or "*" in key["vehicles"])
            and (key["expires_us"] is None or now_us < key["expires_us"])
        ]


def key_id(duty: str, public: bytes) -> bytes:
    """The name of a key (section 7)."""
    return hashlib.sha256(b"rtshcua/key\0rtshcua/duty/" + duty.encode() + b"\0" + public).digest()[:16]


_P = 2**255 - 19
#: y of the points of small order, as listed in section 6 of the page
_WEAK = {0, 1, _P - 1} | {
    int.from_bytes(bytes.fromhex(text), "little")
    for text in (
        "26e8958fc2b227b045c3f489f2ef98f0d5dfac05d3c63339b13802886d53fc05",
        "c7176a703d4dd84fba3c0b760d10670f2a2053fa2c39ccc64ec7fd7792ac037a",
    )
}


@lru_cache(maxsize=1024)  # tests make many logs of one flight
def holds(public: bytes, signature: bytes, message: bytes) -> bool:
    """Whether an Ed25519 signature is valid (section 6 of the page)."""
    if len(public) != 32 or len(signature) != 64 or weak(public) or weak(signature[:32]):
        return False
    try:
        Ed25519PublicKey.from_public_bytes(public).verify(signature, message)
    except (InvalidSignature, ValueError):
        return False
    return True


def weak(point: bytes) -> bool:
    """Whether the octets of a point are not in canonical form, or of small order."""
    y = int.from_bytes(point, "little") & ((1 << 255) - 1)
    return y >= _P or y in _WEAK


def open_root(envelope: bytes, pinned: bytes, now_us: int) -> Root:
    """The root, if the pinned root key (32 octets, or its name of 16) signed it. Raises `Untrusted`."""
    try:
        return _open(envelope, pinned, now_us)
    except (AttributeError, KeyError, TypeError) as error:
        raise Untrusted("not of the form of a root") from error


def _open(envelope: bytes, pinned: bytes, now_us: int) -> Root:
    protected, payload, signature, kid = _parts(envelope, _CONTENT)
    body = _body(payload)
    keys = body["keys"]
    signer = next((key for key in keys if key["duty"] == "root" and key_id("root", key["public"]) == kid), None)
    if signer is None or pinned not in (signer["public"], kid):
        raise Untrusted("not signed by the pinned key")
    if not holds(signer["public"], signature, _signed(protected, "root", payload)):
        raise Untrusted("the signature does not hold")
    if now_us >= body["expires_at_us"] or (signer["expires_us"] is not None and now_us >= signer["expires_us"]):
        raise Untrusted("expired")
    return Root(keys, body["thresholds"].get("witness", 1))


def _parts(envelope: bytes, content: str) -> tuple[bytes, bytes, bytes, bytes]:
    """The protected header, payload, signature and key id of a COSE_Sign1."""
    if envelope[:1] != b"\xd2":
        raise Untrusted("no COSE_Sign1")
    match _whole(envelope[1:]):
        case [bytes(protected), {**free}, bytes(payload), bytes(signature)] if not free and len(signature) == 64:
            pass
        case _:
            raise Untrusted("not the four parts of a COSE_Sign1")
    headers = _whole(protected)
    if not isinstance(headers, dict) or set(headers) != {1, 3, 4} or headers[1] != -19 or headers[3] != content:
        raise Untrusted("other headers")
    return protected, payload, signature, headers[4]


def _signed(protected: bytes, duty: str, payload: bytes) -> bytes:
    """The signed bytes of a COSE_Sign1 (RFC 9052 section 4.4)."""
    label = f"rtshcua/duty/{duty}".encode()
    return _head(4, 4) + _text("Signature1") + _bytes(protected) + _bytes(label) + _bytes(payload)


def check_bundle(bundle: bytes, root: Root, vehicle: str, mission: str, now_us: int) -> None:
    """Step 3 of section 5: check that the bundle has authorised signatures and is for this vehicle and mission."""
    try:
        _bundle(bundle, root, vehicle, mission, now_us)
    except (AttributeError, IndexError, KeyError, TypeError) as error:
        raise Untrusted("not of the form of a bundle") from error


def _bundle(bundle: bytes, root: Root, vehicle: str, mission: str, now_us: int) -> None:
    match _whole(bundle):
        case ["rtshcua/bundle", 1, [bytes(first), bytes(second)]]:
            pass
        case _:
            raise Untrusted("not a bundle, version 1")
    policy_payload, _ = _envelope(first, root, "policy", vehicle, now_us)
    mission_payload, key = _envelope(second, root, "mission", vehicle, now_us)
    match _whole(policy_payload), _whole(mission_payload):
        case ["rtshcua/policy", 8, [*policy]], ["rtshcua/mission", 1, [*flown]]:
            pass
        case _:
            raise Untrusted("not a policy, version 7, and a mission, version 1")
    name, version, identity, roles = policy[0], policy[1], policy[2][1], policy[4]
    digest = hashlib.sha256(b"rtshcua/policy\0" + policy_payload).digest()
    if flown[3:7] != [vehicle, name, version, digest] or identity != vehicle:
        raise Untrusted("mission, policy and vehicle do not belong together")
    if flown[0] != mission:
        raise Untrusted("another mission")
    if name not in key["policies"] and "*" not in key["policies"]:
        raise Untrusted("a mission key of other policies")
    for step in flown[9]:
        source, role = ("agent", "operator", "onboard", "reflex")[step[4]], roles[step[5]]
        if source not in key["sources"] or (role not in key["roles"] and "*" not in key["roles"]):
            raise Untrusted("a mission key of other sources or roles")


def _envelope(envelope: bytes, root: Root, duty: str, vehicle: str, now_us: int) -> tuple[bytes, dict]:
    """The payload that a key of a duty signed for a vehicle, and that key."""
    protected, payload, signature, kid = _parts(envelope, f"application/vnd.rtshcua.{duty}+cbor")
    keys = [each for each in root.keys if each["duty"] == duty and key_id(duty, each["public"]) == kid]
    if not keys or keys[0]["public"] not in root.public(duty, vehicle, now_us):
        raise Untrusted(f"not signed by a key of duty {duty} for this vehicle")
    if not holds(keys[0]["public"], signature, _signed(protected, duty, payload)):
        raise Untrusted(f"the signature of the {duty} does not hold")
    return payload, keys[0]


def payload_of(envelope: bytes, duty: str, content: str, keys: list[bytes]) -> bytes:
    """The payload that one of these public keys of a duty signed. Raises `Untrusted`."""
    protected, payload, signature, kid = _parts(envelope, content)
    public = next((each for each in keys if key_id(duty, each) == kid), None)
    if public is None or not holds(public, signature, _signed(protected, duty, payload)):
        raise Untrusted(f"not signed by a key of duty {duty}")
    return payload


def whole(data: bytes) -> object:
    """The one item of canonical CBOR. Raises `Untrusted`."""
    return _whole(data)


def _body(payload: bytes) -> dict:
    match _whole(payload):
        case ["rtshcua/root", 2, {**body}] if set(body) - {"revoked"} == _ROOT_FIELDS:
            pass
        case _:
            raise Untrusted("not a trust root, version 2")
    for key in body["keys"]:
        if set(key) != _KEY_FIELDS or len(key["public"]) != 32 or weak(key["public"]):
            raise Untrusted("not a key")
        approves = key["duty"] == "approval"
        if (key["policies"] and key["duty"] != "mission") or (key["person"] and not approves):
            raise Untrusted("a key with what only others have")
        if approves and not re.fullmatch(r"[a-z0-9][a-z0-9._-]{0,63}", key["person"]):
            raise Untrusted("an approval key of nobody")
        if approves and (len(key["roles"]) != 1 or key["roles"] == ["*"] or key["sources"] != ["operator"]):
            raise Untrusted("an approval key that is not for one role, in person")
        if key["development"] and not body["development"]:
            raise Untrusted("a development key")
    if body["version"] < 1 or body["expires_at_us"] <= body["issued_at_us"]:
        raise Untrusted("contradicts itself")
    if len({key["public"] for key in body["keys"]}) != len(body["keys"]):
        raise Untrusted("a key named twice")
    revoked = body.get("revoked", [b"\0" * 8])
    if (
        not revoked
        or len({*revoked}) != len(revoked)
        or any(type(n) is not bytes or len(n) not in (8, 16) for n in revoked)
    ):
        raise Untrusted("revokes something else than keys, each once")
    if any(key_id(key["duty"], key["public"]) in revoked for key in body["keys"]):
        raise Untrusted("trusts what it revokes")
    if any(n != 1 for duty, n in body["thresholds"].items() if duty != "witness"):
        raise Untrusted("a threshold other than 1")
    return body


def _head(major: int, n: int) -> bytes:
    if n < 24:
        return bytes([major << 5 | n])
    for size, info in ((1, 24), (2, 25), (4, 26), (8, 27)):
        if n < 1 << 8 * size:
            return bytes([major << 5 | info]) + n.to_bytes(size)
    raise Untrusted("too large")


def _bytes(data: bytes) -> bytes:
    return _head(2, len(data)) + data


def _text(text: str) -> bytes:
    return _head(3, len(text.encode())) + text.encode()


def _encode(value: object) -> bytes:
    match value:
        case None:
            return b"\xf6"
        case bool():
            return b"\xf5" if value else b"\xf4"
        case int():
            return _head(0, value) if value >= 0 else _head(1, ~value)
        case bytes():
            return _bytes(value)
        case str():
            return _text(value)
        case list():
            return _head(4, len(value)) + b"".join(map(_encode, value))
        case dict():
            pairs = sorted((_encode(key), _encode(item)) for key, item in value.items())
            return _head(5, len(pairs)) + b"".join(key + item for key, item in pairs)
    raise Untrusted("no such value")


@lru_cache(maxsize=256)  # many logs share bundles and roots, and the decoded values are never changed
def _whole(data: bytes) -> object:
    """The only item of `data`; canonical, because encoding it again gives `data`."""
    try:
        value, end = _item(data, 0, 0)
        canonical = end == len(data) and _encode(value) == data
    except (IndexError, UnicodeError, TypeError) as error:
        raise Untrusted("no CBOR") from error
    if not canonical:
        raise Untrusted("not canonical CBOR")
    return value


def _item(data: bytes, at: int, depth: int) -> tuple[object, int]:
    if depth > 32:
        raise Untrusted("nested too deep")
    major, info = data[at] >> 5, data[at] & 31
    at += 1
    if major == 7:
        if info not in (20, 21, 22):
            raise Untrusted("no such value")
        return {20: False, 21: True, 22: None}[info], at
    if info > 27 or major == 6:
        raise Untrusted("no such item")
    size = 0 if info < 24 else 1 << (info - 24)
    n = info if size == 0 else int.from_bytes(data[at : at + size])
    at += size
    if major < 2:
        return (n if major == 0 else ~n), at
    if n > len(data) - at:
        raise Untrusted("longer than what follows")
    if major < 4:
        part = data[at : at + n]
        return (part if major == 2 else part.decode()), at + n
    items = []
    for _ in range(n if major == 4 else 2 * n):
        item, at = _item(data, at, depth + 1)
        items.append(item)
    return (items if major == 4 else dict(zip(items[::2], items[1::2], strict=True))), at
