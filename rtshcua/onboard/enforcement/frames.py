"""The frame session: what of MAVLink 2 may leave for the vehicle, octet by octet (design 4.5, mediated dispatch).

Every frame that an adapter wants to send goes through `seal`, and only what `seal` gives back may be sent. A permit
that the executor dispatches opens a session for its one command; until that command ends, frames that carry it out
pass, no others. A preparation opens it for the parameters that it lists, each with its value, on the ground alone.
Housekeeping passes always. Whatever is on neither list (`allow_list`) is refused. With a signer each
frame that passes is signed; the key is the signer's, and nothing else can use it. Frames that carry out a command are
chained as they pass, without their signature (`wire.boundary_chain`), and what is refused is counted there. The others
are not: they move nothing, heartbeats and questions are most of what is sent, and parameters have a permit each.

A rule needs to know which autopilot it speaks to and how high its home lies. Both are read here from frames that came
in (`observe`), never asked of the adapter that wants to send. With a key, those frames were verified first.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink import enums
from rtshcua.mavlink.framing import SIGNATURE
from rtshcua.mavlink.layouts import EXTENDED_SYS_STATE, GLOBAL_POSITION_INT, HEARTBEAT, LAYOUTS, PARAM_VALUE
from rtshcua.mavlink.modes import is_vehicle
from rtshcua.mavlink.parameters import is_bytewise, value_of
from rtshcua.mavlink.signing import SignedLink
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement import allow_list
from rtshcua.onboard.enforcement.allow_list import Frame, read_frame
from rtshcua.onboard.ports import Command
from rtshcua.wire.boundary_chain import BoundaryChain
from rtshcua.wire.preparation import ParameterWrite

#: who we are, in the vehicle's own system, and whom we speak to
OURS: Final = enums.MAV_COMP_ID_ONBOARD_COMPUTER
AUTOPILOT: Final = enums.MAV_COMP_ID_AUTOPILOT1
#: mm: how far home's height above sea may be reported from where it lay when the takeoff was permitted: arming sets
#: home anew, and it moves by what GPS heights drift. A report further off counts for nothing, for every height that is
#: sent above sea would move with it.
HOME_MOVES: Final = 10_000

#: us: how old a heartbeat, and a word of the ground, may be of a vehicle that counts as standing there
STANDS_US: Final = 3_000_000

_LANDED: Final = LAYOUTS[EXTENDED_SYS_STATE].at("landed_state")
_identity: Final = LAYOUTS[HEARTBEAT].getter("type autopilot")
_BASE_MODE: Final = LAYOUTS[HEARTBEAT].at("base_mode")
_position: Final = LAYOUTS[GLOBAL_POSITION_INT].getter("lat lon alt relative_alt")

# why a frame does not leave
NOT_ONE_FRAME: Final = Refusal("frame/not-one-frame", "it is not exactly one whole, unsigned MAVLink 2 frame")
NO_VEHICLE: Final = Refusal("frame/no-vehicle", "no autopilot was heard yet")
NOT_OURS: Final = Refusal("frame/not-ours", "it claims another sender")
WRONG_TARGET: Final = Refusal("frame/wrong-target", "it is to another system or component, or to everybody")
FORCED_ARMING: Final = Refusal("frame/forced-arming", "it arms or disarms past the autopilot's own checks")
AFTER_START: Final = Refusal(
    "frame/after-start", "it is about a fence, once anything flew or while the motors are armed"
)
NOT_LISTED: Final = Refusal("frame/not-listed", "it sets a parameter to what no preparation lists")
NOT_DOWN: Final = Refusal(
    "frame/not-down", "it sets a parameter of a vehicle that flies, is armed, or is not known to stand on the ground"
)
SESSION_OVER: Final = Refusal("frame/session-over", "the boundary signed that its session ends here")
NO_SESSION: Final = Refusal("frame/no-session", "it moves the vehicle, and nothing that was permitted does so now")
NOT_COVERED: Final = Refusal("frame/not-covered", "it is no part of the command that was permitted")
#: the leg there was never checked
OUT_OF_ORDER: Final = Refusal("frame/out-of-order", "it is to a point of the path before its turn")
#: not sent, and nothing failed by that
UNSIGNED: Final = Refusal("frame/unsigned", "it moves nothing, and nobody is there any more to sign it")
TOO_MANY_AHEAD: Final = Refusal("frame/too-many-ahead", "more frames were signed ahead than any link needs")
LATE: Final = Refusal("frame/late", "it is the command's first frame, after its permit's time")


class Gate(Protocol):
    """What an adapter gets of a `FrameSession`: it may ask, and tell what it heard. It opens nothing."""

    @property
    def may_be_lost(self) -> bool:
        """Whether it may stop answering in a flight: only then is it ever mute, or signs anything ahead."""
        ...

    def observe(self, frame: bytes, now_us: int = 0) -> None:
        """Take in one good frame from the link, at a monotonic time; without one, it is too old for what has to be
        recent.
        """
        ...

    def seal(self, frame: bytes, now_us: int) -> bytes | Refusal:
        """The octets to send for a frame, or why it is not sent."""
        ...

    @property
    def is_mute(self) -> bool:
        """Whether nothing leaves any more but what was signed ahead: no question is asked, so none is answered."""
        ...

    def renew_ahead(self, encode: Callable[[Command], Sequence[bytes]], now_us: int, *, begins: bool) -> Sequence[str]:
        """Have signed ahead what is due, where there may be a need for it; why something is not, in words. `encode`
        makes the frames that a command is flown by, each as often as it may have to be sent. `begins`: nothing but what
        a step needs that is about to begin.
        """
        ...


@dataclass(slots=True)
class _Session:
    """One permitted command, and how far it got."""

    command: Command
    begun: bool = False  # a frame of it left
    leg: int = -1  # the last point of its path that was sent


class FrameSession:
    """The gate that frames leave by. Opened and closed by the executor alone."""

    #: this gate is there as long as who sends by it
    may_be_lost = is_mute = False

    def __init__(self) -> None:
        #: where what leaves is chained
        self.chain = BoundaryChain()
        self._signer: SignedLink | None = None
        self._session: _Session | None = None
        #: whether a frame left, or was signed ahead, since a command was permitted last
        self.let_out = False
        self._here: tuple[int, int] | None = None  # 1e-7 degree
        self._started = False  # a session was opened: fences stay as they are
        self._system = 0
        self._autopilot = 0  # MAV_AUTOPILOT
        self._kind = 0  # MAV_TYPE
        self._armed = False  # as its last heartbeat says,
        self._armed_us = 0  # and when it came
        self._stands_us = 0  # it last said that it is on the ground; 0 once it said otherwise
        self._types: float | None = None  # FENCE_TYPE
        self._prepared: frozenset[tuple[str, int | None]] = frozenset()  # parameters that may be set, and to what,
        self._prepared_us = 0  # up to when
        self._home_amsl: int | None = None  # mm
        self._settled_amsl: int | None = None  # the same, when the takeoff was permitted

    def sign_with(self, signer: SignedLink) -> None:
        """Sign what leaves from now on. Raises RuntimeError if it is signed already: a key is not taken away."""
        if self._signer is not None:
            raise RuntimeError("this link is signed already")
        self._signer = signer

    def open(self, command: Command) -> None:
        """Let out the frames of one command, in place of whatever was let out before."""
        self._session, self._started, self.let_out = _Session(command), True, False
        self.prepared()
        if self._settled_amsl is None or command.kind == MotionKind.CLIMB:
            self._settled_amsl = self._home_amsl

    def close(self) -> None:
        """Let out nothing more that moves the vehicle."""
        self._session = None

    def prepare(self, writes: Iterable[ParameterWrite], not_after_us: int) -> None:
        """Let these parameters be set, as long as the vehicle stands on the ground."""
        self._prepared = frozenset((each.name, each.value) for each in writes)
        self._prepared_us = not_after_us

    def prepared(self) -> None:
        """Let no parameter be set any more."""
        self._prepared = frozenset()

    def stands(self, now_us: int) -> bool:
        """Whether it is known to be on the ground, disarmed, and nothing that was permitted is under way."""
        recent = min(self._armed_us, self._stands_us) > max(0, now_us - STANDS_US)
        return recent and not self._armed and self._session is None

    def observe(self, frame: bytes, now_us: int = 0) -> None:
        """Take in one good frame from the link. The first heartbeat of a vehicle whose autopilot is known settles
        whose; from then on one that names another kind of vehicle or autopilot, under the same ids, says nothing of it.
        """
        heard = read_frame(frame)
        if heard is None or heard.component != AUTOPILOT:
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
            self._here = latitude, longitude
            home_amsl, settled = amsl - above_home, self._settled_amsl  # mm
            if settled is None or abs(home_amsl - settled) <= HOME_MOVES:
                self._home_amsl = home_amsl
        elif heard.message == EXTENDED_SYS_STATE and heard.system == self._system:
            self._stands_us = now_us if heard.fields[_LANDED] == enums.MAV_LANDED_STATE_ON_GROUND else 0
        elif heard.message == PARAM_VALUE and heard.system == self._system:
            name, bits = allow_list.told(heard, bytewise=is_bytewise(self._autopilot))
            if name == "FENCE_TYPE":
                self._types = 0.0 if bits is None else value_of(bits)

    def seal(self, frame: bytes, now_us: int) -> bytes | Refusal:
        """The octets to send for a frame at a monotonic time, or why it is not sent."""
        judged = self._judge(frame, now_us)
        if isinstance(judged, Refusal):
            self.chain.stop(frame)
            return judged
        sealed = frame if self._signer is None else self._signer.sign(frame, now_us)
        if judged:
            self.chain.leave(frame)
        return sealed

    def renew_ahead(self, encode: Callable[[Command], Sequence[bytes]], now_us: int, *, begins: bool) -> Sequence[str]:
        """Nothing: see `may_be_lost`."""
        return ()

    def sign_ahead(self, frame: bytes, command: Command, now_us: int) -> bytes | Refusal:
        """Sign a frame of a command ahead, to be sent only when no boundary is there any more: its signature,
        none without a key; or why not. The gate stays as it is.
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
        """Why a frame does not leave, or else whether it carries out a command."""
        # 1. it is what it will be taken for: one frame, from us, to the autopilot that was heard, and to nobody else
        frame = read_frame(octets)
        if frame is None:
            return NOT_ONE_FRAME
        if not self._system:  # a vehicle may wait to be spoken to; what we are is all that it is told then
            return False if allow_list.is_greeting(frame) and frame.component == OURS else NO_VEHICLE
        # 2. never, whatever is permitted
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
        return self._refuse_motion(frame, now_us) or True

    def _refuse_always(self, frame: Frame) -> Refusal | None:
        """What no frame may be, whatever is permitted."""
        if (frame.system, frame.component) != (self._system, OURS):
            return NOT_OURS
        if frame.target is not None and frame.target != (self._system, AUTOPILOT):
            return WRONG_TARGET
        return FORCED_ARMING if allow_list.is_forced_arming(frame) else None

    def _refuse_ahead(self, octets: bytes, command: Command) -> Refusal | None:
        """Why a frame is not signed ahead for a command: as at the gate, if that were open for it."""
        frame = read_frame(octets)
        if frame is None:
            return NOT_ONE_FRAME
        if not self._system:
            return NO_VEHICLE
        refused = self._refuse_always(frame)
        if refused is not None:
            return refused
        if not allow_list.carries_out(frame, command, self._autopilot, self._home_amsl):
            return NOT_COVERED
        point = allow_list.point_of(frame)  # the others wait until the vehicle is there
        return None if point is None or point == command.geo[:2] else OUT_OF_ORDER

    def _refuse_motion(self, frame: Frame, now_us: int) -> Refusal | None:
        session = self._session
        if session is None:
            return NO_SESSION
        if not allow_list.carries_out(frame, session.command, self._autopilot, self._home_amsl):
            return NOT_COVERED
        if not session.begun and now_us > session.command.not_after_us:
            return LATE
        point = allow_list.point_of(frame)
        if point is not None:
            path = tuple(zip(session.command.geo[::2], session.command.geo[1::2], strict=True))
            there = session.leg < 0 or allow_list.is_near(self._here, path[session.leg])  # else it would cut the corner
            legs = (session.leg, session.leg + 1) if there else (session.leg,)
            turn = [leg for leg in legs if 0 <= leg < len(path) and path[leg] == point]
            if not turn:
                return OUT_OF_ORDER
            session.leg = turn[0]
        session.begun = self.let_out = True
        return None
