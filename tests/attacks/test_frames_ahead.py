"""Threat: a compromised runtime holds frames that the boundary signed ahead. Or the boundary did die, and somebody on
the link forges the vehicle's telemetry, or wants the runtime to send more.

Outcomes: only links that standing permits cover now are signed ahead, and the gate stays closed for them. A
delayed frame is void once the vehicle received frames that were signed half a minute later, so also in the next
step and the next flight; a later link voids an earlier one. After the loss only frames signed ahead are sent, each
copy once; recorded frames are refused, and well-forged telemetry can only select one of these links. (A log that
claims a loss: test_log_boundary.py.)
"""

import struct
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from boundary.conftest import boundary as boundary
from boundary.losing import KEY, Apart, S
from boundary.test_lost import apart as apart
from rtshcua.adapters.vehicle import messages
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.framing import FLAG_SIGNED, SIGNATURE, with_flags
from rtshcua.mavlink.modes import CopterMode, Px4Mode
from rtshcua.mavlink.signing import EPOCH_US, LEAD, MOST_AHEAD, UNIT_US, SignedLink, SigningState, timestamp_in
from rtshcua.model.faults import FlightMode
from rtshcua.onboard.enforcement.ahead import MOST
from rtshcua.onboard.enforcement.isolated import AHEAD, DISPATCH, SEAL, STATEMENT
from rtshcua.onboard.ports import Ending
from rtshcua.wire.boundary_chain import BoundaryChain
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP
from rtshcua.wire.statement import Statement, claimed

Make = Callable[..., Apart]

RETURN = messages.set_mode(1, Px4Mode.RETURN)


def pack(message: Any) -> bytes:
    return Codec(1, 191).pack(message)


class Thief:
    """A compromised runtime: it keeps every permit, and makes arbitrary requests."""

    def __init__(self, of: Apart) -> None:
        self.of = of
        self.permits: list[bytes] = []
        answer = of._answer

        def spied(octets: bytes) -> bytes:
            if octets[0] == DISPATCH:
                self.permits.append(octets[9:])
            return answer(octets)

        of._answer = spied

    def ask(self, permit: bytes, kind: int, link: int, *frames: bytes) -> bytes | str:
        """The frames that the boundary signs, or the refusal."""
        now_us = self.of.flight.clock.monotonic_us
        listed = b"".join(len(each).to_bytes(2) + each for each in frames)
        answer = self.of._answer(bytes([AHEAD]) + struct.pack(">qBb", now_us, kind, link) + permit + listed)
        return answer[1:].decode() if answer[0] else answer[1:]

    def signed(self, permit: bytes, kind: int, link: int, frame: bytes) -> bytes:
        answer = self.ask(permit, kind, link, frame)
        assert isinstance(answer, bytes), answer
        return with_flags(frame, FLAG_SIGNED) + answer[8:]

    def until(self, step: int) -> "Thief":
        """Fly until five seconds into a step."""
        since = None
        while since is None or self.of.flight.clock.elapsed_us - since < 5 * S:
            assert self.of.flight.turn() is None
            view = self.of.flight.runtime.view(self.of.flight.clock.now())
            if since is None and view.step == step and view.stage.name == "RUNNING":
                since = self.of.flight.clock.elapsed_us
        return self

    def stated(self) -> Statement:
        """The boundary's signed statement of its own evidence."""
        now = self.of.flight.clock.now()
        times = struct.pack(">qqq", now.monotonic_us, now.utc_us, now.utc_error_us)
        return claimed(self.of._answer(bytes([STATEMENT, 0]) + times)[1:])

    def send(self, frame: bytes) -> None:
        self.of.vehicle.simulation.receive(frame, self.of.flight.clock.elapsed_us)

    @property
    def mode(self) -> FlightMode:
        """The true mode of the vehicle."""
        return self.of.vehicle.simulation.truth().mode


@pytest.fixture
def thief(apart: Make) -> Thief:
    return Thief(apart("px4", legs=12))


