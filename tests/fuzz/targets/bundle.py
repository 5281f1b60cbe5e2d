"""The bytes of a bundle, raw; or its two payloads, signed by trusted keys.

The first byte is 0 for a raw bundle; otherwise two payloads follow, the first after its length in 3 octets.
"""

from functools import cache
from random import Random

from fuzz import board
from fuzz.mutation.trees import changed
from reference import world as reference
from rtshcua.app.documents import claimed
from rtshcua.decision.prepare import prepare
from rtshcua.front.cli.render.showing.page import TextPage
from rtshcua.front.cli.render.showing.policy import show_mission, show_policy
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire import binding, bundle, cbor, names
from rtshcua.wire.untrusted import Untrusted
from virtual.shipped import NAMES, shipped

MAX_LENGTH = 60_000
_LEAVES = (0, 1, -1, 2, 31, 32, 255, 1 << 20, (1 << 53) - 1, 1 << 53, (1 << 63) - 1, -(1 << 63), "", "a", b"",
           b"\0" * 32, None, True, (), (0,))  # fmt: skip


@cache
def seeds() -> tuple[bytes, ...]:
    found = []
    for data in (reference.sealed(), *(shipped(name) for name in NAMES)):
        first, second = bundle.envelopes(data)
        found += [b"\0" + data, _joined(*(_payload(each) for each in (first, second)))]
    return tuple(found)


def _payload(envelope: bytes) -> bytes:
    from rtshcua.wire.cose import unverified

    return unverified(envelope).payload


def _joined(policy: bytes, mission: bytes) -> bytes:
    return b"\1" + len(policy).to_bytes(3) + policy + mission


def _parted(data: bytes) -> tuple[bytes, bytes]:
    size = int.from_bytes(data[1:4])
    return data[4 : 4 + size], data[4 + size :]


def mutated(data: bytes, of: Random) -> bytes:
    """One to three changes of the values in a payload, which stays canonical."""
    if data[:1] == b"\0":
        return data
    payloads = list(_parted(data))
    at = of.randrange(2)
    try:
        name, version, body = cbor.decode(payloads[at])
        for _ in range(of.choice([1, 1, 2, 3])):
            body = changed(body, of, _LEAVES)
        payloads[at] = cbor.encode((name, version, body))
    except (Untrusted, ValueError, TypeError):
        return data
    return _joined(*payloads)


def one(data: bytes) -> None:
    if data[:1] == b"\0":
        raw(data[1:])
        return
    policy, mission = _parted(data)
    try:
        read = bundle.parse(names.POLICY, policy, Policy), bundle.parse(names.MISSION, mission, Mission)
    except Untrusted:
        return
    prepare(read[0])
    bound = binding.bind(read[1], bundle.policy_digest(policy))
    try:
        payload = bundle.mission_payload(bound)
    except Untrusted:
        return
    raw(board.sealed(policy, payload), read[0].vehicle.identity, read[1].issued_at_us)


def raw(data: bytes, vehicle: str = reference.VEHICLE, utc_us: int = reference.START.utc_us) -> None:
    """Show and load a bundle; each refusal must be a value or an `Untrusted`."""
    try:
        what = claimed(data)
    except Untrusted:
        pass
    else:
        page = TextPage()
        show_mission(page, what.mission, what.policy)
        show_policy(page, what.policy)
        assert str(page).replace("\n", "").isprintable()
    found = board.opened(data, vehicle, utc_us)
    if isinstance(found, Loaded):
        board.ask(found, utc_us)
