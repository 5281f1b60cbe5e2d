"""Trust roots and bundles that no key holder of good faith signs, in a browser: refused as in Python."""

from base64 import b64encode
from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser

from reference.browser import CHROMIUM
from reference.forgery import LOG_KEY, STRANGER, edit, flight, read, signed
from reference.independent_records import unbase64
from reference.page_script import Script, compare, script_of
from reference.verifiers import ROOT_KEY
from rtshcua.wire import cbor, cose
from rtshcua.wire.keys import Duty, SigningKey
from virtual import case

pytestmark = [
    pytest.mark.clients,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine"),
]
GENESIS = read(flight()[0])
Headers = dict[int, Any]


@pytest.fixture(scope="module")
def script(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Script]:
    with script_of(browser, tmp_path_factory.mktemp("page")) as made:
        yield made


def envelope(
    payload: bytes, duty: Duty, *, key: SigningKey | None = None, headers: Headers | None = None, free: Any = None,
    content: str | None = None, more: tuple[Any, ...] = (), shorten: int = 0,
) -> bytes:  # fmt: skip
    """A COSE_Sign1 of any form, signed as its form demands."""
    key = key or case.KEYS[duty]
    made = {1: -19, 3: content or f"application/vnd.rtshcua.{duty}+cbor", 4: key.kid} | (headers or {})
    protected = cbor.encode({name: value for name, value in made.items() if value is not None})
    signature = key.sign(cbor.encode(("Signature1", protected, duty.label, payload)), duty=key.duty)
    return b"\xd2" + cbor.encode((protected, free or {}, payload, signature[: 64 - shorten], *more))


def root_body() -> dict[str, Any]:
    """The body of the usual trust root."""
    name, version, body = cbor.decode(case.root()[0].encode())  # type: ignore[misc]
    assert (name, version) == ("rtshcua/root", 2)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in body.items()}  # type: ignore[union-attr]


def root(body: Any, **form: Any) -> bytes:
    return envelope(cbor.encode(("rtshcua/root", 2, body)), Duty.ROOT, **form)


def _keys(change: Any) -> dict[str, Any]:
    body = root_body()
    return body | {"keys": [change(dict(key)) for key in body["keys"]]}


def _of(of: str, /, **fields: Any) -> dict[str, Any]:
    return _keys(lambda key: key | fields if key["duty"] == of else key)


def _thresholds(**numbers: Any) -> dict[str, Any]:
    body = root_body()
    return body | {"thresholds": {name: n for name, n in (body["thresholds"] | numbers).items() if n is not None}}


def _witnessed() -> dict[str, Any]:
    """Two witnesses, both of which must have cosigned."""
    body = _thresholds(witness=2)
    public = SigningKey.from_seed(STRANGER, duty=Duty.WITNESS, development=True).public
    second = next(dict(key) for key in body["keys"] if key["duty"] == "witness") | {"public": public}
    return body | {"keys": [*body["keys"], second]}


