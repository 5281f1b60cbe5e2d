"""The executor: the only place that turns a permit into a command to send (design section 4.5, mediated dispatch).

The command of a permit's kind, step and link is looked up in `Commands`, which are made from verified parts only.
The executor checks, in this order: the MAC; that the permit was not used; that it is not late; that a standing
permit's step is still the one that flies; that a step waits for its turn, and never follows a recall, or a return
or a landing that a fallback began; that chains only go forward; and that fewer than `MAX_DISPATCHED` were sent. A
standing permit is valid once for each of its links, and `AGAIN` times more for the last one of the contingency.
The executor chains what it sends and what it refuses (`wire.boundary_chain`). The permit of a step of which no
frame was sent may be withdrawn: it becomes invalid, and the step may be decided again.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import PLACE, Contract, Link, MotionKind
from rtshcua.model.flat.limits import MAX_DISPATCHED
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import unproject
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.enforcement.payload_gate import payload_of
from rtshcua.onboard.ports import ALWAYS, Command, PayloadFrame
from rtshcua.wire import boundary_chain
from rtshcua.wire.boundary_chain import BoundaryChain, Tag
from rtshcua.wire.permit import AGAIN, WITHDRAWN, Permit, open_permit
from rtshcua.wire.preparation import Preparation, open_preparation
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, FALLBACK_LINK, STEP

#: a command without its token, and until when it may be sent
_Made = tuple[
    str, int, tuple[int, ...], tuple[int, ...], int, int, int, bool, tuple[int, ...], tuple[int, ...],
    tuple[PayloadFrame, ...], tuple[int, ...],
]  # fmt: skip
#: the commands of a mission, by kind, step and link
Made = dict[tuple[int, int, int], _Made]

_HOMEWARD = (MotionKind.HOME, MotionKind.LAND)
_UNTOUCHED = DEGRADE - 1

# reasons why a permit is refused
FORGED: Final = Refusal("permit/forged", "the permit is not sealed with the key of this session")
USED: Final = Refusal("permit/used", "the permit was already used")
SESSION_OVER: Final = Refusal("permit/session-over", "the boundary signed that its session ends here")
LATE: Final = Refusal("permit/late", "the permit has expired")
NOT_COVERED: Final = Refusal("permit/not-covered", "the link is not covered by this permit")
LAPSED: Final = Refusal("permit/lapsed", "the standing permit's step is over, or its flight has landed")
OUT_OF_TURN: Final = Refusal("permit/out-of-turn", "the step is out of turn: another one runs, or a later one was sent")
MISSION_OVER: Final = Refusal("permit/mission-over", "a return or a landing began, or the mission was called off")
NOT_DOWN: Final = Refusal("permit/not-down", "the vehicle is not known to be on the ground and disarmed")
BACKWARDS: Final = Refusal("permit/backwards", "the link precedes the one that was flown")
# the results of a withdrawal
UNSENT: Final = Refusal(WITHDRAWN, "nothing was sent by the permit and nothing will be: its step may be decided again")
SENT: Final = Refusal("permit/sent", "something may have been sent by the permit, or its step is no longer current")


class SignedAhead(NamedTuple):
    """A link that was signed ahead: the token of its command, and the signature of each frame, empty without a key."""

    token: int
    signatures: tuple[bytes, ...]


class Commands:
    """Looks up the command of a step or a link.

    `called_off` says that no further step may be sent. Only the boundary changes it, and the steps.
    """

    def __init__(self, policy: Policy, mission: Mission) -> None:
        self.called_off = False
        self._policy = policy
        self._contingency = policy.contingency
        # one for each rule and not for each step: there may be thousands of both
        rules = enumerate(policy.rules)
        self._targets = {-1 - rule: self._of_link(each.target) for rule, each in rules if each.target is not None}
        self._made = self.made(mission)

    def replace(self, mission: Mission, made: Made | None = None) -> None:
        """Set the steps. All commands are made now, because a fallback must not wait for it; or they were `made` for
        this mission before.
        """
        self._made = self.made(mission) if made is None else made

    def made(self, mission: Mission) -> Made:
        """Make the commands of a mission, in any thread."""
        made = {(CONTINGENCY_LINK, -1, number): self._of_link(link) for number, link in enumerate(self._contingency)}
        for step, invocation in enumerate(mission.invocations):
            made[STEP, step, -1] = self._of_step(invocation)
            for number, link in enumerate(invocation.contract.fallback):
                made[FALLBACK_LINK, step, number] = self._of_link(link)
        return made

    def command(self, kind: int, step: int, link: int, token: int, not_after_us: int = ALWAYS) -> Command:
        """The command with the token of its permit, and until when it is valid.

        A `link` of `-1 - rule` is the target of that degrade rule. Raises `LookupError` for a command that is not
        in the bundle.
        """
        if kind == STEP:
            return _command(token, self._made[STEP, step, -1], not_after_us)
        if kind == FALLBACK_LINK and link < 0 and (STEP, step, -1) in self._made:
            return _command(token, self._targets[link], not_after_us)
        return _command(token, self._made[kind, step if kind == FALLBACK_LINK else -1, link], not_after_us)

    def links(self, step: int) -> list[tuple[int, int]]:
        """Kind and number of each link behind a step: its chain, then the contingency."""
        chain = [(kind, link) for kind, its, link in self._made if kind == FALLBACK_LINK and its == step]
        return sorted(chain) + sorted((kind, link) for kind, _, link in self._made if kind == CONTINGENCY_LINK)

    def _of_step(self, invocation: Invocation) -> _Made:
        plan, contract = invocation.plan, invocation.contract
        held_us = _hold_us(contract, invocation.arguments)
        payload = payload_of(contract, invocation.arguments, len(plan.path) // 2, self._policy)
        return (
            contract.name, plan.kind, plan.path, self._geo(plan.path), plan.altitude, plan.speed, held_us, True,
            plan.heights, plan.headings, payload, self._policy.vehicle.servos,
        )  # fmt: skip

    def _of_link(self, link: Link) -> _Made:
        contract = self._policy.contracts[link.skill]
        motion = contract.motion
        path: tuple[int, ...] = ()
        if motion.kind == MotionKind.FLY:
            cell = next(parameter.cell for parameter in contract.parameters if parameter.kind == PLACE)
            path = link.arguments[cell : cell + 2]
        altitude, speed = (link.arguments[cell] if cell >= 0 else 0 for cell in (motion.altitude, motion.speed))
        held_us = 0 if link.limit_us else _hold_us(contract, link.arguments)  # the link's own time counts
        return contract.name, motion.kind, path, self._geo(path), altitude, speed, held_us, False, (), (), (), ()

    def _geo(self, path: Sequence[int]) -> tuple[int, ...]:
        projection = self._policy.projection
        return tuple([part for x, y in zip(path[::2], path[1::2], strict=True) for part in unproject(projection, x, y)])


def _command(token: int, made: _Made, not_after_us: int) -> Command:
    """The command of a token, valid until a time."""
    return Command(token, *made[:10], not_after_us, *made[10:])


def _hold_us(contract: Contract, arguments: tuple[int, ...]) -> int:
    """How long a skill holds (`hold for time`), 0 if not given."""
    return arguments[contract.motion.time] if contract.motion.time >= 0 else 0


def never(_: int) -> bool:
    """The default `give_back`: no id is released."""
    return False


class Executor:
    """Checks permits under the session key and remembers what was sent.

    `frames` is the gate that the vehicle's adapter sends through: it lets the frames of the last dispatched
    command pass. `give_back` releases the id of a step of which nothing was sent (`Session.give_back`); by default
    none is released.
    """

    def __init__(
        self, key: bytes, commands: Commands, chain: BoundaryChain | None = None,
        give_back: Callable[[int], bool] = never,
    ) -> None:  # fmt: skip
        self._key = key
        self._commands = commands
        self._give_back = give_back
        self._chain = chain or BoundaryChain()
        self._frames = FrameSession()
        self._frames.chain = self._chain
        self._used: set[int] = set()
        self._prepared: set[int] = set()  # the serials of preparations that were begun
        self._step = -1  # the last step that was sent,
        self._serial = 0  # its permit,
        self._running = False  # and whether it still runs
        self._before = (-1, 0)  # the step that was sent before it, and its permit
        self._last = 0  # the last dispatched permit, for a step or a link
        self._flight: int | None = None  # the first step permit of this flight
        self._fallback = (-1, _UNTOUCHED)  # the step whose chain was last in use, and the last link that was sent
        self._contingency = _UNTOUCHED  # the last link of the contingency that was sent
        self._homeward = False  # a link began a return or a landing,
        self._final = False  # and it was one of the contingency

    @property
    def frames(self) -> FrameSession:
        """The gate."""
        return self._frames

    @frames.setter
    def frames(self, frames: FrameSession) -> None:
        """Replace the gate; the frames that it lets pass are chained here."""
        frames.chain = self._chain
        self._frames = frames

    def dispatch(self, sealed: bytes, now_us: int) -> Command | Refusal:
        """The command of a permit at a monotonic time, or why it is refused."""
        permit = self._open(sealed)
        return self._chained(FORGED if permit is None else self._dispatch(permit, now_us), now_us)

    def stand_in(self, sealed: bytes, kind: int, link: int, now_us: int) -> Command | Refusal:
        """The command of a link, by the standing permit of a step that was sent, or why it is refused."""
        return self._chained(self._stand_in(sealed, kind, link, now_us), now_us)

    def withdraw(self, sealed: bytes, now_us: int) -> Refusal:
        """Withdraw the permit of a step. Returns `UNSENT` if no frame of it was or can have been sent, else why it is
        not withdrawn. The step may then be decided again, and the permit covers no link any more.
        """
        permit = self._open(sealed)
        refused = FORGED if permit is None else self._withdraw(permit)
        self._chain.add(Tag.REFUSED, boundary_chain.refused(refused.slug, now_us))
        return refused

    def _withdraw(self, permit: Permit) -> Refusal:
        if self._chain.over:
            return SESSION_OVER
        if permit.kind != STEP:
            return SENT
        used = permit.serial in self._used
        if used and not permit.serial == self._serial == self._last:
            return SENT
        if (self._frames.let_out if used else permit.step <= self._step) or len(self._used) == MAX_DISPATCHED:
            return SENT
        if not self._give_back(permit.step):
            return SENT
        self._used.add(permit.serial)
        if used:
            self._step, self._serial = self._before
            self._running = False
            self._flight = None if self._flight == permit.serial else self._flight
            self._frames.close()
        return UNSENT

    def _chained(self, found: Command | Refusal, now_us: int) -> Command | Refusal:
        if isinstance(found, Refusal):
            self._chain.add(Tag.REFUSED, boundary_chain.refused(found.slug, now_us))
        return found

    def _stand_in(self, sealed: bytes, kind: int, link: int, now_us: int) -> Command | Refusal:
        permit = self._standing_for(sealed, kind, link)
        return permit if isinstance(permit, Refusal) else self._dispatch(permit, now_us)

    def _standing_for(self, sealed: bytes, kind: int, link: int) -> Permit | Refusal:
        """The command that a standing permit covers for a link; or why it is refused."""
        permit = self._open(sealed)
        if permit is None:
            return FORGED
        fallback = kind == FALLBACK_LINK
        if not 0 <= link < (permit.fallbacks if fallback else permit.contingencies):
            return NOT_COVERED
        if permit.kind != STEP or self._lapsed(permit, fallback=fallback):
            return LAPSED
        step = permit.step if fallback else -1
        serial = permit.serial + 1 + link + (0 if fallback else permit.fallbacks)
        if not fallback and link == permit.contingencies - 1:
            again = range(serial, serial + AGAIN)
            serial = next((each for each in again if each not in self._used), serial + AGAIN)
        return Permit(kind, step, link, serial, 0, 0, ALWAYS)

    def ahead(self, sealed: bytes, kind: int, link: int, frames: Sequence[bytes], now_us: int) -> SignedAhead | Refusal:
        """Sign the frames of a link ahead, for use after the loss of the boundary, if the standing permit of a step
        that was sent would let the link fly now and each frame would pass. Nothing is sent or opened.
        """
        permit = self._standing_for(sealed, kind, link)
        refused = permit if isinstance(permit, Refusal) else self._refuse(permit, now_us)
        if isinstance(permit, Refusal) or refused is not None:
            assert refused is not None
            return refused
        command = self._commands.command(permit.kind, permit.step, permit.link, permit.serial)
        signatures: list[bytes] = []
        for frame in frames:
            signature = self._frames.sign_ahead(frame, command, now_us)
            if isinstance(signature, Refusal):
                return signature
            signatures.append(signature)
        return SignedAhead(permit.serial, tuple(signatures))

    def prepare(self, sealed: bytes, now_us: int) -> Preparation | Refusal:
        """The parameters that a preparation permit allows to be set, or why it is refused. The permit is valid once,
        on the ground, until `prepared`, a dispatch, or the end of its time.
        """
        permit = open_preparation(sealed, self._key)
        refused = FORGED if permit is None else self._unprepared(permit, now_us)
        if permit is None or refused is not None:
            assert refused is not None
            self._chain.add(Tag.UNPREPARED, boundary_chain.unprepared(refused.slug))
            return refused
        self._chain.add(Tag.PREPARED, boundary_chain.prepared(permit.writes, restoring=permit.restoring))
        self._prepared.add(permit.serial)
        self._frames.prepare(permit.writes, permit.not_after_us)
        return permit

    def _open(self, sealed: bytes) -> Permit | None:
        return open_permit(sealed, self._key)

    def _unprepared(self, permit: Preparation, now_us: int) -> Refusal | None:
        if self._chain.over:
            return SESSION_OVER
        if permit.serial in self._prepared:
            return USED
        if now_us > permit.not_after_us:
            return LATE
        return None if self._frames.stands(now_us) else NOT_DOWN

    def prepared(self) -> None:
        """The parameters are set, or setting them was given up."""
        self._frames.prepared()

    def _refuse(self, permit: Permit, now_us: int) -> Refusal | None:
        """Why a permit is refused at a monotonic time."""
        if self._chain.over:
            return SESSION_OVER
        if permit.serial in self._used:
            return USED
        if now_us > permit.not_after_us:
            return LATE
        refusal = self._refuse_step(permit) if permit.kind == STEP else self._refuse_link(permit)
        if refusal is None and len(self._used) == MAX_DISPATCHED:
            return NOT_COVERED
        return refusal

    def _dispatch(self, permit: Permit, now_us: int) -> Command | Refusal:
        refusal = self._refuse(permit, now_us)
        if refusal is not None:
            return refusal
        until_us = permit.not_after_us
        command = self._commands.command(permit.kind, permit.step, permit.link, permit.serial, until_us)
        self._used.add(permit.serial)
        if permit.kind == STEP:
            self._before = self._step, self._serial
            self._step, self._serial, self._running = permit.step, permit.serial, True
            self._flight = permit.serial if self._flight is None else self._flight
        else:
            self._follow(permit, command.kind in _HOMEWARD)
        self._last = permit.serial
        payload = boundary_chain.sent(permit.kind, permit.step, permit.link, permit.serial, now_us)
        self._chain.add(Tag.SENT, payload)
        self._frames.open(command)
        return command

    def ended(self, token: int | None = None) -> None:
        """The running step ended in any way: the next one may be sent.

        With a token: that command ended; if another one was dispatched since, that one continues.
        """
        if token in (None, self._last):
            self._running = False
            self._frames.close()

    def landed(self) -> None:
        """The vehicle landed: standing permits lapse."""
        self._running = False
        self._flight = None
        self._frames.close()

    def release(self) -> None:
        """Send nothing more that moves the vehicle, unless another permit is dispatched."""
        self._frames.close()

    def _follow(self, permit: Permit, homeward: bool) -> None:
        self._running = False
        self._homeward = self._homeward or homeward
        if permit.kind == CONTINGENCY_LINK:
            self._contingency = permit.link
            self._final = self._final or homeward
        else:
            self._fallback = (permit.step, _position(permit))

    def _refuse_step(self, permit: Permit) -> Refusal | None:
        if self._homeward or self._commands.called_off:
            return MISSION_OVER
        if self._running or permit.step <= self._step:
            return OUT_OF_TURN
        return None

    def _lapsed(self, permit: Permit, *, fallback: bool) -> bool:
        """Whether a step's permit covers no link any more: not sent, or withdrawn, followed by another step, or
        landed since.
        """
        if self._flight is None or permit.serial not in self._used:
            return True
        return not self._flight <= permit.serial <= self._serial or (fallback and permit.serial != self._serial)

    def _refuse_link(self, permit: Permit) -> Refusal | None:
        if permit.kind == CONTINGENCY_LINK:
            # Holds may be repeated; once the contingency brings the vehicle home or down, it continues from there.
            return BACKWARDS if self._final and permit.link < self._contingency else None
        if permit.step < self._step:
            return LAPSED
        step, last = self._fallback
        if self._final or (permit.step == step and _position(permit) <= last):
            return BACKWARDS
        return None


def _position(permit: Permit) -> int:
    """The position of a fallback permit in its chain: a degrade rule's target comes before the first link."""
    return max(permit.link, DEGRADE)
