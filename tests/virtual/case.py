"""The hand-written policy and mission of tests/reference, made flyable: real signals, real keys, a bundle."""

from collections.abc import Mapping, Sequence
from math import cos, radians

from msgspec.structs import replace

from reference import flat_case as flat
from rtshcua.model.flat.contract import Contract, MotionKind
from rtshcua.model.flat.mission import Invocation, Mission, Plan
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import SignalSource
from rtshcua.model.flat.zone import SHIFT, Projection
from rtshcua.simulation.config import HOME, AutopilotKind, SimulationConfig
from rtshcua.wire import binding, bundle
from rtshcua.wire.keys import ANY, Duty, SigningKey
from rtshcua.wire.trust import TrustRoot

S, MIN, M = flat.S, flat.MIN, flat.M
#: equal to the descent rate
LAND_MM_S = 1_500
#: the least height of a leg
LOW = 5 * M
YEAR_US = 366 * 24 * 3_600 * S

SOURCES = {
    flat.BATTERY: ("BATTERY_STATUS", ("battery_remaining",), 100, (-1,)),
    flat.HEIGHT: ("GLOBAL_POSITION_INT", ("relative_alt",), 1, ()),
    flat.WIND: ("WIND_COV", ("wind_x", "wind_y"), 1_000, ()),
    flat.LINK: ("RADIO_STATUS", ("txbuf",), 100, (255,)),
    flat.FIX: ("GPS_RAW_INT", ("fix_type",), 1, ()),
    flat.POSITION_X: ("GLOBAL_POSITION_INT", ("lat", "lon"), 1, ()),
    flat.OBSTACLE: ("DISTANCE_SENSOR", ("current_distance",), 10, ()),
}
WIND_OF_ARDUPILOT = SignalSource("WIND", ("speed",), 1_000, 1, ())

KEYS = {
    duty: SigningKey.from_seed(bytes([n]) * 32, duty=duty, development=True)
    for n, duty in enumerate(Duty)
    if duty is not Duty.BOUNDARY
}
BOUNDARY_KEY = SigningKey.from_seed(bytes([0xB0]) * 32, duty=Duty.BOUNDARY, development=True)


def _projection() -> Projection:
    east = 11.1319491 * cos(radians(HOME.latitude / 1e7))
    return Projection(HOME.latitude, HOME.longitude, round(east * (1 << SHIFT)), round(11.1319491 * (1 << SHIFT)))


def policy() -> Policy:
    """Return the reference policy with real signal sources, valid at any time of day."""
    signals = []
    for signal in flat.SIGNALS:
        message, fields, numerator, unknown = SOURCES[signal.slot]
        sources = [SignalSource(message, fields, numerator, 1, unknown)]
        if signal.slot == flat.WIND:
            sources.append(WIND_OF_ARDUPILOT)
        signals.append(replace(signal, sources=tuple(sources), stale_us=max(signal.stale_us, 2 * S)))
    rules = list(flat.RULES)
    low = flat.apply(flat.Op.LE, flat.argument(1), flat.const(30 * M))
    scope = flat.clause(
        "area inside bridge_a and altitude <= 30 m",
        flat.apply(flat.Op.AND, (flat.Op.ARGUMENT_IN, 0, flat.IN_BRIDGE), low),
    )
    rules[0] = replace(rules[0], when=scope)
    contracts = tuple(map(_flyable, flat.CONTRACTS))
    return replace(
        flat.POLICY, signals=tuple(signals), contracts=contracts, rules=tuple(rules), projection=_projection()
    )


def _flyable(contract: Contract) -> Contract:
    """Remove the wind from the takeoff's conditions: it is known only in the air."""
    if contract.name != "takeoff":
        return contract
    return replace(contract, assume=(), reads=(flat.BATTERY, flat.FIX))


def step(number: int, phase: int, skill: int, plan: Plan, *arguments: int, **fields: object) -> Invocation:
    """A mission step; see `flat_case.invocation`."""
    return flat.invocation(number, phase, skill, plan, *arguments, **fields)


def short_steps() -> tuple[Invocation, ...]:
    """Up, one leg, home."""
    return (
        step(0, 0, flat.TAKEOFF, Plan(MotionKind.CLIMB, (), 15 * M, 0), 15 * M),
        step(1, 1, flat.GOTO, Plan(MotionKind.FLY, (40 * M, 20 * M), 15 * M, 0), 40 * M, 20 * M, 15 * M),
        step(2, 2, flat.HOME, Plan(MotionKind.HOME, (0, 0), 0, 0)),
    )


def low_steps(*, leg: bool = True) -> tuple[Invocation, ...]:
    """A short mission at the least height: up, one leg, home; without `leg` up and home."""
    up, there, back = short_steps()
    up = step(0, 0, flat.TAKEOFF, Plan(MotionKind.CLIMB, (), LOW, 0), LOW)
    there = step(1, 1, flat.GOTO, Plan(MotionKind.FLY, (30 * M, 0), LOW, 0), 30 * M, 0, LOW)
    return (up, there, back) if leg else (up, replace(back, step=1))


def mission(steps: Sequence[Invocation] | None = None, issued_at_us: int = flat.ISSUED) -> Mission:
    """Return the reference mission, or one with these steps, issued at a UTC time."""
    chosen = flat.INVOCATIONS if steps is None else steps
    return replace(
        flat.MISSION,
        issued_at_us=issued_at_us,
        invocations=tuple(
            replace(each, issued_at_us=issued_at_us, contract=_flyable(each.contract)) for each in chosen
        ),
    )


def seal(of: Mission, under: Policy | None = None, keys: Mapping[Duty, SigningKey] = KEYS) -> bytes:
    """The signed bundle."""
    payload = bundle.policy_payload(under or policy())
    bound = binding.bind(of, bundle.policy_digest(payload))
    return bundle.seal(
        payload, bundle.mission_payload(bound), policy_key=keys[Duty.POLICY], mission_key=keys[Duty.MISSION]
    )


def root(issued_at_us: int = flat.ISSUED, *, boundary: bool = False, life_us: int = YEAR_US) -> tuple[TrustRoot, bytes]:
    """Return the development root with the keys, and its signed bytes; `boundary`: with the boundary's key."""
    made = TrustRoot(
        version=1, development=True, issued_at_us=issued_at_us, expires_at_us=issued_at_us + life_us,
        keys=tuple(
            key.verification(
                roles={Duty.MISSION: (ANY,), Duty.APPROVAL: ("supervisor",)}.get(duty, ()),
                sources={Duty.MISSION: ("agent", "operator"), Duty.APPROVAL: ("operator",)}.get(duty, ()),
                vehicles=() if duty is Duty.ROOT else (ANY,),
                policies=(ANY,) if duty is Duty.MISSION else (),
                person="ada" if duty is Duty.APPROVAL else "",
            )
            for duty, key in KEYS.items()
        )
        + ((BOUNDARY_KEY.verification(vehicles=(ANY,)),) if boundary else ()),
    )  # fmt: skip
    return made, made.sign(KEYS[Duty.ROOT])


def simulated(
    flavour: str, *, return_mm: int = 16 * M, land_mm_s: int | None = LAND_MM_S, **fields: object
) -> SimulationConfig:
    """Return a simulated vehicle for the policy with a low return and a fast landing, to shorten flights."""
    return SimulationConfig(flavour=AutopilotKind(flavour), return_mm=return_mm, land_mm_s=land_mm_s, **fields)
