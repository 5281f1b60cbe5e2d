"""The stored frames that were signed ahead: their order, their copies, and their validity."""

from collections.abc import Sequence
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from reference.flat_case import MISSION, POLICY
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.flavour import Stage
from rtshcua.adapters.vehicle.manoeuvre import RETRIES, sendings
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.modes import Px4Mode
from rtshcua.mavlink.signing import EPOCH_US, LEAD, UNIT_US, SignedLink, SigningState, timestamp_in
from rtshcua.onboard.enforcement import ahead
from rtshcua.onboard.enforcement.ahead import EVERY_US, LAST, NO_COPY, FramesAhead
from rtshcua.onboard.enforcement.allow_list import Frame, read_frame
from rtshcua.onboard.enforcement.executor import Commands, SignedAhead
from rtshcua.onboard.ports import Command
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.wire.permit import AGAIN
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK

KEY = bytes(range(32))
UTC = EPOCH_US + 10**15
PERMIT = b"a permit"
STEP = 1  # its chain, as the contingency: hover, return_home, emergency_land
CHAIN = [(FALLBACK_LINK, 0), (FALLBACK_LINK, 1), (FALLBACK_LINK, 2)]
CONTINGENCY = [(CONTINGENCY_LINK, 0), (CONTINGENCY_LINK, 1), (CONTINGENCY_LINK, 2)]
SENDINGS = 1 + RETRIES


class Boundary:
    """Signs everything under tokens of its own; `refused` are links that it refuses."""

    def __init__(self, *, signs: bool = True) -> None:
        self.link = SignedLink(KEY, SigningState(0, {}), UTC, 0)
        self.signs = signs
        self.refused: dict[tuple[int, int], str] = {}
        self.asked: list[tuple[int, int]] = []

    def sign(self, sealed: bytes, kind: int, link: int, frames: Sequence[bytes], now_us: int) -> SignedAhead | Refusal:
        assert sealed == PERMIT
        self.asked.append((kind, link))
        if (kind, link) in self.refused:
            return Refusal(self.refused[kind, link], "")
        signed = [self.link.sign_ahead(each, now_us) if self.signs else b"" for each in frames]
        return SignedAhead(100 * kind + 20 * link, tuple(each[-13:] for each in signed if each is not None))


def pack(message: Any) -> bytes:
    return Codec(1, 191).pack(message)


MODES = {"hover": Px4Mode.HOLD, "return_home": Px4Mode.RETURN, "emergency_land": Px4Mode.LAND}


def encode(command: Command) -> list[bytes]:
    stage = Stage(messages.set_mode(1, MODES[command.skill]), messages.DO_SET_MODE, None, frozenset())
    return [pack(each) for each in sendings(stage)]


def frame(skill: str, confirmation: int = 0, height: float = 0.0) -> Frame:
    message = messages.set_mode(1, MODES[skill])
    message.confirmation, message.param7 = confirmation, height
    read = read_frame(pack(message))
    assert read is not None
    return read


def made(boundary: Boundary | None = None) -> FramesAhead:
    of = FramesAhead(Commands(POLICY, MISSION), (boundary or Boundary()).sign)
    of.stands(PERMIT, STEP)
    assert of.renew(encode, 0, begins=True) == []
    return of


def stamps(taken: Sequence[bytes | Refusal]) -> list[int]:
    return [timestamp_in(each) for each in taken if isinstance(each, bytes)]


def test_each_link_behind_the_step_is_signed_in_its_order() -> None:
    boundary = Boundary()
    made(boundary)
    assert boundary.asked == [*CHAIN, *CONTINGENCY]


def test_the_timestamps_ascend_from_copy_to_copy_and_link_to_link() -> None:
    of, taken = made(), []
    for (kind, link), skill in zip(CONTINGENCY, MODES, strict=True):
        assert of.begin(kind, link) is not None
        taken += [of.take(frame(skill, confirmation)) for confirmation in range(SENDINGS)]
    found = stamps(taken)
    assert len(found) == 3 * SENDINGS
    assert found == sorted(set(found))


