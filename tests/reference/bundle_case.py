"""A small hand-written signed bundle: one hover under one policy, with its trust root."""

from collections.abc import Callable

from rtshcua.model.flat.contract import Contract, Motion, MotionKind, SourceKind, TimingClass
from rtshcua.model.flat.mission import Invocation, Mission, Plan
from rtshcua.model.flat.policy import Policy, VehicleLimits
from rtshcua.model.flat.zone import Projection
from rtshcua.wire import bundle
from rtshcua.wire.binding import bind
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import TrustRoot

HOUR = 3_600_000_000
NOW = 1_790_000_000_000_000
ROOT = SigningKey.from_seed(b"r" * 32, duty=Duty.ROOT)
POLICY = SigningKey.from_seed(b"p" * 32, duty=Duty.POLICY)
MISSION = SigningKey.from_seed(b"m" * 32, duty=Duty.MISSION)
STRANGER = SigningKey.from_seed(b"s" * 32, duty=Duty.MISSION)

HOVER = Contract(
    "hover", (), Motion(MotionKind.HOLD, -1, -1), TimingClass.TACTICAL, 2_000_000, HOUR, (), 60_000_000, 500_000,
    (), (), (), (), 100, ("decision",), (),
)  # fmt: skip
AIRCRAFT = VehicleLimits("quad", "quad-07", 50_000, 12_000, 3_000, 3_000, 18 * 60_000_000, 1_500, 0, -1, -1, -1)
THE_POLICY = Policy(
    "field", 7, AIRCRAFT, Projection(473_977_400, 85_455_900, 7_000_000, 11_000_000), ("operator",), (), 0, (), 0, (),
    (), (HOVER,), (), None, (), ("field.rts",), (b"\0" * 32,),
)  # fmt: skip
STEP = Invocation(
    b"", 0, 0, 0, SourceKind.AGENT, 0, (), NOW, 1, 0, HOVER, Plan(MotionKind.HOLD, (), 0, 0), "hover()", 0, 0, 7, b""
)
THE_MISSION = Mission(
    "look", "", "openclaw", "quad-07", "field", 7, b"", NOW, ("only",), (STEP,), ("look.rts",), (b"\0" * 32,)
)


def root(**mission_key: tuple[str, ...]) -> TrustRoot:
    speaks = {
        "roles": ("operator",),
        "sources": ("agent",),
        "vehicles": ("quad-07",),
        "policies": ("field",),
    } | mission_key
    return TrustRoot(
        1,
        False,
        NOW - HOUR,
        NOW + HOUR,
        (
            ROOT.verification(),
            POLICY.verification(vehicles=("quad-07",), expires_us=NOW + HOUR),
            MISSION.verification(**speaks),
        ),
    )


def sealed(
    *,
    policy: Policy = THE_POLICY,
    mission: Mission = THE_MISSION,
    key: SigningKey = MISSION,
    after: Callable[[Mission], Mission] = lambda bound: bound,
) -> bytes:
    payload = bundle.policy_payload(policy)
    bound = after(bind(mission, bundle.policy_digest(payload)))
    return bundle.seal(payload, bundle.mission_payload(bound), policy_key=POLICY, mission_key=key)
