"""Trust roots and bundles: the results of Python and C on the same bytes, and interesting inputs."""

import ctypes
from random import Random
from typing import Any

from msgspec.structs import replace

from boundary.mutants import altered, changed, damaged, in_range
from reference import world
from reference.bundle_case import MISSION, NOW, POLICY, ROOT, STRANGER, THE_MISSION, THE_POLICY, root
from rtshcua.wire import artefact, bundle, cbor, cose, names
from rtshcua.wire.binding import bind
from rtshcua.wire.keys import Duty, SigningKey, VerificationKey
from rtshcua.wire.names import Artefact
from rtshcua.wire.trust import Thresholds, TrustRoot, open_root
from rtshcua.wire.untrusted import Untrusted

VEHICLE = "quad-07"
SIGNED_ROOT = root().sign(ROOT)
WITNESS, APPROVER = (
    SigningKey.from_seed(b"w" * 32, duty=Duty.WITNESS),
    SigningKey.from_seed(b"a" * 32, duty=Duty.APPROVAL),
)
MANY = replace(
    root(),
    keys=(
        *root().keys,
        WITNESS.verification(vehicles=("*",)),
        APPROVER.verification(roles=("supervisor",), sources=("operator",), vehicles=(VEHICLE,), person="ada"),
    ),
    thresholds=Thresholds(witness=1),
    revoked=(bytes(16), bytes(8)),
)