def test_frame_retries_are_limited() -> None:
    of = made()
    of.begin(FALLBACK_LINK, 0)
    taken = [of.take(frame("hover", confirmation)) for confirmation in range(SENDINGS)]
    assert all(isinstance(each, bytes) for each in taken)
    assert of.take(frame("hover", 1)) is NO_COPY


def test_another_frame_than_those_of_the_link_does_not_leave() -> None:
    of = made()
    assert of.take(frame("hover")) is NO_COPY, "no link was begun"
    of.begin(FALLBACK_LINK, 0)
    assert of.take(frame("return_home")) is NO_COPY
    arm = read_frame(pack(messages.arm(1)))
    assert arm is not None
    assert of.take(arm) is NO_COPY


def test_links_go_forward_only() -> None:
    of = made()
    assert of.begin(FALLBACK_LINK, 1) is not None
    assert of.begin(FALLBACK_LINK, 0) is None
    assert of.begin(FALLBACK_LINK, 1) is None
    assert of.begin(CONTINGENCY_LINK, 1) is not None
    assert of.begin(CONTINGENCY_LINK, 0) is None
    assert of.begin(FALLBACK_LINK, 1) is None


def test_a_link_that_was_passed_over_is_void() -> None:
    """Its frames are older than those that the vehicle accepted, so it would refuse them."""
    of = made()
    of.begin(CONTINGENCY_LINK, 0)
    of.take(frame("hover"))
    assert of.begin(FALLBACK_LINK, 1) is None


def test_the_last_link_may_be_sent_as_often_as_a_run_insists_on_it() -> None:
    of = made()
    tokens, taken = [], []
    for _ in range(LAST):
        command = of.begin(*CONTINGENCY[-1])
        assert command is not None
        tokens.append(command.token)
        taken += [of.take(frame("emergency_land", confirmation)) for confirmation in range(SENDINGS)]
        of.ended(command.token)
        assert of.take(frame("emergency_land")) is NO_COPY, "it ended"
    assert stamps(taken) == sorted(set(stamps(taken)))
    assert len(stamps(taken)) == LAST * SENDINGS
    assert tokens == list(range(tokens[0], tokens[0] + LAST))
    of.begin(*CONTINGENCY[-1])
    assert of.take(frame("emergency_land")) is NO_COPY


def test_the_last_link_is_signed_often_enough() -> None:
    """An unattended run begins with it once more (`Runtime.leave`), each time under a permit."""
    assert 2 * (Limits().tries + 1) <= LAST <= AGAIN


def test_ended_link_passes_no_frame() -> None:
    of = made()
    first = of.begin(FALLBACK_LINK, 0)
    second = of.begin(FALLBACK_LINK, 1)
    assert first is not None
    assert second is not None
    of.ended(first.token)
    assert isinstance(of.take(frame("return_home")), bytes), "another one runs"
    of.ended(second.token)
    assert of.take(frame("return_home")) is NO_COPY


@pytest.mark.parametrize("kind_of_place", ["height", "time"])
def test_home_and_time_fields_do_not_distinguish_frames(kind_of_place: str) -> None:
    """Home moved a little since the signature, and time went on: the target is the same."""

    def target(of: float, at_ms: int = 0) -> bytes:
        if kind_of_place == "height":
            return pack(messages.reposition_amsl(1, 5, 6, of, 4_000))
        message = messages.position_target(1, 5, 6, of)
        message.time_boot_ms = at_ms
        return pack(message)

    of = FramesAhead(Commands(POLICY, MISSION), Boundary().sign)
    of.stands(PERMIT, STEP)
    of.renew(lambda _: [target(500.0)], 0, begins=True)
    of.begin(FALLBACK_LINK, 0)
    again, elsewhere = read_frame(target(500.7, 9)), read_frame(pack(messages.reposition_amsl(1, 5, 7, 500.0, 4_000)))
    assert again is not None
    assert elsewhere is not None
    assert of.take(elsewhere) is NO_COPY
    assert isinstance(of.take(again), bytes)


