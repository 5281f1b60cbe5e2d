"""The frame session: which MAVLink 2 frames may be sent to the vehicle, octet by octet (design 4.5, mediated
dispatch).

Every frame of an adapter goes through `seal`, and only the result of `seal` may be sent. A dispatched permit opens
a session for its one command: until that command ends, only frames that carry it out pass. A preparation opens it
for its listed parameters and values, on the ground only. Housekeeping always passes. A frame on neither list
(`allow_list`) is refused. With a signer each passing frame is signed; only the signer has the key. Frames that
carry out a command are chained as they pass, without their signature (`wire.boundary_chain`), and refused frames
are counted there. The other frames are not chained: they move nothing, most of the traffic is heartbeats and
requests, and parameters have permits of their own.

Some rules depend on the autopilot and on the height of its home. Both are read from received frames (`observe`),
not from the adapter that wants to send. With a key, those frames were verified first.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink import enums
from rtshcua.mavlink.framing import SIGNATURE
from rtshcua.mavlink.layouts import (
    COMMAND_LONG,
    EXTENDED_SYS_STATE,
    GLOBAL_POSITION_INT,
    HEARTBEAT,
    LAYOUTS,
    PARAM_VALUE,
)
from rtshcua.mavlink.modes import is_vehicle
from rtshcua.mavlink.parameters import is_bytewise, value_of
from rtshcua.mavlink.signing import SignedLink
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement import allow_list
from rtshcua.onboard.enforcement.allow_list import Frame, read_frame
from rtshcua.onboard.enforcement.payload_gate import (
    NOT_COVERED,
    WRONG_TARGET,
    PayloadGate,
    PayloadNumbers,
    read_payload,
)
from rtshcua.onboard.ports import Command
from rtshcua.wire.boundary_chain import BoundaryChain
from rtshcua.wire.preparation import ParameterWrite

#: our ids, in the vehicle's own system, and those of the addressee
OURS: Final = enums.MAV_COMP_ID_ONBOARD_COMPUTER
AUTOPILOT: Final = enums.MAV_COMP_ID_AUTOPILOT1
#: mm: the greatest difference of a reported height of home from the one when the takeoff was permitted: arming sets
#: home anew, and GPS heights drift. A larger difference is ignored, because every transmitted height above sea would
#: change with it.
HOME_MOVES: Final = 10_000

#: us: the greatest age of a heartbeat, and of a report of the landed state, of a vehicle that counts as on the
#: ground
STANDS_US: Final = 3_000_000

_LANDED: Final = LAYOUTS[EXTENDED_SYS_STATE].at("landed_state")
_identity: Final = LAYOUTS[HEARTBEAT].getter("type autopilot")
_BASE_MODE: Final = LAYOUTS[HEARTBEAT].at("base_mode")
_position: Final = LAYOUTS[GLOBAL_POSITION_INT].getter("lat lon alt relative_alt")

# reasons why a frame is refused
NOT_ONE_FRAME: Final = Refusal("frame/not-one-frame", "the frame is not exactly one complete, unsigned MAVLink 2 frame")
NO_VEHICLE: Final = Refusal("frame/no-vehicle", "no autopilot was heard yet")
NOT_OURS: Final = Refusal("frame/not-ours", "the frame has another sender id")
FORCED_ARMING: Final = Refusal("frame/forced-arming", "the frame arms or disarms past the autopilot's own checks")
AFTER_START: Final = Refusal(
    "frame/after-start", "the frame changes a fence after takeoff or while the motors are armed"
)
NOT_LISTED: Final = Refusal("frame/not-listed", "the frame sets a parameter to a value that no preparation lists")
NOT_DOWN: Final = Refusal(
    "frame/not-down",
    "the frame sets a parameter while the vehicle flies, is armed, or is not known to be on the ground",
)
SESSION_OVER: Final = Refusal("frame/session-over", "the boundary signed that its session ends here")
NO_SESSION: Final = Refusal("frame/no-session", "the frame moves the vehicle without a permit")
#: the leg to it was never checked
OUT_OF_ORDER: Final = Refusal("frame/out-of-order", "the frame is for a point of the path before its turn")
#: not sent, without a failure
UNSIGNED: Final = Refusal("frame/unsigned", "the frame moves nothing, and the boundary that would sign it is lost")
TOO_MANY_AHEAD: Final = Refusal("frame/too-many-ahead", "more frames were signed ahead than any link needs")
LATE: Final = Refusal("frame/late", "the first frame of the command comes after its permit's time")


class Gate(Protocol):
    """The interface of a `FrameSession` for an adapter: requests and reports. It cannot open the gate."""

    @property
    def may_be_lost(self) -> bool:
        """Whether it may stop answering in flight: only then is it ever mute, or signs frames ahead."""
        ...

    def observe(self, frame: bytes, now_us: int = 0) -> None:
        """Process a valid frame from the link, received at a monotonic time; without a time, it is too old for values
        that must be recent.
        """
        ...

    def seal(self, frame: bytes, now_us: int) -> bytes | Refusal:
        """The octets to send for a frame, or why it is refused."""
        ...

    @property
    def is_mute(self) -> bool:
        """Whether only frames signed ahead can be sent: no request is sent, so no answer comes."""
        ...

    def renew_ahead(self, encode: Callable[[Command], Sequence[bytes]], now_us: int, *, begins: bool) -> Sequence[str]:
        """Have the due frames signed ahead, if the gate may be lost; return the reasons for those that are not.
        `encode` makes the frames of a command, each as often as it may have to be sent. `begins`: only those of a
        step that is about to begin.
        """
        ...


@dataclass(slots=True)
class _Session:
    """One permitted command and its progress."""

    command: Command
    begun: bool = False  # a frame of it was sent
    leg: int = -1  # the last point of its path that was sent


class FrameSession:
    """The gate for outgoing frames. Only the executor opens and closes it."""

    #: this gate exists as long as its adapter does
    may_be_lost = is_mute = False

    def __init__(self) -> None:
        #: the chain of the frames that pass
        self.chain = BoundaryChain()
        self._signer: SignedLink | None = None
        self._session: _Session | None = None
        #: whether a frame was sent or signed ahead since the last permit
        self.let_out = False
        self._here: tuple[int, int] | None = None  # 1e-7 degree
        self._above_home = 0  # mm
        self._started = False  # a session was opened: fences are no longer changed
        self._system = 0
        self._autopilot = 0  # MAV_AUTOPILOT
        self._kind = 0  # MAV_TYPE
        self._armed = False  # according to its last heartbeat,
        self._armed_us = 0  # and the time of that
        self._stands_us = 0  # the last report that it is on the ground; 0 after any other
        self._types: float | None = None  # FENCE_TYPE
        self._prepared: frozenset[tuple[str, int | None]] = (
            frozenset()
        )  # parameters that may be set, with their values,
        self._prepared_us = 0  # and until when
        self._home_amsl: int | None = None  # mm
        self._settled_amsl: int | None = None  # the same, at the time of the takeoff permit
        self._payload = PayloadGate()

    def sign_with(self, signer: SignedLink) -> None:
        """Sign outgoing frames from now on. Raises RuntimeError if they are signed already: a key is never replaced."""
        if self._signer is not None:
            raise RuntimeError("this link is signed already")
        self._signer = signer

    def open(self, command: Command) -> None:
        """Let the frames of one command pass, in place of those before."""
        self._session, self._started, self.let_out = _Session(command), True, False
        self._payload.open(command.payload, command.servos, self._system)
        self.prepared()
        if self._settled_amsl is None or command.kind == MotionKind.CLIMB:
            self._settled_amsl = self._home_amsl

    def close(self) -> None:
        """Let nothing more pass that moves the vehicle, and of the payload only what ends something."""
        self._session = None
        self._payload.close()

    def prepare(self, writes: Iterable[ParameterWrite], not_after_us: int) -> None:
        """Allow these parameters to be set while the vehicle is on the ground."""
        self._prepared = frozenset((each.name, each.value) for each in writes)
        self._prepared_us = not_after_us

    def prepared(self) -> None:
        """Allow no parameter to be set any more."""
        self._prepared = frozenset()

    def stands(self, now_us: int) -> bool:
        """Whether the vehicle is known to be on the ground and disarmed, without a permitted command under way."""
        recent = min(self._armed_us, self._stands_us) > max(0, now_us - STANDS_US)
        return recent and not self._armed and self._session is None

    def observe(self, frame: bytes, now_us: int = 0) -> None:
        """Process a valid frame from the link. The first heartbeat of a vehicle with a supported autopilot fixes its
        kind; later heartbeats of another kind of vehicle or autopilot, under the same ids, are ignored.
        """
        heard = read_frame(frame)
        if heard is None or heard.component != AUTOPILOT:
            self._hear_another(heard)
            return
        if heard.message == HEARTBEAT:
            kind, autopilot = _identity(heard.fields)
            if not self._system and is_vehicle(kind, autopilot):
                self._system, self._autopilot, self._kind = heard.system, autopilot, kind
            if (heard.system, autopilot, kind) == (self._system, self._autopilot, self._kind):
                self._armed = bool(heard.fields[_BASE_MODE] & enums.MAV_MODE_FLAG_SAFETY_ARMED)
                self._armed_us = now_us
        elif heard.message == GLOBAL_POSITION_INT and heard.system == self._system:
            latitude, longitude, amsl, above_home = _position(heard.fields)
            self._here, self._above_home = (latitude, longitude), above_home
            home_amsl, settled = amsl - above_home, self._settled_amsl  # mm
            if settled is None or abs(home_amsl - settled) <= HOME_MOVES:
                self._home_amsl = home_amsl
        elif heard.message == EXTENDED_SYS_STATE and heard.system == self._system:
            self._stands_us = now_us if heard.fields[_LANDED] == enums.MAV_LANDED_STATE_ON_GROUND else 0
        elif heard.message == PARAM_VALUE and heard.system == self._system:
            name, bits = allow_list.told(heard, bytewise=is_bytewise(self._autopilot))
            if name == "FENCE_TYPE":
                self._types = 0.0 if bits is None else value_of(bits)

    def _hear_another(self, heard: Frame | None) -> None:
        """Process a frame of another component, if it is one: only the payload of the vehicle matters."""
        if heard is not None and heard.message == HEARTBEAT and 0 < heard.system == self._system:
            self._payload.hear(heard)

    def seal(self, frame: bytes, now_us: int) -> bytes | Refusal:
        """The octets to send for a frame at a monotonic time, or why it is refused."""
        judged = self._judge(frame, now_us)
        if isinstance(judged, Refusal):
            self.chain.stop(frame)
            return judged
        sealed = frame if self._signer is None else self._signer.sign(frame, now_us)
        if judged:
            self.chain.leave(frame)
        return sealed

    def renew_ahead(self, encode: Callable[[Command], Sequence[bytes]], now_us: int, *, begins: bool) -> Sequence[str]:
        """Nothing to do: see `may_be_lost`."""
        return ()

    def sign_ahead(self, frame: bytes, command: Command, now_us: int) -> bytes | Refusal:
        """Sign a frame of a command ahead, for use after the loss of the boundary. Returns its signature, empty
        without a key; or why it is refused. The gate does not change.
        """
        refused = self._refuse_ahead(frame, command)
        if refused is not None:
            return refused
        if self._signer is None:
            return b""
        signed = self._signer.sign_ahead(frame, now_us)
        if signed is None:
            return TOO_MANY_AHEAD
        self.chain.sign_ahead(frame)
        self.let_out = True
        return signed[-SIGNATURE:]

    def _judge(self, octets: bytes, now_us: int) -> Refusal | bool:
        """Why a frame is refused, or else whether it carries out a command."""
        # 1. exactly one frame, from us, to the autopilot that was heard, or to a camera beside it, and to nobody else
        frame = read_frame(octets)
        if frame is None:
            return NOT_ONE_FRAME
        if not self._system:  # a vehicle may wait for a first message; it only learns our ids
            return False if allow_list.is_greeting(frame) and frame.component == OURS else NO_VEHICLE
        # 2. never, even with a permit
        refused = self._refuse_always(frame)
        if refused is not None:
            return refused
        # 3. always, or before the flight
        if allow_list.is_housekeeping(frame):
            return False
        if self.chain.over:
            return SESSION_OVER
        if frame.message not in allow_list.COMMANDS:
            setting = allow_list.written(frame, bytewise=is_bytewise(self._autopilot))
            if setting is not None and setting in self._prepared and now_us <= self._prepared_us:
                return False if self.stands(now_us) else NOT_DOWN
            if allow_list.is_of_fence(frame, self._types):
                return AFTER_START if self._started or self._armed else False
            if setting is not None:
                return NOT_LISTED
        # 4. what is permitted now
        return self._refuse_permitted(frame, now_us) or True

    def _refuse_permitted(self, frame: Frame, now_us: int) -> Refusal | None:
        """Why a frame is neither a command to payload nor part of the motion that is permitted now."""
        payload = read_payload(frame)
        if payload is not None:
            return self._refuse_payload(payload, now_us)
        if frame.target is not None and frame.target[1] != AUTOPILOT:
            return WRONG_TARGET
        return self._refuse_motion(frame, now_us)

    def _refuse_always(self, frame: Frame) -> Refusal | None:
        """Why no permit could allow a frame; None if one could."""
        if (frame.system, frame.component) != (self._system, OURS):
            return NOT_OURS
        if frame.target is not None and not self._is_for(frame.message, *frame.target):
            camera = frame.target[0] == self._system and allow_list.asks_camera(frame)
            return None if camera else WRONG_TARGET
        return FORCED_ARMING if allow_list.is_forced_arming(frame) else None

    def _is_for(self, message: int, system: int, component: int) -> bool:
        """Whether the addressee is the autopilot, or of a command also a camera or a gimbal of the vehicle."""
        if system != self._system:
            return False
        return component == AUTOPILOT or (message == COMMAND_LONG and self._payload.has(component))

    def _refuse_payload(self, payload: PayloadNumbers, now_us: int) -> Refusal | None:
        refused = self._payload.refuse(payload, now_us, self._autopilot, self._home_amsl)
        if refused is None:
            self.let_out = True
        return refused

    def _refuse_ahead(self, octets: bytes, command: Command) -> Refusal | None:
        """Why a frame is not signed ahead for a command: the rules of the gate, as if it were open for the command."""
        frame = read_frame(octets)
        if frame is None:
            return NOT_ONE_FRAME
        if not self._system:
            return NO_VEHICLE
        refused = self._refuse_always(frame)
        if refused is not None:
            return refused
        if frame.target is not None and frame.target[1] != AUTOPILOT:
            return WRONG_TARGET
        if not allow_list.carries_out(frame, command, self._autopilot, self._home_amsl):
            return NOT_COVERED
        if allow_list.point_of(frame) is None or allow_list.leads_to(frame, command, 0, self._home_amsl):
            return None
        return OUT_OF_ORDER  # the others wait until the vehicle is there

    def _refuse_motion(self, frame: Frame, now_us: int) -> Refusal | None:
        session = self._session
        if session is None:
            return NO_SESSION
        if not allow_list.carries_out(frame, session.command, self._autopilot, self._home_amsl):
            return NOT_COVERED
        if not session.begun and now_us > session.command.not_after_us:
            return LATE
        if allow_list.point_of(frame) is not None:
            there = session.leg < 0 or self._is_at(session.command, session.leg)  # else it would cut the corner
            legs = (session.leg, session.leg + 1) if there else (session.leg,)
            turn = [leg for leg in legs if allow_list.leads_to(frame, session.command, leg, self._home_amsl)]
            if not turn:
                return OUT_OF_ORDER
            session.leg = turn[0]
        session.begun = self.let_out = True
        return None

    def _is_at(self, command: Command, number: int) -> bool:
        """Whether the vehicle is close enough to a point of the path for the next leg to begin."""
        latitude, longitude = command.geo[2 * number : 2 * number + 2]
        level = not command.heights or abs(self._above_home - command.heights[number]) <= allow_list.NEAR_LEVEL
        return level and allow_list.is_near(self._here, (latitude, longitude))