class Boundary:
    """The C side, which keeps the last opened root."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._c = library
        for function in (library.rt_test_root, library.rt_test_bundle):
            function.restype = ctypes.c_char_p

    def root(self, data: bytes, pinned: bytes | None, now_us: int) -> str | None:
        pin = pinned or b""
        self._kept = data  # C keeps views into it
        slug = self._c.rt_test_root(data, len(data), pin, len(pin), ctypes.c_int64(now_us))
        return slug and slug.decode()

    def bundle(self, data: bytes, vehicle: str, now_us: int) -> str | tuple[bytes, bytes, bytes]:
        """The slug, or the digests of policy, mission and bundle."""
        out, name = ctypes.create_string_buffer(96), vehicle.encode()
        slug = self._c.rt_test_bundle(data, len(data), name, len(name), ctypes.c_int64(now_us), out)
        return slug.decode() if slug else (out.raw[:32], out.raw[32:64], out.raw[64:])


def agree_on_root(c: Boundary, data: bytes, pinned: bytes | None, now_us: int = NOW) -> TrustRoot | str:
    """Check that both agree on a root; return the root, or the slug of its refusal."""
    found: TrustRoot | str
    try:
        found = open_root(data, pinned=pinned, now_us=now_us)
    except Untrusted as error:
        found = error.slug
    slug = c.root(data, pinned, now_us)
    assert slug == (found if isinstance(found, str) else None), (found, data.hex())
    return found


def agree_on_bundle(
    c: Boundary, data: bytes, trust: TrustRoot, vehicle: str = VEHICLE, now_us: int = NOW
) -> str | None:
    """Check that both agree on a bundle under the root of C; return the slug of its refusal."""
    found: str | tuple[bytes, bytes, bytes]
    try:
        opened = bundle.open_bundle(data, root=trust, vehicle=vehicle, now_us=now_us)
        found = opened.policy_digest, opened.mission_digest, opened.digest
    except Untrusted as error:
        found = error.slug
    assert c.bundle(data, vehicle, now_us) == found, (found, data.hex())
    return found if isinstance(found, str) else None


def signed_with(payload: bytes, key: SigningKey, kind: Artefact, random: Random) -> bytes:
    """An envelope signed by the key, in which some part may be wrong."""
    header: Any = {1: cose.ED25519, 3: kind.content_type, 4: key.kid}
    parts: list[Any] = [cbor.encode(header), {}, payload]
    duty = key.duty
    match random.randrange(12):
        case 0:
            parts[0] = cbor.encode(in_range(changed(header, random)))
        case 1:
            parts[0] = damaged(parts[0], random)
        case 2:
            parts[1] = changed({4: key.kid}, random)
        case 3:
            duty = random.choice(tuple(Duty))
    signature = key.private.sign(cbor.encode(("Signature1", parts[0], duty.label, payload)))
    if random.random() < 0.04:
        signature = changed(signature, random)
    envelope = b"\xd2" + cbor.encode((*parts, signature))
    return damaged(envelope, random) if random.random() < 0.04 else envelope


def envelope(payload: bytes, key: SigningKey, kind: Artefact, random: Random) -> bytes:
    """An envelope that is usually correct."""
    if random.random() < 0.2:
        return signed_with(payload, key, kind, random)
    return cose.sign1(payload, key=key, duty=key.duty, content_type=kind.content_type)


def some_root(random: Random) -> bytes:
    """A random root, mostly valid."""
    trust = random.choice((root(), MANY))
    match random.randrange(6):
        case 0:
            return damaged(trust.sign(ROOT), random)
        case 1:
            payload = altered(trust.encode(), random)
        case 2:
            payload = damaged(trust.encode(), random)
        case _:
            payload = artefact.pack(names.ROOT, renamed(trust, random))
    return envelope(payload, random.choice((ROOT,) * 14 + (POLICY, STRANGER)), names.ROOT, random)


def renamed(trust: TrustRoot, random: Random) -> TrustRoot:
    """A well-formed root with another value for one key, or for itself."""
    at = random.randrange(len(trust.keys))
    key: VerificationKey = trust.keys[at]
    fields: list[dict[str, Any]] = [
        {"roles": random.choice(((), ("*",), ("trainee",), ("operator", "trainee")))},
        {"sources": random.choice(((), ("operator",), ("agent", "operator"), ("reflex",)))},
        {"vehicles": random.choice(((), ("*",), ("quad-08",), (VEHICLE,)))},
        {"policies": random.choice(((), ("*",), ("yard",)))},
        {"person": random.choice(("", "ada", "Ada", "a" * 64, "a" * 65, ".a", "a.b-c_d", "\u00e4"))},
        {"expires_us": random.choice((NOW, NOW - 1, NOW + 1, 0, -(1 << 63)))},
        {"development": True},
        {"duty": random.choice(tuple(Duty))},
        {"public": random.choice((ROOT.public, STRANGER.public, random.randbytes(32)))},
    ]
    whole: list[dict[str, Any]] = [
        {"version": random.choice((0, 2, -1, 1 << 62))},
        {"development": True},
        {"expires_at_us": random.choice((NOW, NOW + 1, 0, trust.issued_at_us, trust.issued_at_us + 1))},
        {"revoked": random.choice(((), (key.kid,), (key.kid[:8],), (b"x",), (bytes(16), bytes(16))))},
        {"keys": (*trust.keys, key)},
        {"keys": trust.keys[:at] + trust.keys[at + 1 :]},
        {"thresholds": Thresholds(**{random.choice(tuple(Duty)[:5]): random.choice((0, 1, 2))})},
        {"thresholds": Thresholds(witness=random.choice((0, 1, 2, 3)))},
    ]
    try:
        if random.random() < 0.6:
            return replace(trust, keys=(*trust.keys[:at], replace(key, **random.choice(fields)), *trust.keys[at + 1 :]))
    except ValueError:
        pass
    return replace(trust, **random.choice(whole))


def some_bundle(random: Random) -> bytes:
    """A random bundle, mostly valid."""
    policy, mission = THE_POLICY, THE_MISSION
    if random.random() < 0.15:
        policy = replace(
            policy, **random.choice(({"version": 8}, {"name": "yard"}, {"roles": ("operator", "supervisor")}))
        )
    steps = mission.invocations * random.choice((0, 1, 1, 1, 2, 3))
    for _ in range(random.choice((0, 1))):
        if steps:
            at = random.randrange(len(steps))
            field = random.choice(("role", "source", "step", "phase", "arguments", "phases", "text"))
            value = random.choice(((1, 2), (), (1 << 40,))) if field == "arguments" else random.choice((0, 1, -1, 3, 4))
            value = "h\u00fcpf" if field == "text" else value
            steps = (*steps[:at], replace(steps[at], **{field: value}), *steps[at + 1 :])
    mission = replace(mission, invocations=steps)
    if random.random() < 0.2:
        mission = replace(mission, **random.choice(({"vehicle": "quad-08"}, {"policy_version": 8}, {"policy": "yard"},
                                                    {"name": "other"},
                                                    {"phases": ("a", "b")}, {"issued_at_us": -5})))  # fmt: skip
    payload = bundle.policy_payload(policy)
    mission = bind(mission, bundle.policy_digest(payload), after=random.choice((b"", b"", b"", b"x")))
    second = bundle.mission_payload(mission)
    match random.randrange(7):
        case 0:
            payload = altered(payload, random)
            if random.random() < 0.7:
                second = bundle.mission_payload(bind(mission, bundle.policy_digest(payload)))
        case 1:
            second = altered(second, random)
        case 2:
            second = damaged(second, random)
    body: Any = (
        envelope(payload, random.choice((POLICY,) * 14 + (MISSION,)), names.POLICY, random),
        envelope(second, random.choice((MISSION,) * 13 + (STRANGER, ROOT)), names.MISSION, random),
    )
    if random.random() < 0.05:
        body = changed(body, random)
    data = artefact.wrap(names.BUNDLE, body)
    return random.choice((damaged, altered))(data, random) if random.random() < 0.1 else data


def rich() -> tuple[bytes, bytes, bytes, str, int]:
    """Root, its pin, bundle, vehicle and time of the world that flights are tested in."""
    return world.ROOT.sign(world.ROOT_KEY), world.ROOT_KEY.public, world.sealed(), world.VEHICLE, world.START.utc_us
