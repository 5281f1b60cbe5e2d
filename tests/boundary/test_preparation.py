"""Parameters through the boundary in C and in Python: the same permits, the same frames, the same evidence."""

import ctypes
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from boundary.both_boundaries import Shadow
from reference.world import FLIGHT, ROOT, ROOT_KEY, SESSION_KEY, START, VEHICLE, allowed, sealed
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.parameters import bits_of
from rtshcua.onboard.enforcement.frames import OURS
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded
from rtshcua.onboard.enforcement.preparation import MOST_PERMITS, SETTABLE, TOO_MANY, Owed
from rtshcua.onboard.ports import BoundaryKey
from rtshcua.wire.boundary_chain import START as BEFORE
from rtshcua.wire.preparation import ParameterWrite, Preparation, encode
from virtual import case
from virtual.flight import Flight
from virtual.shipped import shipped, simulated

AUTOPILOT, ADAPTER = Codec(1, 1), Codec(1, OURS)
SAMPLE, SOAK = 16, 20_000
#: floats at and near the bounds of parameters, and NaNs
EDGES = (
    0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 8.0, 10.0, 15.0, 15.5, 16.0, 29.99, 30.0, 30.5, 100.0, 100.01, -100.0, -100.01,
    -0.5, 1_000.0, 1_000.5, 3_000.0, 3_001.0, 10_000.0, 10_001.0, 300_000.0, 300_000.03, 300_001.0, 1e-45, 3e38,
)  # fmt: skip
WILD = (0x7F80_0000, 0xFF80_0000, 0x7FC0_0000, 0xFFC0_0001, 0x8000_0000, 0xFFFF_FFFF)


def drawn_bits(of: Random) -> int:
    found = bits_of(of.choice(EDGES))
    assert found is not None
    return found if of.random() < 0.9 else of.choice((*WILD, of.getrandbits(32)))


def fitting(of: Random, name: str) -> int:
    """Mostly an allowed value of the parameter."""
    allowed_here = SETTABLE.get(name)
    found = bits_of(of.choice(allowed_here)) if allowed_here is not None and of.random() < 0.9 else None
    return drawn_bits(of) if found is None else found


def both(boundary: ctypes.CDLL, settings: dict[str, int], owed: dict[str, Owed]) -> Loaded:
    shadow = Shadow(boundary)
    shadow.know(ROOT, ROOT.sign(ROOT_KEY), ROOT_KEY.verification().public)
    made = shadow.load(
        sealed(), root=ROOT, vehicle=VEHICLE, now=START, mode=EnforcementMode.SOFTWARE, session_key=SESSION_KEY,
        flight=FLIGHT,
        peer_is_own_simulator=False, settings=settings, owed=owed,
    )  # fmt: skip
    assert isinstance(made, Loaded)
    made.attestation.begin(BoundaryKey(case.BOUNDARY_KEY, 1, BEFORE))
    return made


def walk(boundary: ctypes.CDLL, seed: int) -> int:
    """One session of both; returns how many preparations both began."""
    of = Random(seed)
    names = (*SETTABLE, "ARMING_CHECK")
    settings = {name: fitting(of, name) for name in of.sample(names, of.randrange(1, 6))}
    owed = {name: Owed(fitting(of, name), drawn_bits(of)) for name in of.sample(names, of.randrange(3))}
    made = both(boundary, settings, owed)
    now_us, permits, begun = START.monotonic_us, [b"", bytes(80)], 0
    flown = False
    kind = of.choice((3, 12))
    for _ in range(150):
        now_us += of.choice((0, 0, 1_000, 900_000, 31_000_000))
        chance = of.random()
        if chance < 0.35:
            values = of.sample([*settings.items(), *((name, each.before) for name, each in owed.items())], 1)
            values += [(of.choice(names), drawn_bits(of))] if of.random() < 0.2 else []
            writes = tuple(ParameterWrite(name, drawn_bits(of), value) for name, value in values)
            ask = encode(Preparation(0, of.random() < 0.4, 0, writes))
            ask = ask if of.random() < 0.9 else ask[: of.randrange(len(ask))]
            found = made.preparation.permit(ask, now_us)
            permits += [found] if isinstance(found, bytes) else []
        elif chance < 0.55:
            permit = of.choice(permits[-3:])
            if permit and of.random() < 0.15:
                at = of.randrange(len(permit))
                permit = permit[:at] + bytes([permit[at] ^ 1 << of.randrange(8)]) + permit[at + 1 :]
            begun += isinstance(made.executor.prepare(permit, now_us), Preparation)
        elif chance < 0.6:
            made.executor.prepared()
        elif chance < 0.603 and not flown:
            flown = True
            made.executor.dispatch(allowed(made), now_us)
        elif chance < 0.8:
            landed = m.MAVLink_extended_sys_state_message(0, of.choice((1, 1, 1, 2)))
            heartbeat = m.MAVLink_heartbeat_message(2, kind, of.choice((0, 0, 0, 128)), 0, 4, 3)
            for message in (heartbeat, landed):
                made.executor.frames.observe(AUTOPILOT.pack(message), now_us)
            made.executor.frames.stands(now_us)
        else:
            name, value = of.choice([*settings.items(), (of.choice(names), drawn_bits(of))])
            number = ctypes.c_float.from_buffer_copy(ctypes.c_uint32(value)).value
            frame = m.MAVLink_param_set_message(1, 1, name.encode(), number, of.choice((9, 9, 6)))
            made.executor.frames.seal(ADAPTER.pack(frame), now_us)
    made.attestation.statement(START, final=True)  # both have the same evidence
    for permit in permits:
        assert isinstance(made.executor.prepare(permit, now_us), Refusal)
    return begun