def test_boundary_signs_nothing_before_the_first_step(thief: Thief) -> None:
    for _ in range(20):
        thief.of.flight.turn()
        if not thief.permits:
            assert thief.ask(bytes(56), CONTINGENCY_LINK, 2, pack(messages.set_mode(1, Px4Mode.LAND))) in (
                "permit/forged",
                "not-loaded",
            )


def test_only_frames_of_standing_links_are_signed_ahead(thief: Thief) -> None:
    thief.until(2)
    before, now = thief.permits[-2:]
    land, hold = pack(messages.set_mode(1, Px4Mode.LAND)), pack(messages.stop_here(1))
    assert isinstance(thief.ask(now, FALLBACK_LINK, 0, hold), bytes)
    assert isinstance(thief.ask(now, FALLBACK_LINK, 1, pack(RETURN)), bytes)
    assert thief.ask(before, FALLBACK_LINK, 0, hold) == "permit/lapsed", "its step is over"
    assert thief.ask(now, FALLBACK_LINK, 3, land) == "permit/not-covered", "there is no such link"
    assert isinstance(thief.ask(now, STEP, 0, land), str), "no step"
    assert thief.ask(now[:-1] + bytes([now[-1] ^ 1]), CONTINGENCY_LINK, 2, land) == "permit/forged"
    elsewhere = messages.reposition_amsl(1, 473_977_000, 85_456_000, 500.0, 4_000)
    for frame, why in (
        (pack(elsewhere), "frame/not-covered"),
        (pack(RETURN), "frame/not-covered"),  # of another link
        (pack(messages.arm(1)), "frame/not-covered"),
        (pack(messages.command(1, messages.ARM_DISARM, 0, 21_196)), "frame/forced-arming"),
        (pack(messages.command(1, messages.TAKEOFF, 0, 0, 0, 0, 0, 0, 50)), "frame/not-covered"),
        (pack(messages.heartbeat()), "frame/not-covered"),  # nor what would keep a stream alive
        (pack(messages.request(1, "HEARTBEAT")), "frame/not-covered"),
        (pack(m.MAVLink_param_set_message(1, 1, b"FENCE_ENABLE", 0, 2)), "frame/not-covered"),
        (pack(m.MAVLink_setup_signing_message(1, 1, bytes(32), 0)), "frame/not-one-frame"),
        (Codec(2, 191).pack(messages.stop_here(1)), "frame/not-ours"),
        (pack(messages.stop_here(2)), "frame/wrong-target"),
        (hold + b"\0", "frame/not-one-frame"),
        (b"", "frame/not-one-frame"),
    ):
        assert thief.ask(now, FALLBACK_LINK, 0, frame) == why, frame.hex()
        assert thief.ask(now, FALLBACK_LINK, 0, hold, frame) == why, "all of a link, or none"


def test_gate_stays_closed_for_frames_signed_ahead(thief: Thief) -> None:
    thief.until(2)
    frame = pack(RETURN)
    assert isinstance(thief.ask(thief.permits[-1], FALLBACK_LINK, 1, frame), bytes)
    answer = thief.of._answer(bytes([SEAL]) + struct.pack(">q", thief.of.flight.clock.monotonic_us) + frame)
    assert answer[1:].decode() == "frame/not-covered"


def test_request_at_wrong_moment_is_refused(thief: Thief) -> None:
    thief.until(2)
    call = bytes([AHEAD]) + struct.pack(">qBb", -5, FALLBACK_LINK, 1) + thief.permits[-1]
    assert thief.of._answer(call)[1:].decode() == "malformed"
    for damaged in (call[:30], call[:9], call + b"\0", call + b"\xff\xff" + bytes(40)):
        assert thief.of._answer(damaged)[0] == 1


@pytest.mark.slow
def test_delayed_frame_signed_ahead_expires(thief: Thief) -> None:
    """A frame kept from the first leg: while normal frames continue, the vehicle no longer accepts it."""
    thief.until(1)
    kept = thief.signed(thief.permits[-1], FALLBACK_LINK, 1, pack(RETURN))
    since_us = thief.of.flight.clock.elapsed_us
    thief.until(7)
    assert thief.of.flight.clock.elapsed_us - since_us > 31 * S
    mode = thief.mode
    assert mode is not FlightMode.RETURN
    thief.send(kept)
    assert thief.mode is mode