def test_frames_are_signed_again_before_they_expire() -> None:
    boundary = Boundary()
    of = made(boundary)
    for now_us in range(0, 10 * EVERY_US, EVERY_US // 7):
        of.sent(boundary.link.sign(pack(messages.heartbeat()), now_us))
        of.renew(encode, now_us)
    kept = of.begin(FALLBACK_LINK, 0)
    assert kept is not None
    copy = of.take(frame("hover"))
    assert isinstance(copy, bytes)
    assert timestamp_in(copy) - timestamp_in(boundary.link.sign(pack(messages.heartbeat()), 10 * EVERY_US)) > 0
    assert len(boundary.asked) == 9 * len([*CHAIN, *CONTINGENCY])
    assert EVERY_US * 2 <= LEAD * UNIT_US


def test_frames_are_signed_again_when_timestamps_run_fast() -> None:
    """The timestamps of a recorded ArduCopter do so for a while, and ours follow."""
    boundary = Boundary()
    of = made(boundary)
    for second in range(1, 12):
        boundary.link.accept(
            SignedLink(KEY, SigningState(0, {}), UTC + 8_000_000 * second, 0).sign(pack_of_vehicle(), 0),
            1_000_000 * second,
        )
        of.sent(boundary.link.sign(pack(messages.heartbeat()), 1_000_000 * second))
        of.renew(encode, 1_000_000 * second)
        of.begin(FALLBACK_LINK, 0)
        assert isinstance(of.take(frame("hover")), bytes), second
        of.flown()


def pack_of_vehicle() -> bytes:
    return Codec(1, 1).pack(m.MAVLink_heartbeat_message(2, 12, 29, 0, 3, 3))


def test_voided_frame_is_not_sent() -> None:
    boundary = Boundary()
    of = made(boundary)
    of.sent(boundary.link.sign(pack(messages.heartbeat()), LEAD * UNIT_US + 1_000_000))
    of.begin(FALLBACK_LINK, 0)
    assert of.take(frame("hover")) is NO_COPY


def test_another_step_takes_the_place_of_the_one_before() -> None:
    of = made()
    of.stands(PERMIT, STEP + 1)
    assert of.begin(FALLBACK_LINK, 0) is None, "until its own chain is signed"
    assert of.begin(CONTINGENCY_LINK, 0) is not None
    of.renew(encode, 1)
    assert of.begin(FALLBACK_LINK, 0) is None, "nothing is signed before it begins"
    of.renew(encode, 1, begins=True)
    assert of.begin(FALLBACK_LINK, 0) is not None


@pytest.mark.parametrize("permit", [PERMIT, b"another"])
def test_withdrawn_step_restores_previous_links(permit: bytes) -> None:
    boundary = Boundary()
    of = made(boundary)
    signed = len(boundary.asked)
    of.stands(b"another", STEP + 1)
    of.withdrawn(permit)
    of.renew(encode, 1)
    assert len(boundary.asked) == signed * (1 if permit == PERMIT else 2)
    assert (of.begin(FALLBACK_LINK, 0) is None) is (permit == PERMIT)


def test_no_links_after_withdrawal_of_first_step() -> None:
    boundary = Boundary()
    of = FramesAhead(Commands(POLICY, MISSION), boundary.sign)
    of.withdrawn(PERMIT)
    of.stands(PERMIT, STEP)
    of.withdrawn(PERMIT)
    for begins in (True, False):
        assert of.renew(encode, 1, begins=begins) == ()
    assert boundary.asked == []


def test_step_waits_for_signed_links_but_link_does_not() -> None:
    boundary = Boundary()
    of = FramesAhead(Commands(POLICY, MISSION), boundary.sign)
    of.stands(PERMIT, STEP)
    of.renew(encode, 0, begins=True)
    signed = len(boundary.asked)
    assert signed == len([*CHAIN, *CONTINGENCY])
    of.flown()
    of.renew(encode, 1, begins=True)
    assert len(boundary.asked) == signed
    of.renew(encode, 1)
    assert len(boundary.asked) == 2 * signed


def test_no_links_after_landing() -> None:
    of = made()
    of.lapse()
    assert of.begin(CONTINGENCY_LINK, 0) is None
    assert of.renew(encode, 10 * EVERY_US) == ()


def test_lapsed_links_are_skipped_silently() -> None:
    boundary = Boundary()
    boundary.refused = {CHAIN[0]: "permit/used", CHAIN[1]: "permit/backwards"}
    of = made(boundary)
    assert of.begin(*CHAIN[0]) is None
    assert of.begin(*CONTINGENCY[0]) is not None


def test_links_that_cannot_be_signed_are_reported() -> None:
    boundary = Boundary()
    boundary.refused = {CHAIN[0]: "frame/not-covered"}
    of = FramesAhead(Commands(POLICY, MISSION), boundary.sign)
    of.stands(PERMIT, STEP)
    assert of.renew(encode, 0, begins=True) == ["cannot sign `hover` ahead: frame/not-covered"]
    of.flown()
    assert len(of.renew(lambda command: () if command.skill == "emergency_land" else encode(command), 1)) == 3


def test_failed_renewal_keeps_frames_and_is_retried() -> None:
    boundary = Boundary()
    of = made(boundary)
    boundary.refused = dict.fromkeys([*CHAIN, *CONTINGENCY], "time-apart")
    of.renew(encode, EVERY_US)
    asked = len(boundary.asked)
    of.renew(encode, EVERY_US + 999_999)
    assert len(boundary.asked) == asked
    of.renew(encode, EVERY_US + 1_000_000)
    assert len(boundary.asked) > asked
    assert of.begin(*CHAIN[0]) is not None


def test_failed_renewal_is_retried_once_a_second() -> None:
    boundary = Boundary()
    of = made(boundary)
    of.sent(boundary.link.sign(pack(messages.heartbeat()), 25_000_000))
    boundary.refused = dict.fromkeys([*CHAIN, *CONTINGENCY], "frame/not-covered")
    asked = len(boundary.asked)
    notes = [note for turn in range(100) for note in of.renew(encode, 25_000_000 + turn * 10_000)]
    assert len(notes) == len(boundary.asked) - asked == len([*CHAIN, *CONTINGENCY])
    of.renew(encode, 26_000_000)
    assert len(boundary.asked) - asked == 2 * len([*CHAIN, *CONTINGENCY])


@pytest.mark.parametrize("longest", ["hover", "return_home", "emergency_land"])
def test_a_link_with_more_frames_than_a_call_takes_is_left_out_with_a_note(longest: str) -> None:
    boundary = Boundary()
    of = FramesAhead(Commands(POLICY, MISSION), boundary.sign)
    of.stands(PERMIT, STEP)

    def many(command: Command) -> list[bytes]:
        frames = encode(command)
        return [frames[0]] * (ahead.MOST + 1) if command.skill == longest else frames

    note = f"cannot sign `{longest}` ahead: {ahead.MOST + 1} frames; the limit is {ahead.MOST}"
    assert of.renew(many, 0, begins=True) == [note] * 2
    left = [number for number, skill in enumerate(MODES) if skill != longest]
    assert boundary.asked == [(kind, number) for kind in (FALLBACK_LINK, CONTINGENCY_LINK) for number in left]
    assert of.renew(many, 1) == ()


def test_a_link_without_a_key_has_the_same_rules() -> None:
    of = made(Boundary(signs=False))
    of.begin(FALLBACK_LINK, 1)
    for confirmation in range(SENDINGS):
        assert of.take(frame("return_home", confirmation)) == encode(of_skill("return_home"))[confirmation]
    assert of.take(frame("return_home")) is NO_COPY
    assert of.begin(FALLBACK_LINK, 0) is None


def of_skill(skill: str) -> Command:
    return Command(0, skill, 0, (), (), 0, 0)


def test_no_call_has_more_frames_than_the_boundary_takes() -> None:
    sizes: list[int] = []

    def sign(sealed: bytes, kind: int, link: int, frames: Sequence[bytes], now_us: int) -> Refusal:
        sizes.append(len(frames))
        return Refusal("frame/not-covered", "")

    of = FramesAhead(Commands(POLICY, MISSION), sign)
    of.stands(PERMIT, STEP)
    of.renew(lambda command: [*encode(command)] * 4, 0, begins=True)
    assert max(sizes) <= ahead.MOST
    assert sizes[-1] > sizes[0]