def roots() -> dict[str, bytes]:
    body = root_body()
    usual = cbor.encode(("rtshcua/root", 2, body))
    assert usual == case.root()[0].encode()
    log_key = next(dict(key) for key in body["keys"] if key["duty"] == "log")
    many = [log_key | {"public": n.to_bytes(32, "little")} for n in range(2, 520)]
    stranger = SigningKey.from_seed(STRANGER, duty=Duty.ROOT, development=True)
    good = root(body)
    at = usual.index(b"\x67version") + 8  # the value of the field
    made = {
        "usual": good,
        "two witnesses of two": root(_witnessed()),
        "algorithm": root(body, headers={1: -8}),
        "content type": root(body, content="application/vnd.rtshcua.log+cbor"),
        "header more": root(body, headers={5: 1}),
        "header missing": root(body, headers={4: None}),
        "header of another type": root(body, headers={3: 7}),
        "kid of 15 octets": root(body, headers={4: bytes(15)}),
        "kid of another key": root(body, headers={4: LOG_KEY.kid}),
        "long header": root(body, content="x" * 200),
        "unprotected header": root(body, free={1: -19}),
        "short signature": root(body, shorten=1),
        "part more": root(body, more=(1,)),
        "another tag": b"\xd1" + good[1:],
        "no array": b"\xd2" + cbor.encode({}),
        "empty": b"",
        "tag alone": b"\xd2",
        "something behind": good + b"\0",
        "another name": envelope(cbor.encode(("rtshcua/boot", 2, body)), Duty.ROOT),
        "another version": envelope(cbor.encode(("rtshcua/root", 3, body)), Duty.ROOT),
        "four parts": envelope(cbor.encode(("rtshcua/root", 2, body, 1)), Duty.ROOT),
        "two parts": envelope(cbor.encode(("rtshcua/root", 2)), Duty.ROOT),
        "body of another type": root([]),
        "field more": root(body | {"more": 1}),
        "field missing": root({name: each for name, each in body.items() if name != "development"}),
        "keys of another type": root(body | {"keys": 1}),
        "key of another type": root(body | {"keys": [1]}),
        "version of another type": root(body | {"version": "1"}),
        "version true": root(body | {"version": True}),
        "expiry of another type": root(body | {"expires_at_us": None}),
        "development of another type": root(body | {"development": 1}),
        "key with a field more": root(_keys(lambda key: key | {"more": 1})),
        "key without a field": root(_keys(lambda key: {n: each for n, each in key.items() if n != "person"})),
        "duty": root(_of("witness", duty="other")),
        "public key of 31 octets": root(_of("witness", public=bytes(31))),
        "public key that is text": root(_of("witness", public="x" * 32)),
        "source": root(_of("mission", sources=["other"])),
        "roles of numbers": root(_of("mission", roles=[1])),
        "vehicles of another type": root(_of("log", vehicles="*")),
        "expiry of a key of another type": root(_of("log", expires_us="x")),
        "expiry of a key beyond 2^53": root(_of("log", expires_us=(1 << 63) - 1)),
        "root key expired": root(_of("root", expires_us=GENESIS["utc_us"])),
        "root key expires later": root(_of("root", expires_us=GENESIS["utc_us"] + 1)),
        "root expires at once": root(body | {"expires_at_us": GENESIS["utc_us"]}),
        "approval key with two roles": root(_of("approval", roles=["a", "b"])),
        "approval key for an agent": root(_of("approval", sources=["agent"])),
        "approval key of any role": root(_of("approval", roles=["*"])),
        "person of a log key": root(_of("log", person="ada")),
        "no threshold of witnesses": root(_thresholds(witness=0)),
        "more witnesses than there are": root(_thresholds(witness=9)),
        "threshold of two log keys": root(_thresholds(log=2)),
        "threshold of no log key": root(_thresholds(log=0)),
        "threshold missing": root(_thresholds(log=None)),
        "threshold of another duty": root(_thresholds(boundary=1)),
        "a key twice": root(body | {"keys": [*body["keys"], log_key | {"duty": "policy"}]}),
        "another root key": root(_of("root", public=stranger.public)),
        "revoked of another type": root(body | {"revoked": 1}),
        "revoked name of 9 octets": root(body | {"revoked": [bytes(9)]}),
        "revoked name of a link": root(body | {"revoked": [bytes(8)]}),
        "revoked text": root(body | {"revoked": ["x" * 16]}),
        "too many keys": root(body | {"keys": [*body["keys"], *many]}),
        "1 MiB": root(_of("log", vehicles=["*", "x" * (1 << 20)])),
    }  # fmt: skip
    odd = {
        "long integer": usual[:at] + b"\x18\x01" + usual[at + 1 :],
        "float": usual[:at] + b"\xf9\x3c\x00" + usual[at + 1 :],
        "undefined": usual[:at] + b"\xf7" + usual[at + 1 :],
        "tag": usual[:at] + b"\xc0\x01" + usual[at + 1 :],
        "indefinite": b"\x9f" + usual[1:] + b"\xff",
        "reserved": b"\x9c" + usual[1:],
        "too long": usual[:at] + b"\x5b" + b"\xff" * 8 + usual[at + 1 :],
        "integer of 64 bits": usual[:at] + b"\x1b" + b"\xff" * 8 + usual[at + 1 :],
        "deep": usual[:at] + b"\x81" * 40 + b"\x01" + usual[at + 1 :],
        "cut": usual[:-1],
        "key twice": usual.replace(b"\x67version", b"\x64keys"),
        "keys unordered": usual.replace(b"\x67version", b"\x67aersion"),
        "text not UTF-8": usual.replace(b"\x67version", b"\x67\xffersion"),
        "key of octets": usual.replace(b"\x67version", b"\x47version"),
    }
    return made | {name: envelope(payload, Duty.ROOT) for name, payload in odd.items()}


def judged(script: Script, logs: dict[str, list[bytes]]) -> dict[str, str]:
    """The slugs, which are those of Python."""
    found = compare(script, [(name, b"".join(lines), ROOT_KEY) for name, lines in logs.items()], loosely=True)
    for name, (verdict, _, record) in found.items():
        assert verdict == "verified" or record == 0, (name, found[name])
    return {name: slug for name, (_, slug, _) in found.items()}