def test_early_use_of_frame_voids_frames_signed_before(thief: Thief) -> None:
    """It only replaces the link's own dispatch; the other frames held by then are void."""
    thief.until(2)
    permit = thief.permits[-1]
    hold, home = (
        thief.signed(permit, FALLBACK_LINK, 0, pack(messages.stop_here(1))),
        thief.signed(permit, FALLBACK_LINK, 1, pack(RETURN)),
    )
    thief.send(home)
    assert thief.mode is FlightMode.RETURN
    thief.send(hold)
    assert thief.mode is FlightMode.RETURN, "a later link voids an earlier one"
    thief.send(home)
    normal = thief.of._answer(
        bytes([SEAL]) + struct.pack(">q", thief.of.flight.clock.monotonic_us) + pack(messages.heartbeat())
    )
    assert timestamp_in(normal[1:]) < timestamp_in(home), "nor does the vehicle take what the boundary signs now"


def test_links_flown_with_boundary_are_only_counted(thief: Thief) -> None:
    """No entry reports them. The statement has the number of frames signed ahead, and a digest over them."""
    thief.until(2)
    permit, frames = thief.permits[-1], [pack(RETURN), pack(messages.set_mode(1, Px4Mode.LAND))]
    before = thief.stated()
    for link, frame in enumerate(frames, 1):
        thief.send(thief.signed(permit, CONTINGENCY_LINK, link, frame))
    assert thief.mode is FlightMode.LAND
    after, expected = thief.stated(), BoundaryChain()
    expected.aside = before.aside
    for frame in frames:
        expected.sign_ahead(frame)
    assert (after.count, after.digest, after.frames) == (before.count, before.digest, before.frames)
    assert (after.ahead, after.aside) == (before.ahead + len(frames), expected.aside)


