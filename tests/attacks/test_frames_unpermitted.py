"""Frames without a permit: an attacker who controls the adapter sends them, and the boundary refuses them."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from reference.flat_case import S
from reference.world import SESSION_KEY, START, allowed, loaded
from rtshcua.codec.frames import Codec
from rtshcua.onboard.enforcement.frames import FORCED_ARMING, OURS
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Command
from rtshcua.wire.permit import open_permit
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK
from virtual.rows import rows

AT = START.monotonic_us
AUTOPILOT, ADAPTER = Codec(1, 1), Codec(1, OURS)


def frame(command: int, *parameters: float) -> bytes:
    filled = [*parameters, *[0.0] * (7 - len(parameters))]
    return ADAPTER.pack(mavlink.MAVLink_command_long_message(1, 1, command, 0, *filled))


ARM, FORCE, LAND, HOLD = frame(400, 1), frame(400, 1, 21_196), frame(176, 1, 9), frame(176, 1, 17)
HOME, GUIDED = frame(176, 1, 6), frame(176, 1, 4)
EVERYTHING = (ARM, FORCE, LAND, HOLD, HOME, GUIDED)


def heard() -> Loaded:
    """A bundle in force, with a known ArduCopter."""
    of = loaded()
    of.executor.frames.observe(AUTOPILOT.pack(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3)))
    return of


def out(of: Loaded, at_us: int = AT) -> set[bytes]:
    return {each for each in EVERYTHING if isinstance(of.executor.frames.seal(each, at_us), bytes)}


def test_vehicle_does_not_move_before_the_first_permit() -> None:
    assert out(heard()) == set()


@rows("bit", range(0, 8 * 56, 7))
def test_forged_permit_passes_no_frame(bit: int) -> None:
    of = heard()
    permit = bytearray(allowed(of))
    permit[bit // 8] ^= 1 << bit % 8
    of.executor.dispatch(bytes(permit), AT)
    assert out(of) == set()


def test_permit_passes_only_its_command() -> None:
    of = heard()
    assert isinstance(of.executor.dispatch(allowed(of), AT), Command)
    assert out(of) == {ARM, GUIDED}, "a take-off"


def test_arming_by_force_is_refused_under_any_permit() -> None:
    of = heard()
    of.executor.dispatch(allowed(of), AT)
    assert of.executor.frames.seal(FORCE, AT) is FORCED_ARMING


def test_late_or_used_permit_passes_no_frame() -> None:
    of = heard()
    permit = allowed(of)
    opened = open_permit(permit, SESSION_KEY)
    assert opened is not None
    of.executor.dispatch(permit, opened.not_after_us + 1)
    assert out(of) == set()
    of.executor.dispatch(permit, AT)
    of.executor.ended()
    of.executor.dispatch(permit, AT)
    assert out(of) == set()


def test_delayed_command_does_not_begin() -> None:
    of = heard()
    permit = allowed(of)
    opened = open_permit(permit, SESSION_KEY)
    assert opened is not None
    of.executor.dispatch(permit, AT)
    assert out(of, opened.not_after_us + 1) == set()


def test_standing_permit_passes_its_link_but_not_the_step() -> None:
    of = heard()
    step = allowed(of)
    of.executor.dispatch(step, AT)
    assert isinstance(of.executor.stand_in(step, CONTINGENCY_LINK, 2, AT + S), Command)
    assert out(of, AT + S) == {LAND}


def test_ended_command_passes_no_frame_and_replaced_ends_nothing() -> None:
    of = heard()
    step = allowed(of)
    first = of.executor.dispatch(step, AT)
    second = of.executor.stand_in(step, FALLBACK_LINK, 0, AT)
    assert isinstance(first, Command)
    assert isinstance(second, Command)
    permitted = out(of)
    assert permitted
    of.executor.ended(first.token)
    assert out(of) == permitted
    of.executor.ended(second.token)
    assert out(of) == set()


@pytest.mark.parametrize("how", ["landed", "release"])
def test_landing_and_standing_down_close_the_gate(how: str) -> None:
    of = heard()
    of.executor.dispatch(allowed(of), AT)
    getattr(of.executor, how)()
    assert out(of) == set()
