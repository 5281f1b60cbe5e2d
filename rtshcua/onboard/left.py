"""What a run that broke off may have left its vehicle doing, by the log that it left.

A run that is begun again in the air has to know whether somebody took the vehicle over while there was no process.
What the vehicle does may be ours if some command that may still be in force makes it do so. The log tells when a
command was allowed, when it was dispatched, and when the vehicle was seen to obey it: until then, those before it may
be in force.
"""

from base64 import b64decode
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, DecisionRecord, Effect, Genesis
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.executor import Commands
from rtshcua.onboard.ports import Command
from rtshcua.wire.permit import WITHDRAWN
from rtshcua.wire.request import DEGRADE, FALLBACK_LINK, Ref

_HOMEWARD: Final = (MotionKind.HOME, MotionKind.LAND)


class CommandInForce(NamedTuple):
    """A command that the vehicle may be carrying out. Its token means nothing.

    `named`: where the vehicle last said that it flies to, told so by it: latitude and longitude in 1e-7 degree, mm
    above mean sea level; None where it said nothing.
    """

    command: Command
    named: tuple[int, int, int] | None = None


class Left(NamedTuple):
    """What the vehicle may be doing if nobody touched it since: any of these; where there is none, it had landed.

    `taken`: what showed that somebody took it over while that run went on; empty where nothing did.
    """

    in_force: tuple[CommandInForce, ...]
    taken: str = ""


def left_by(lines: Iterable[bytes], bundle: bytes, policy: Policy, mission: Mission) -> Left | None:
    """What a run of this bundle, of this policy and mission, left, by the lines of its log as recovery ended it.

    None where that is not known: the log is of another bundle, or cannot be read; nothing was allowed; steps were
    replaced; or it went on from a run before it, and was not seen to be obeyed itself.
    """
    following = _Following(Commands(policy, mission), policy)
    try:
        for number, line in enumerate(lines):
            record = read(line)
            if isinstance(record, Flaw):
                return None
            if number == 0 and not (isinstance(record, Genesis) and b64decode(record.bundle) == bundle):
                return None
            following.take(record)
    except (LookupError, ValueError):  # a step or a link that the bundle does not have, or a target that is none
        return None
    return following.left()


class _Told(NamedTuple):
    """Something that was allowed, as `ref`, and all that it may have been; `sent`: it was dispatched too."""

    ref: Ref
    commands: tuple[Command, ...]
    sent: bool
    named: tuple[int, int, int] | None = None


class _Following:
    """Follows the records of one log."""

    def __init__(self, commands: Commands, policy: Policy) -> None:
        self._commands = commands
        self._policy = policy
        self._told: list[_Told] = []  # what may be in force, the last one last,
        self._known = False  # and whether nothing else may be
        self._replaced = False
        self._taken = ""

    def left(self) -> Left | None:
        """What is left, once the log is over."""
        if self._replaced or not self._known:
            return None
        in_force = [CommandInForce(command, told.named) for told in self._told for command in told.commands]
        return Left(tuple(in_force), self._taken)

    def take(self, record: AnyRecord) -> None:
        """The next record."""
        if isinstance(record, DecisionRecord) and record.outcome == "allow":
            self._add(Ref(record.kind, record.step, record.link), None, sent=False)
        elif isinstance(record, Effect):
            self._happened(record, Ref(record.kind, record.step, record.link))

    def _happened(self, record: Effect, ref: Ref) -> None:
        match record.event:
            case "ready":
                self._known = True
            case "resumed":  # what the run before it had sent is in force
                self._known = False
            case "replacement":
                self._replaced = True
            case "dispatched":
                self._told = [told for told in self._told if told.sent or told.ref != ref]
                self._add(ref, record.detail, sent=True)
            case "refused" if record.detail == WITHDRAWN:  # nothing of it was sent
                self._told = [told for told in self._told if told.ref != ref]
            case "obeyed":
                self._obeyed(ref, _target(record.detail))
            case "succeeded":
                self._obeyed(ref, None, over=True)
            case "landed":
                self._told, self._known = [], True
            case "taken-over" | "crashed":
                self._taken = record.detail

    def _add(self, ref: Ref, skill: str | None, *, sent: bool) -> None:
        self._told.append(_Told(ref, tuple(self._of(ref, skill)), sent))

    def _obeyed(self, ref: Ref, named: tuple[int, int, int] | None, *, over: bool = False) -> None:
        """Nothing is in force any more that was told before; nor is what brought it down."""
        numbers = [number for number, told in enumerate(self._told) if told.sent and told.ref == ref]
        if not numbers:
            return
        told, *later = self._told[numbers[-1] :]
        is_down = over and all(command.kind in _HOMEWARD for command in told.commands)
        self._told = later if is_down else [told._replace(named=named or told.named), *later]
        self._known = True

    def _of(self, ref: Ref, skill: str | None) -> Iterator[Command]:
        """What a step or link does. The target of a degrade rule is recorded by its skill, and only once it is sent."""
        if ref.kind != FALLBACK_LINK or ref.link != DEGRADE:
            yield self._commands.command(*ref, 0)
            return
        contracts, found = self._policy.contracts, False
        for number, rule in enumerate(self._policy.rules):
            if rule.target is not None and skill in (None, contracts[rule.target.skill].name):
                yield self._commands.command(ref.kind, ref.step, DEGRADE - number, 0)
                found = True
        if not found:
            raise LookupError(skill)


def _target(detail: str) -> tuple[int, int, int] | None:
    """The target in the record of what was obeyed."""
    numbers = [int(each) for each in detail.split()]
    return (numbers[0], numbers[1], numbers[2]) if numbers else None
