"""What brings the vehicle down when the boundary is lost in flight: the frames of links that standing permits are good
for, signed ahead while it was there (docs/adr/0075).

The boundary signs them with timestamps half a minute above those of what it signs now, in the order of the links. An
autopilot takes a frame only if its timestamp is above that of the one before: so what is signed ahead is good once
nothing more is signed, in this order alone, and void as soon as what is signed has come that far. It is therefore
signed anew before.
"""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.framing import FLAG_SIGNED, with_flags
from rtshcua.mavlink.layouts import COMMAND_INT, COMMAND_LONG, LAYOUTS, SET_POSITION_TARGET_GLOBAL_INT
from rtshcua.mavlink.signing import LEAD, timestamp_in
from rtshcua.onboard.enforcement.allow_list import Frame, read_frame
from rtshcua.onboard.enforcement.executor import Commands, SignedAhead
from rtshcua.onboard.ports import Command
from rtshcua.wire.request import FALLBACK_LINK

#: how often frames are signed ahead, in us: half as long as they are good
EVERY_US: Final = 15_000_000
#: and after nothing could be signed
_AGAIN_US: Final = 1_000_000
#: how often the last link of the contingency is signed: as often as a run that is left alone meanwhile may send it
LAST: Final = 12
#: frames of one link at most (`RT_MOST_AHEAD` in boundary/enforcement/calls.h)
MOST: Final = 128

NOT_AHEAD: Final = Refusal("permit/not-ahead", "the boundary is lost, and this link was not signed ahead")
NO_COPY: Final = Refusal("frame/not-ahead", "the boundary is lost, and no copy is left that was signed of this frame")

#: makes the frames that a command is flown by, each as often as it may have to be sent
Encode = Callable[[Command], Sequence[bytes]]
#: has the frames of a link signed: the standing permit, kind and number of the link, its frames, and the time
Sign = Callable[[bytes, int, int, Sequence[bytes], int], SignedAhead | Refusal]

# what differs between two frames that do the same of one command: where home is taken to lie, how often one was sent,
# and our time
_FREE: Final = {COMMAND_LONG: ("param7", "confirmation"), COMMAND_INT: ("z",)}
_FREE[SET_POSITION_TARGET_GLOBAL_INT] = ("alt", "time_boot_ms")
_BLANK: Final = {number: tuple(map(LAYOUTS[number].at, names)) for number, names in _FREE.items()}


def _does(frame: Frame) -> bytes:
    """What a frame does, of one command."""
    fields = list(frame.fields)
    for at in _BLANK.get(frame.message, ()):
        fields[at] = 0
    return frame.message.to_bytes(3) + LAYOUTS[frame.message].fields.pack(*fields)


class _Copy(NamedTuple):
    """A frame as it may be sent once, what it does, and its timestamp; 0 on a link without a key."""

    does: bytes
    octets: bytes
    timestamp: int


class _Link(NamedTuple):
    """A link that was signed ahead: `step` whose chain it is of, -1 for the contingency, and its command's token."""

    kind: int
    step: int
    number: int
    token: int
    copies: tuple[_Copy, ...]


