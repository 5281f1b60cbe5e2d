"""Parameters of the autopilot: only configured values are set, on the ground, and restored to the previous value."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from reference.world import FLIGHT, ROOT, SESSION_KEY, START, VEHICLE, allowed, sealed
from rtshcua.codec.frames import Codec
from rtshcua.mavlink.parameters import bits_of
from rtshcua.onboard.enforcement.executor import FORGED, LATE, NOT_DOWN, USED
from rtshcua.onboard.enforcement.frames import NOT_DOWN as FRAME_NOT_DOWN
from rtshcua.onboard.enforcement.frames import NOT_LISTED, OURS
from rtshcua.onboard.enforcement.load import EnforcementMode, Loaded, load
from rtshcua.onboard.enforcement.preparation import MALFORMED, NOT_AS_BEFORE, NOT_CONFIGURED, VALID_US, Owed
from rtshcua.onboard.ports import Command
from rtshcua.wire.preparation import ParameterWrite, Preparation, encode, open_preparation, seal
from virtual.rows import rows

AT = START.monotonic_us
AUTOPILOT, ADAPTER = Codec(1, 1), Codec(1, OURS)
ON_GROUND, IN_AIR = 1, 2


def bits(value: float) -> int:
    found = bits_of(value)
    assert found is not None
    return found


def asks(*writes: tuple[str, float, float], restoring: bool = False) -> bytes:
    listed = tuple(ParameterWrite(name, bits(before), bits(value)) for name, before, value in writes)
    return encode(Preparation(0, restoring, 0, listed))


RADIUS = asks(("FENCE_RADIUS", 50.0, 300.0))
BACK = asks(("FENCE_RADIUS", 300.0, 50.0), restoring=True)


def prepares(settings: dict[str, float], owed: dict[str, Owed] | None = None) -> Loaded:
    """A bundle in force, with an ArduCopter on the ground."""
    configured = {name: bits(value) for name, value in settings.items()}
    of = load(
        sealed(), root=ROOT, vehicle=VEHICLE, now=START, mode=EnforcementMode.SOFTWARE, session_key=SESSION_KEY,
        flight=FLIGHT,
        peer_is_own_simulator=False, settings=configured, owed=owed or {},
    )  # fmt: skip
    assert isinstance(of, Loaded)
    says(of, ON_GROUND)
    return of


def says(of: Loaded, landed: int, *, armed: bool = False, at_us: int = AT) -> None:
    heartbeat = m.MAVLink_heartbeat_message(2, 3, 128 if armed else 0, 0, 4, 3)
    for message in (heartbeat, m.MAVLink_extended_sys_state_message(0, landed)):
        of.executor.frames.observe(AUTOPILOT.pack(message), at_us)


def sent(of: Loaded, value: float, name: str = "FENCE_RADIUS", at_us: int = AT) -> Any:
    frame = ADAPTER.pack(m.MAVLink_param_set_message(1, 1, name.encode(), value, 9))
    found = of.executor.frames.seal(frame, at_us)
    return True if found == frame else found


def permit(of: Loaded, ask: bytes = RADIUS) -> bytes:
    found = of.preparation.permit(ask, AT)
    assert isinstance(found, bytes), found
    return found


def test_unconfigured_parameter_is_not_set() -> None:
    of = prepares({})
    assert of.preparation.permit(RADIUS, AT) is NOT_CONFIGURED
    assert sent(of, 300.0) is NOT_LISTED


@rows("ask", [
    asks(("FENCE_RADIUS", 50.0, 300.5)), asks(("FENCE_ALT_MAX", 50.0, 300.0)),
    asks(("FENCE_RADIUS", 50.0, 300.0), ("FENCE_TYPE", 7.0, 4.0)),
])  # fmt: skip
def test_another_value_or_parameter_than_configured_gets_no_permit(ask: bytes) -> None:
    assert prepares({"FENCE_RADIUS": 300.0}).preparation.permit(ask, AT) is NOT_CONFIGURED


@rows(("name", "value"), [
    ("ARMING_CHECK", 0.0), ("FENCE_ENABLE", 0.0), ("FENCE_TYPE", 3.0), ("FENCE_ACTION", 0.0), ("GF_ACTION", 0.0),
    ("GF_ACTION", 4.0), ("FENCE_RADIUS", 10_001.0), ("RTL_ALT", 0.0), ("SYSID_MYGCS", 1.0), ("MAV_SIGN_CFG", 0.0),
])  # fmt: skip
def test_a_configuration_cannot_name_what_is_never_set(name: str, value: float) -> None:
    assert prepares({name: value}).preparation.permit(asks((name, 1.0, value)), AT) is NOT_CONFIGURED


@rows("ask", [b"", b"\1" * 40, asks(), asks(("FENCE_RADIUS", 1, 300.0), ("FENCE_RADIUS", 2, 300.0)), RADIUS[:-1]])
def test_malformed_preparation_gets_no_permit(ask: bytes) -> None:
    assert prepares({"FENCE_RADIUS": 300.0}).preparation.permit(ask, AT) is MALFORMED


def test_preparation_permit_passes_only_its_parameters() -> None:
    of = prepares({"FENCE_RADIUS": 300.0})
    opened = of.executor.prepare(permit(of), AT)
    assert isinstance(opened, Preparation)
    assert sent(of, 300.0) is True
    assert sent(of, 301.0) is NOT_LISTED
    assert sent(of, 300.0, "FENCE_ALT_MAX") is NOT_LISTED
    of.executor.prepared()
    assert sent(of, 300.0) is NOT_LISTED


def test_a_permit_is_good_once() -> None:
    of = prepares({"FENCE_RADIUS": 300.0})
    replayed = permit(of)
    of.executor.prepare(replayed, AT)
    of.executor.prepared()
    assert of.executor.prepare(replayed, AT) is USED
    assert sent(of, 300.0) is NOT_LISTED


def test_a_permit_is_good_for_its_time() -> None:
    of = prepares({"FENCE_RADIUS": 300.0})
    late = permit(of)
    after_us = AT + VALID_US + 1
    says(of, ON_GROUND, at_us=after_us)
    assert of.executor.prepare(late, after_us) is LATE
    of.executor.prepare(permit(of), AT)
    assert sent(of, 300.0, at_us=after_us) is NOT_LISTED


@rows("bit", range(0, 8 * 80, 13))
def test_forged_permit_passes_no_frame(bit: int) -> None:
    of = prepares({"FENCE_RADIUS": 300.0})
    forged = bytearray(permit(of))
    forged[bit // 8 % len(forged)] ^= 1 << bit % 8
    assert of.executor.prepare(bytes(forged), AT) is FORGED
    assert sent(of, 300.0) is NOT_LISTED


def test_permit_of_another_session_passes_no_frame() -> None:
    of = prepares({"FENCE_RADIUS": 300.0})
    opened = open_preparation(permit(of), SESSION_KEY)
    assert opened is not None
    assert of.executor.prepare(seal(opened, bytes(32)), AT) is FORGED
    assert of.executor.prepare(allowed(of), AT) is FORGED, "nor does one for a step"
    assert not isinstance(of.executor.dispatch(permit(of), AT), Command), "nor this one for a step"


@pytest.mark.parametrize(("landed", "armed"), [(IN_AIR, True), (IN_AIR, False), (ON_GROUND, True), (0, False)])
def test_parameters_are_not_set_in_flight(landed: int, armed: bool) -> None:
    of = prepares({"FENCE_RADIUS": 300.0})
    says(of, landed, armed=armed)
    assert of.executor.prepare(permit(of), AT) is NOT_DOWN
    says(of, ON_GROUND)
    of.executor.prepare(permit(of), AT)
    says(of, landed, armed=armed)
    assert sent(of, 300.0) is FRAME_NOT_DOWN, "nor where it takes off meanwhile"


def test_parameters_are_not_set_during_a_command() -> None:
    of = prepares({"FENCE_RADIUS": 300.0})
    early = permit(of)
    of.executor.prepare(early, AT)
    assert isinstance(of.executor.dispatch(allowed(of), AT), Command)
    assert sent(of, 300.0) is NOT_LISTED
    assert of.executor.prepare(permit(of), AT) is NOT_DOWN, "though it has not left the ground yet"


def test_parameter_is_restored_only_to_previous_value() -> None:
    of = prepares({"FENCE_RADIUS": 300.0})
    assert of.preparation.permit(BACK, AT) is NOT_AS_BEFORE, "nothing was set yet"
    of.executor.prepare(permit(of), AT)
    other = asks(("FENCE_RADIUS", 300.0, 9_999.0), restoring=True)
    assert of.preparation.permit(other, AT) is NOT_AS_BEFORE
    assert of.preparation.permit(asks(("FENCE_ALT_MAX", 1.0, 50.0), restoring=True), AT) is NOT_AS_BEFORE
    of.executor.prepare(permit(of, BACK), AT)
    assert sent(of, 50.0) is True
    assert sent(of, 300.0) is NOT_LISTED


def test_owed_parameter_is_restored_to_recorded_value() -> None:
    of = prepares({}, {"FENCE_RADIUS": Owed(bits(50.0), bits(300.0))})
    assert of.preparation.permit(asks(("FENCE_RADIUS", 300.0, 60.0), restoring=True), AT) is NOT_AS_BEFORE
    of.executor.prepare(permit(of, BACK), AT)
    assert sent(of, 50.0) is True


def test_unsettable_parameter_is_never_restored() -> None:
    of = prepares({}, {"ARMING_CHECK": Owed(bits(0.0), bits(1.0))})
    assert of.preparation.permit(asks(("ARMING_CHECK", 1.0, 0.0), restoring=True), AT) is NOT_AS_BEFORE


def test_parameter_set_twice_is_restored_to_first_value() -> None:
    of = prepares({"FENCE_RADIUS": 400.0}, {"FENCE_RADIUS": Owed(bits(50.0), bits(300.0))})
    permit(of, asks(("FENCE_RADIUS", 300.0, 400.0)))
    permit(of, asks(("FENCE_RADIUS", 400.0, 50.0), restoring=True))
    of = prepares({"FENCE_RADIUS": 400.0}, {"FENCE_RADIUS": Owed(bits(50.0), bits(300.0))})
    permit(of, asks(("FENCE_RADIUS", 70.0, 400.0)))  # its owner has changed it since
    permit(of, asks(("FENCE_RADIUS", 400.0, 70.0), restoring=True))