def test_both_permit_and_let_out_the_same(boundary: ctypes.CDLL) -> None:
    assert sum(walk(boundary, seed) for seed in range(SAMPLE)) > SAMPLE / 2, "else it compares little"


def test_both_allow_the_same_parameters(boundary: ctypes.CDLL) -> None:
    """Each parameter, to each of the values at a bound, configured so."""
    given = 0
    for value in [*(found for edge in EDGES if (found := bits_of(edge)) is not None), *WILD]:
        made = both(boundary, dict.fromkeys(SETTABLE, value), {})
        for name in SETTABLE:
            ask = encode(Preparation(0, restoring=False, not_after_us=0, writes=(ParameterWrite(name, 0, value),)))
            given += isinstance(made.preparation.permit(ask, START.monotonic_us), bytes)
    assert given > len(EDGES)


def test_both_stop_at_the_same_number_of_permits(boundary: ctypes.CDLL) -> None:
    value = bits_of(300.0) or 0
    made = both(boundary, {"FENCE_RADIUS": value}, {})
    ask = encode(Preparation(0, restoring=False, not_after_us=0, writes=(ParameterWrite("FENCE_RADIUS", 0, value),)))
    for _ in range(MOST_PERMITS):
        assert isinstance(made.preparation.permit(ask, START.monotonic_us), bytes)
    assert made.preparation.permit(ask, START.monotonic_us) is TOO_MANY


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_a_prepared_flight_is_the_same_under_both(
    flavour: str, boundary: ctypes.CDLL, monkeypatch: pytest.MonkeyPatch
) -> None:
    from boundary.test_both_boundaries import watched

    shadow = watched(boundary, monkeypatch)
    had: dict[str, dict[str, float]] = {"ardupilot": {"FENCE_ALT_MAX": 15.0}, "px4": {"GF_MAX_VER_DIST": 15.0}}
    settings: Any = {name: bits_of(80.0) for name in had[flavour]}
    owed: dict[str, Owed] = {}
    config = simulated(flavour, parameters=tuple(had[flavour].items()))
    assert Flight(shipped("short"), config, settings=settings, owed=owed, attested=True).fly().ending == "completed"
    assert owed == {}
    assert shadow.counts["preparations"] == 2, "set, and put back"


def test_both_boundaries_restore_parameter_left_by_interrupted_run(
    boundary: ctypes.CDLL, monkeypatch: pytest.MonkeyPatch
) -> None:
    from boundary.test_both_boundaries import watched

    shadow = watched(boundary, monkeypatch)
    left, was = bits_of(80.0) or 0, bits_of(90.0) or 0
    owed = {"FENCE_ALT_MAX": Owed(was, left)}
    config = simulated("ardupilot", parameters=(("FENCE_ALT_MAX", 80.0),))
    Flight(shipped("short"), config, owed=owed, attested=True).fly()
    assert owed == {}
    assert shadow.counts["preparations"] == 1


@pytest.mark.soak
@pytest.mark.parametrize("first", range(SAMPLE, SOAK, 1_000))
def test_many_sessions_permit_and_let_out_the_same(first: int, boundary: ctypes.CDLL) -> None:
    for seed in range(first, first + 1_000):
        walk(boundary, seed)
