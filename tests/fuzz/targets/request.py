"""The octets of requests to the enforcement boundary, one after another; the first octet says which boundary, and
whether the rest are requests without the octets that all begin with, or one request as it is.
"""

from functools import cache
from random import Random

from fuzz import board
from reference import world as reference
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.situation import Now, State
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, Request, decode, encode
from virtual.case import flat
from virtual.shipped import shipped

MAX_LENGTH = 8_000


@cache
def worlds() -> tuple[Loaded, ...]:
    from virtual import case

    data = shipped("one_bridge")
    from rtshcua.onboard.enforcement.load import EnforcementMode, load

    standard = load(
        data,
        root=case.root()[0],
        vehicle="quad-07",
        now=Now(500 * board.S, flat.ISSUED + board.S, 0),
        mode=EnforcementMode.SOFTWARE,
        session_key=reference.SESSION_KEY,
        flight=reference.FLIGHT,
        peer_is_own_simulator=False,
    )
    assert isinstance(standard, Loaded), standard
    return reference.loaded(), standard


def _sizes(of: Loaded) -> tuple[bytes, int]:
    """The common prefix of requests, and the length of the rest."""
    one = encode(_asked(of, STEP, 0, -1))
    other = encode(_asked(of, CONTINGENCY_LINK, 0, 0))
    same = next(at for at, (left, right) in enumerate(zip(one, other, strict=True)) if left != right)
    return one[:same], len(one) - same


def _asked(of: Loaded, kind: int, step: int, link: int) -> Request:
    policy = of.policy.policy
    state = State((0,) * policy.slots, (0,) * policy.slots, (1,) * len(policy.monitors))
    at = max(step, 0)
    binding = of.bundle.policy_digest if kind == CONTINGENCY_LINK else of.invocations[at].invocation.binding
    now = Now(500 * board.S, flat.ISSUED + board.S, 20_000)
    return Request(kind, step, link, binding, now, state, now.monotonic_us, max(of.invocations[at].phase, 0), board.S)


@cache
def seeds() -> tuple[bytes, ...]:
    found = []
    for number, of in enumerate(worlds()):
        prefix, _ = _sizes(of)
        asked = [encode(_asked(of, kind, step, link)) for kind, step, link in (
            (STEP, 0, -1), (FALLBACK_LINK, 0, 0), (FALLBACK_LINK, 0, -1), (STEP, 1, -1), (CONTINGENCY_LINK, -1, 0),
        )]  # fmt: skip
        found.append(bytes([number]) + b"".join(each[len(prefix) :] for each in asked))
        found += [bytes([number]) + each[len(prefix) :] for each in asked]
        found += [bytes([128 + number]) + each for each in asked]
    return tuple(found)


def mutated(data: bytes, of: Random) -> bytes:
    """Change an integer of 8 octets to a small or large one."""
    if len(data) < 10:
        return data
    at = of.randrange(1, len(data) - 8)
    value = of.choice([0, 1, 2, 30_000, 1 << 20, (1 << 53) - 1, 1 << 53, 1 << 63, of.getrandbits(of.randrange(1, 64))])
    return data[:at] + value.to_bytes(8) + data[at + 8 :]


def one(data: bytes) -> None:
    if not data:
        return
    of = worlds()[(data[0] & 127) % 2]
    policy = of.policy.policy
    boundary = reference.renewed(of).boundary
    if data[0] & 128:
        requests = [data[1:]]
    else:
        prefix, size = _sizes(of)
        requests = [prefix + data[at : at + size] for at in range(1, len(data), size)]
    for request in requests:
        asked = decode(request, policy.slots, len(policy.monitors))
        assert isinstance(asked, Refusal) or encode(asked) == request
        said = reference.read_answer(of, request, boundary.enforce(request))
        assert not isinstance(said, Refusal), said
