"""Accepted programs load on the vehicle, which answers all requests."""

from reference import world
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now, State
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.wire import binding, bundle
from rtshcua.wire.keys import ANY
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP, Request, encode
from rtshcua.wire.trust import TrustRoot

S = 1_000_000  # us
#: the keys of the reference world, for every vehicle and source
ROOT = TrustRoot(
    version=1,
    development=True,
    issued_at_us=0,
    expires_at_us=1 << 60,
    keys=(
        world.POLICY_KEY.verification(vehicles=(ANY,)),
        world.MISSION_KEY.verification(
            roles=(ANY,), sources=("agent", "operator", "onboard", "reflex"), vehicles=(ANY,), policies=(ANY,)
        ),
        world.LOG_KEY.verification(vehicles=(ANY,)),
        world.ROOT_KEY.verification(),
    ),
)


def sealed(policy: bytes, mission: bytes) -> bytes:
    """The bundle of two payloads."""
    return bundle.seal(policy, mission, policy_key=world.POLICY_KEY, mission_key=world.MISSION_KEY)


def opened(data: bytes, vehicle: str, utc_us: int) -> Loaded | Refusal:
    """Load the bundle on the vehicle of that identity at that time."""
    return load(
        data,
        root=ROOT,
        vehicle=vehicle,
        now=Now(500 * S, utc_us, 20_000),
        mode=EnforcementMode.SOFTWARE,
        session_key=world.SESSION_KEY,
        flight=world.FLIGHT,
        peer_is_own_simulator=False,
    )


def flies(policy: Policy, mission: Mission) -> None:
    """Check that a compiled mission loads and answers requests of all kinds."""
    payload = bundle.policy_payload(policy)
    bound = binding.bind(mission, bundle.policy_digest(payload))
    data = sealed(payload, bundle.mission_payload(bound))
    found = opened(data, policy.vehicle.identity, mission.issued_at_us + S)
    assert isinstance(found, Loaded), found
    ask(found, mission.issued_at_us + S)


def ask(loaded: Loaded, utc_us: int) -> None:
    """Request the steps and links, in an unknown state and in one with all values zero."""
    policy = loaded.policy.policy
    count = len(policy.monitors)
    states = [
        State((None,) * policy.slots, (0,) * policy.slots, (4,) * count),
        State((0,) * policy.slots, (0,) * policy.slots, (1,) * count),
    ]
    steps = [(STEP, number, -1, each.invocation.binding) for number, each in enumerate(loaded.invocations[:3])]
    links = [(FALLBACK_LINK, number, link, of) for _, number, _, of in steps for link in (-1, 0, 1)]
    last = [(CONTINGENCY_LINK, -1, link, loaded.bundle.policy_digest) for link in (0, 1)]
    now = Now(500 * S, utc_us, 20_000)
    for state in states:
        for kind, step, link, of in [*steps, *links, *last]:
            phase = loaded.invocations[max(step, 0)].phase if loaded.invocations else 0
            asked = Request(kind, step, link, of, now, state, now.monotonic_us, max(phase, 0), S)
            answer(loaded, encode(asked))


def answer(loaded: Loaded, request: bytes) -> None:
    """Check that any request bytes get a readable answer."""
    said = world.read_answer(loaded, request, loaded.boundary.enforce(request))
    assert not isinstance(said, Refusal), said