def test_flood_does_not_extend_frames_signed_ahead(thief: Thief) -> None:
    thief.until(2)
    permit, land = thief.permits[-1], pack(messages.set_mode(1, Px4Mode.LAND))
    call, kept = [land] * MOST, b""
    for _ in range(2 * MOST_AHEAD // MOST):
        answer = thief.ask(permit, CONTINGENCY_LINK, 2, *call)
        if isinstance(answer, str):
            break
        kept = with_flags(land, FLAG_SIGNED) + answer[-SIGNATURE:]
    assert answer == "frame/too-many-ahead"
    normal = thief.of._answer(
        bytes([SEAL]) + struct.pack(">q", thief.of.flight.clock.monotonic_us) + pack(messages.heartbeat())
    )
    assert LEAD < timestamp_in(kept) - timestamp_in(normal[1:]) <= LEAD + MOST_AHEAD


def test_frame_refused_ahead_is_not_counted_as_stopped(thief: Thief) -> None:
    thief.until(2)
    before = thief.stated()
    assert thief.ask(thief.permits[-1], CONTINGENCY_LINK, 2, b"no frame") == "frame/not-one-frame"
    assert (thief.stated().stopped, thief.stated().aside) == (before.stopped, before.aside)


def test_boundary_signs_nothing_after_a_landing(apart: Make) -> None:
    of = apart("px4", legs=2)
    thief = Thief(of)
    of.fly(lambda _: False)
    for permit in thief.permits:
        assert isinstance(thief.ask(permit, CONTINGENCY_LINK, 2, pack(messages.set_mode(1, Px4Mode.LAND))), str)


# ---------------------------------------------------------------- once it is lost


@pytest.mark.slow
@pytest.mark.parametrize("key", [KEY, None], ids=("signed", "keyless"))
@pytest.mark.parametrize(("flavour", "modes"), [("px4", Px4Mode), ("ardupilot", CopterMode)])
def test_only_frames_signed_ahead_leave_after_the_loss(
    flavour: str, modes: Any, key: bytes | None, apart: Make
) -> None:
    of = apart(flavour, key)
    thief = Thief(of).until(1)
    of.lose()
    gate, now_us = of.gate, of.flight.clock.monotonic_us
    frames = [
        *(pack(messages.set_mode(1, mode)) for mode in modes), pack(messages.arm(1)),
        pack(messages.command(1, messages.TAKEOFF, 0, 0, 0, 0, 0, 0, 50)),
        pack(messages.reposition_amsl(1, 473_977_000, 85_456_000, 500.0, 4_000)),
        pack(messages.position_target(1, 473_977_000, 85_456_000, 15.0)),
    ]  # fmt: skip
    for frame in frames:
        assert isinstance(gate.seal(frame, now_us), Refusal)
    begun = of.flight.loaded.executor.stand_in(thief.permits[-1], CONTINGENCY_LINK, 1, now_us)
    assert not isinstance(begun, Refusal)
    home = pack(messages.set_mode(1, modes.RETURN if flavour == "px4" else modes.RTL))
    left = [each for each in (gate.seal(frame, now_us) for frame in frames) if isinstance(each, bytes)]
    assert len(left) == 1, "the one frame of the link that was begun"
    copies = [gate.seal(home, now_us) for _ in range(10)]
    assert sum(isinstance(each, bytes) for each in copies) == 5, "its retries, and no more"
    back = of.flight.loaded.executor.stand_in(thief.permits[-1], FALLBACK_LINK, 0, now_us)
    assert isinstance(back, Refusal)


def told(of: Apart, message: Any, link: int = 0, timestamp: int | None = None, key: bytes = bytes(32)) -> bytes:
    """A frame in the vehicle's name by somebody without the key, with a well-formed signature."""
    stamp = timestamp if timestamp is not None else max(last for last, _ in of.gate._heard.values()) + 50
    signer = SignedLink(key, SigningState(stamp - 1, {}), EPOCH_US, 0, link)
    return signer.sign(Codec(1, 1).pack(message), 0)


def test_replayed_frames_and_other_streams_are_refused(apart: Make) -> None:
    """Frames with a time far in the future are refused too. A frame that continues the vehicle's stream is accepted,
    because it cannot be distinguished.
    """
    of = apart("px4")
    Thief(of).until(1)
    of.lose()
    beat = m.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
    last = max(last for last, _ in of.gate._heard.values())
    now_us = of.flight.clock.monotonic_us
    of.gate.accept(told(of, beat), now_us)  # the first call finds that it is lost
    last = max(last for last, _ in of.gate._heard.values())
    assert not of.gate.accept(told(of, beat, timestamp=last), now_us)
    assert not of.gate.accept(told(of, beat, timestamp=last - 1_000), now_us)
    assert not of.gate.accept(told(of, beat, timestamp=last + 61 * S // UNIT_US), now_us)
    assert not of.gate.accept(told(of, beat, link=7), now_us)
    assert not of.gate.accept(Codec(1, 1).pack(beat), now_us), "unsigned"
    assert of.gate.accept(told(of, beat, timestamp=last + 1), now_us)


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_forged_telemetry_can_only_select_a_link(flavour: str, apart: Make) -> None:
    """Forged reports of a landing, a takeover or another position: only a link is sent, or nothing."""
    of = apart(flavour)
    sent: list[bytes] = []
    of.vehicle.lose = lambda frame: sent.append(frame) is not None
    lies = (
        m.MAVLink_extended_sys_state_message(0, 1),
        m.MAVLink_heartbeat_message(2, 12 if flavour == "px4" else 3, 0, 0, 4, 3),
        m.MAVLink_global_position_int_message(0, 473_990_000, 85_470_000, 500_000, 90_000, 0, 0, 0, 0),
    )

    def lie(datagram: bytes) -> list[bytes]:
        return [datagram, *(told(of, each) for each in lies)] if of.dead else [datagram]

    of.vehicle.hurt = lie
    links: list[bytes] = []

    def dies(of: Apart) -> bool:
        if of.flight.clock.elapsed_us < 25 * S:
            return False
        links.extend(copy.octets for link in of.gate.ahead._links for copy in link.copies)
        sent.clear()
        return True

    flown = of.fly(dies)
    assert flown.ending is not Ending.COMPLETED
    assert links
    assert set(sent) <= set(links)
