"""Brings the vehicle down if the boundary is lost in flight, with frames of the links behind standing permits that
were signed ahead (docs/adr/0075).

The boundary signs them with timestamps half a minute above the present ones, in the order of the links. An
autopilot accepts a frame only if its timestamp is above that of the previous one. So frames signed ahead are valid
once nothing else is signed, in this order only, and void as soon as the present timestamps reach them. They are
signed anew before that.
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

#: how often frames are signed ahead, in us: half of their validity
EVERY_US: Final = 15_000_000
#: and after an attempt that failed
_AGAIN_US: Final = 1_000_000
#: how often the last link of the contingency is signed: as often as an unattended run may send it
LAST: Final = 12
#: the most frames of one link (`RT_MOST_AHEAD` in boundary/enforcement/calls.h)
MOST: Final = 128

NOT_AHEAD: Final = Refusal("permit/not-ahead", "the boundary is lost, and this link was not signed ahead")
NO_COPY: Final = Refusal("frame/not-ahead", "the boundary is lost, and all signed copies of this frame are used")

#: makes the frames of a command, each as often as it may have to be sent
Encode = Callable[[Command], Sequence[bytes]]
#: signs the frames of a link: the standing permit, kind and number of the link, its frames, and the time
Sign = Callable[[bytes, int, int, Sequence[bytes], int], SignedAhead | Refusal]

# the fields that differ between two equivalent frames of one command: the assumed home, the retry count, and our time
_FREE: Final = {COMMAND_LONG: ("param7", "confirmation"), COMMAND_INT: ("z",)}
_FREE[SET_POSITION_TARGET_GLOBAL_INT] = ("alt", "time_boot_ms")
_BLANK: Final = {number: tuple(map(LAYOUTS[number].at, names)) for number, names in _FREE.items()}


def _does(frame: Frame) -> bytes:
    """The fields of a frame that determine its effect, for one command."""
    fields = list(frame.fields)
    for at in _BLANK.get(frame.message, ()):
        fields[at] = 0
    return frame.message.to_bytes(3) + LAYOUTS[frame.message].fields.pack(*fields)


class _Copy(NamedTuple):
    """A signed frame for a single use, its effect, and its timestamp; 0 on a link without a key."""

    does: bytes
    octets: bytes
    timestamp: int


class _Link(NamedTuple):
    """A link that was signed ahead: `step` owns its chain, -1 for the contingency; and its command's token."""

    kind: int
    step: int
    number: int
    token: int
    copies: tuple[_Copy, ...]


class FramesAhead:
    """The frames that were signed ahead for the last step that was sent. `sent` and `due` apply while the boundary is
    there, `begin`, `take` and `close` after its loss. They only go forward.
    """

    def __init__(self, commands: Commands, sign: Sign, most: int = MOST) -> None:
        """`most`: how many frames are signed in one call at most."""
        self._most = most
        self._commands = commands
        self._sign = sign
        self._standing: tuple[bytes, int] | None = None  # the permit of the step, and its number
        self._links: list[_Link] = []
        self._before: tuple[bytes, int] | None = None  # those of the step before it
        self._due_us = 0
        self._tried_us = 0  # the last attempt to sign
        self._begins = False  # no link behind the step was signed yet
        self._latest = 0  # the last timestamp that was signed for immediate use
        self._next = 0  # the first link that may begin,
        self._at = -1  # the last one that did,
        self._again = 0  # how often it began before,
        self._used = 0  # and how many of its copies were used
        self._open = False

    # -------------------------------------------------------- with a boundary

    def stands(self, sealed: bytes, step: int) -> None:
        """A step was sent by this permit; the links behind it are signed when it begins. Not earlier, because a step
        that comes too late is only decided again if nothing was signed that may be sent.
        """
        self._before = self._standing
        self._standing, self._due_us, self._begins = (sealed, step), 0, True

    def withdrawn(self, sealed: bytes) -> None:
        """Nothing of a step was or will be sent by this permit: the links of the previous step stay valid."""
        if self._standing is not None and self._standing[0] == sealed:
            self._standing, self._due_us, self._begins = self._before, 0, False

    def flown(self) -> None:
        """A link was sent: the links behind it are signed anew."""
        self._due_us, self._begins = 0, False

    def lapse(self) -> None:
        """The vehicle landed: all links lapse."""
        self._standing = None
        self._put([])

    def sent(self, octets: bytes) -> None:
        """A signed frame is sent: it voids the frames signed ahead with timestamps up to its own."""
        self._latest = timestamp_in(octets)

    def renew(self, encode: Encode, now_us: int, *, begins: bool = False) -> Sequence[str]:
        """Have the boundary sign what is due; return the reasons for links that could not be signed. `begins`: a step
        is about to begin, and only the links that it needs are signed; else nothing before it did.
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
                notes.append(f"cannot sign `{command.skill}` ahead: its manoeuvre is unknown")
                continue
            if len(frames) > self._most:
                notes.append(f"cannot sign `{command.skill}` ahead: {len(frames)} frames; the limit is {self._most}")
                continue
            if (kind, number) == of_step[-1]:
                frames = [*frames] * min(LAST, self._most // len(frames))
            answer = self._sign(sealed, kind, number, frames, now_us)
            if not isinstance(answer, Refusal):
                copies = tuple(map(_copied, frames, answer.signatures))
                links.append(_Link(kind, its, number, answer.token, copies))
            elif answer.slug.startswith("frame/"):
                notes.append(f"cannot sign `{command.skill}` ahead: {answer.slug}")
        self._due_us = now_us + (EVERY_US if links else _AGAIN_US)
        if links:
            self._put(links)
        return notes

    def _put(self, links: list[_Link]) -> None:
        self._links, self._next, self._at, self._open = links, 0, -1, False

    def _is_short(self) -> bool:
        """Whether the present timestamps approach those signed ahead, because time advanced faster than ours."""
        first = self._links[0].copies[0].timestamp if self._links else 0
        return bool(first) and first - self._latest < LEAD // 3

    # -------------------------------------------------------- after its loss

    def begin(self, kind: int, number: int) -> Command | None:
        """The command of a link that was signed ahead and has not flown yet; None if there is none. The last link may
        fly again while it has copies.
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
        """A copy of a frame of the link that flies; each is used once."""
        does = _does(frame)
        copies = self._links[self._at].copies if self._open else ()
        for number in range(self._used, len(copies)):
            copy = copies[number]
            if copy.does == does and (not copy.timestamp or copy.timestamp > self._latest):
                self._used = number + 1
                return copy.octets
        return NO_COPY

    def ended(self, token: int | None) -> None:
        """The command of this token ended, or any command that flies."""
        if self._open and token in (None, self._token):
            self.close()

    def close(self) -> None:
        """Send nothing more, unless another link begins."""
        self._open = False

    @property
    def _token(self) -> int:
        return self._links[self._at].token + self._again


def _copied(frame: bytes, signature: bytes) -> _Copy:
    """The frame after the boundary signed it."""
    read = read_frame(frame)
    assert read is not None, "the boundary accepts nothing more"
    if not signature:
        return _Copy(_does(read), frame, 0)
    octets = with_flags(frame, FLAG_SIGNED) + signature
    return _Copy(_does(read), octets, timestamp_in(octets))
