"""Finds out from its log what an interrupted run may have left its vehicle doing.

A run that starts in the air has to know whether somebody took the vehicle over while no process ran. The vehicle's
motion may be ours if a command that may still be in force explains it. The log shows when a command was allowed,
when it was dispatched, and when the vehicle was observed to obey it: until then, the earlier commands may be in
force.
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
    """A command that the vehicle may be carrying out. Its token has no meaning.

    `named` is the last target that the vehicle reported for this command: latitude and longitude in 1e-7 degree,
    mm above mean sea level; None if it reported none.
    """

    command: Command
    named: tuple[int, int, int] | None = None


class Left(NamedTuple):
    """What the vehicle may be doing if nobody intervened since: any of these commands; with none, it had landed.

    `taken` is the sign of a takeover during that run; empty if there was none.
    """

    in_force: tuple[CommandInForce, ...]
    taken: str = ""


def left_by(lines: Iterable[bytes], bundle: bytes, policy: Policy, mission: Mission) -> Left | None:
    """What a run of this bundle, of this policy and mission, left, from the lines of its recovered log.

    None if unknown: the log is of another bundle, or cannot be read; nothing was allowed; steps were replaced; or
    the run continued an earlier one and was not observed to be obeyed itself.
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
    except (LookupError, ValueError):  # a step, a link or a target that is not in the bundle
        return None
    return following.left()


class _Told(NamedTuple):
    """An allowed request, as `ref`, and all commands that it may have been; `sent`: it was dispatched too."""

    ref: Ref
    commands: tuple[Command, ...]
    sent: bool
    named: tuple[int, int, int] | None = None


class _Following:
    """Follows the records of one log."""

    def __init__(self, commands: Commands, policy: Policy) -> None:
        self._commands = commands
        self._policy = policy
        self._told: list[_Told] = []  # what may be in force, the latest last,
        self._known = False  # and whether nothing else may be
        self._replaced = False
        self._taken = ""

    def left(self) -> Left | None:
        """The result, after the last record."""
        if self._replaced or not self._known:
            return None
        in_force = [CommandInForce(command, told.named) for told in self._told for command in told.commands]
        return Left(tuple(in_force), self._taken)

    def take(self, record: AnyRecord) -> None:
        """Process the next record."""
        if isinstance(record, DecisionRecord) and record.outcome == "allow":
            self._add(Ref(record.kind, record.step, record.link), None, sent=False)
        elif isinstance(record, Effect):
            self._happened(record, Ref(record.kind, record.step, record.link))

    def _happened(self, record: Effect, ref: Ref) -> None:
        match record.event:
            case "ready":
                self._known = True
            case "resumed":  # the command of the run before it is in force
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
        """No earlier command is in force any more, nor the descent that it caused."""
        numbers = [number for number, told in enumerate(self._told) if told.sent and told.ref == ref]
        if not numbers:
            return
        told, *later = self._told[numbers[-1] :]
        is_down = over and all(command.kind in _HOMEWARD for command in told.commands)
        self._told = later if is_down else [told._replace(named=named or told.named), *later]
        self._known = True

    def _of(self, ref: Ref, skill: str | None) -> Iterator[Command]:
        """The command of a step or a link. The target of a degrade rule is recorded by its skill, and only once it is
        sent.
        """
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
    """The target in the record of the obeyed command."""
    numbers = [int(each) for each in detail.split()]
    return (numbers[0], numbers[1], numbers[2]) if numbers else None