class FramesAhead:
    """The frames that were signed ahead, of the step that was sent last. `sent` and `due` while the boundary is there,
    `begin`, `take` and `close` when it is lost. They go forward only.
    """

    def __init__(self, commands: Commands, sign: Sign) -> None:
        self._commands = commands
        self._sign = sign
        self._standing: tuple[bytes, int] | None = None  # the permit of the step, and its number
        self._links: list[_Link] = []
        self._before: tuple[bytes, int] | None = None  # that of the step before it
        self._due_us = 0
        self._tried_us = 0  # when it was last tried to sign
        self._begins = False  # nothing was signed yet of what stands behind the step
        self._latest = 0  # timestamp of what was signed last for now
        self._next = 0  # the first link that may be begun,
        self._at = -1  # the last that was,
        self._again = 0  # how often it was begun before,
        self._used = 0  # and how many of its copies were used
        self._open = False

    # -------------------------------------------------------- while the boundary is there

    def stands(self, sealed: bytes, step: int) -> None:
        """A step was sent by this permit: what stands behind it is signed when it begins. Not before, for a step that
        comes too late is decided again only if nothing that may be sent was signed by then.
        """
        self._before = self._standing
        self._standing, self._due_us, self._begins = (sealed, step), 0, True

    def withdrawn(self, sealed: bytes) -> None:
        """Nothing was sent of a step by this permit, and nothing will be: what stood before it stands."""
        if self._standing is not None and self._standing[0] == sealed:
            self._standing, self._due_us, self._begins = self._before, 0, False

    def flown(self) -> None:
        """A link was sent: those behind it are signed anew."""
        self._due_us, self._begins = 0, False

    def lapse(self) -> None:
        """The vehicle landed: nothing stands any more."""
        self._standing = None
        self._put([])

    def sent(self, octets: bytes) -> None:
        """A signed frame leaves: what was signed ahead is void from its timestamp on."""
        self._latest = timestamp_in(octets)

    def renew(self, encode: Encode, now_us: int, *, begins: bool = False) -> Sequence[str]:
        """Have signed what is due; of links that could not be, why, in words. `begins`: a step is about to begin, and
        nothing but what it needs is signed; else nothing before it did.
        """
        if self._standing is None or begins is not self._begins:
            return ()
        is_short = self._is_short() and now_us >= self._tried_us + _AGAIN_US
        if now_us < self._due_us and not is_short:
            return ()
        self._begins, self._tried_us = False, now_us
        sealed, step = self._standing
        links: list[_Link] = []
        notes: list[str] = []
        of_step = self._commands.links(step)
        for kind, number in of_step:
            its = step if kind == FALLBACK_LINK else -1
            command = self._commands.command(kind, its, number, 0)
            frames = encode(command)
            if not frames:
                notes.append(f"`{command.skill}` cannot be signed ahead: how it is flown is not known")
                continue
            if len(frames) > MOST:
                notes.append(f"`{command.skill}` cannot be signed ahead: {len(frames)} frames, {MOST} at most")
                continue
            if (kind, number) == of_step[-1]:
                frames = [*frames] * min(LAST, MOST // len(frames))
            answer = self._sign(sealed, kind, number, frames, now_us)
            if not isinstance(answer, Refusal):
                copies = tuple(map(_copied, frames, answer.signatures))
                links.append(_Link(kind, its, number, answer.token, copies))
            elif answer.slug.startswith("frame/"):
                notes.append(f"`{command.skill}` cannot be signed ahead: {answer.slug}")
        self._due_us = now_us + (EVERY_US if links else _AGAIN_US)
        if links:
            self._put(links)
        return notes

    def _put(self, links: list[_Link]) -> None:
        self._links, self._next, self._at, self._open = links, 0, -1, False

    def _is_short(self) -> bool:
        """Whether what is signed now comes near what was signed ahead, for time ran faster than ours."""
        first = self._links[0].copies[0].timestamp if self._links else 0
        return bool(first) and first - self._latest < LEAD // 3

    # -------------------------------------------------------- when it is lost

    def begin(self, kind: int, number: int) -> Command | None:
        """The command of a link that was signed ahead and not flown yet; None where there is none. The last link may be
        flown again, as far as its copies go.
        """
        step = self._standing[1] if self._standing is not None and kind == FALLBACK_LINK else -1
        for at in range(self._next, len(self._links)):
            link = self._links[at]
            if (link.kind, link.step, link.number) == (kind, step, number):
                self._again, self._used = (self._again + 1, self._used) if at == self._at else (0, 0)
                self._at, self._next, self._open = at, min(at + 1, len(self._links) - 1), True
                return self._commands.command(kind, step, number, self._token)
        return None

    def take(self, frame: Frame) -> bytes | Refusal:
        """A copy of a frame of the link that flies, each once."""
        does = _does(frame)
        copies = self._links[self._at].copies if self._open else ()
        for number in range(self._used, len(copies)):
            copy = copies[number]
            if copy.does == does and (not copy.timestamp or copy.timestamp > self._latest):
                self._used = number + 1
                return copy.octets
        return NO_COPY

    def ended(self, token: int | None) -> None:
        """The command of this token ended, or whatever flies."""
        if self._open and token in (None, self._token):
            self.close()

    def close(self) -> None:
        """Nothing more leaves, unless another link is begun."""
        self._open = False

    @property
    def _token(self) -> int:
        return self._links[self._at].token + self._again


def _copied(frame: bytes, signature: bytes) -> _Copy:
    """A frame as it may be sent, once it was signed."""
    read = read_frame(frame)
    assert read is not None, "the boundary takes nothing else"
    if not signature:
        return _Copy(_does(read), frame, 0)
    octets = with_flags(frame, FLAG_SIGNED) + signature
    return _Copy(_does(read), octets, timestamp_in(octets))