def begun(**fields: bytes) -> list[bytes]:
    """The flight with other octets in its genesis, signed by all keys of the log."""
    text = {name: b64encode(octets).decode() for name, octets in fields.items()}
    return signed([edit(flight()[0], **text), *flight()[1:]])


def test_trust_roots(script: Script) -> None:
    found = judged(script, {name: begun(root=data) for name, data in roots().items()})
    good = {name for name, slug in found.items() if not slug}
    assert good == {
        "usual", "two witnesses of two", "expiry of a key beyond 2^53", "root key expires later",
        "revoked name of a link",
    }  # fmt: skip
    assert {*found.values()} >= {
        "trust/root-malformed", "trust/root-unknown-key", "trust/root-wrong-content-type", "trust/root-unknown-format",
        "trust/root-unknown-version", "trust/root-key-expired", "trust/root-expired", "trust/root-whose-approval",
        "trust/root-unreachable-threshold", "trust/root-unsupported-threshold", "trust/root-shared-key",
        "trust/root-not-self-signed",
    }  # fmt: skip


def bundles() -> dict[str, bytes]:
    first, second = cbor.decode(unbase64(GENESIS["bundle"]))[2]  # type: ignore[index]
    policy, mission = (cose.unverified(part).payload for part in (first, second))
    _, _, flown = cbor.decode(mission)  # type: ignore[misc]
    _, _, rules = cbor.decode(policy)  # type: ignore[misc]
    assert isinstance(flown, tuple)
    assert isinstance(rules, tuple)
    step: tuple[Any, ...] = flown[9][0]  # type: ignore[index, assignment, misc]

    of_policies = "application/vnd.rtshcua.policy+cbor"

    def bundle(*parts: Any, version: int = 1) -> bytes:
        return cbor.encode(("rtshcua/bundle", version, parts))

    def flying(**fields: Any) -> bytes:
        made = tuple(fields.get(f"f{n}", each) for n, each in enumerate(flown))
        return bundle(first, envelope(cbor.encode(("rtshcua/mission", 1, made)), Duty.MISSION))

    return {
        "usual": bundle(first, second),
        "another version": bundle(first, second, version=2),
        "three parts": bundle(first, second, second),
        "one part": bundle(first),
        "parts of another type": bundle(1, 2),
        "swapped": bundle(second, first),
        "not CBOR": b"\xff",
        "empty": b"",
        "another policy's digest": flying(f6=bytes(32)),
        "another policy": flying(f4="another"),
        "another version of the policy": flying(f5=99),
        "another vehicle": flying(f3="quad-08"),
        "digest of another type": flying(f6="x"),
        "steps of another type": flying(f9=1),
        "step of another type": flying(f9=(1,)),
        "source out of range": flying(f9=((*step[:4], 9, *step[5:]),)),
        "role out of range": flying(f9=((*step[:5], 99, *step[6:]),)),
        "source is text": flying(f9=((*step[:4], "length", *step[5:]),)),
        "policy by the log key": bundle(envelope(policy, Duty.POLICY, key=LOG_KEY), second),
        "mission by the policy key": bundle(first, envelope(mission, Duty.MISSION, key=case.KEYS[Duty.POLICY])),
        "mission as a policy": bundle(first, envelope(mission, Duty.MISSION, content=of_policies)),
        "policy of another version": bundle(envelope(cbor.encode(("rtshcua/policy", 6, rules)), Duty.POLICY), second),
        "policy of another type": bundle(envelope(cbor.encode(("rtshcua/policy", 8, 1)), Duty.POLICY), second),
        "policy is empty": bundle(envelope(cbor.encode(("rtshcua/policy", 8, ())), Duty.POLICY), second),
    }  # fmt: skip


def test_bundles(script: Script) -> None:
    made = {name: begun(bundle=data) for name, data in bundles().items()}
    # Python refuses these for their bindings, which a page does not compute.
    for name in ("source out of range", "role out of range"):
        assert script.result(b"".join(made.pop(name)))["failure"]["slug"] == "trust/bundle-malformed"
    found = judged(script, made)
    assert {name for name, slug in found.items() if not slug} == {"usual"}
    assert {*found.values()} >= {
        "trust/bundle-malformed", "trust/bundle-unknown-version", "trust/bundle-wrong-policy",
        "trust/bundle-wrong-vehicle", "trust/bundle-wrong-duty", "trust/bundle-wrong-content-type",
    }  # fmt: skip
