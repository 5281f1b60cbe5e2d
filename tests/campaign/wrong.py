"""Wrong runtimes: the real one with one plausible mistake each. All complete a calm mission.

The number of flights that a campaign needs to find them measures the campaign (docs/flying/wrong-runtimes.md). A
mistake is active only during a flight, not while the flight is judged.

`shows` are strings of a log: if the correct runtime's log of a flight has none of them, the mistake cannot have had an
effect, and the flight need not be repeated.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any, Final, NamedTuple
from unittest.mock import patch

from msgspec.structs import replace

from rtshcua.adapters import loop
from rtshcua.adapters.vehicle import ardupilot as ardupilot
from rtshcua.adapters.vehicle import driver, effects, flavour, manoeuvre, messages, source_time, supervision
from rtshcua.adapters.vehicle import px4 as px4
from rtshcua.adapters.vehicle.flavour import Stage
from rtshcua.campaign.drawing import FLAVOURS
from rtshcua.decision import decide, prepare, situation
from rtshcua.decision.values import TRUE, UNKNOWN
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.modes import Px4Mode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement import allow_list, executor, frames
from rtshcua.onboard.ports import ClockStepped, Crashed
from rtshcua.onboard.runtime import admission, controller, dispatcher, fallback_flight, link, runtime, supervisor
from rtshcua.wire import approval
from rtshcua.wire.document import DocumentError
from rtshcua.wire.request import FALLBACK_LINK, STEP

Patch = tuple[object, str, Callable[[Any], Any]]
_ALWAYS: Final = 1 << 62
#: caches of functions that wrong runtimes replace
_REMEMBERED: Final = (px4._coming_down, ardupilot._coming_down)


class Aimed(NamedTuple):
    """A campaign with only these kinds of faults, on these autopilots."""

    kinds: tuple[str, ...]
    flavours: tuple[str, ...] = FLAVOURS

    @property
    def options(self) -> str:
        """Return the options of `rtshcua campaign`."""
        chosen = () if self.flavours == FLAVOURS else self.flavours
        return " ".join([*(f"--fault {kind}" for kind in self.kinds), *(f"--flavour {each}" for each in chosen)])


@dataclass(frozen=True)
class Wrong:
    """A mistake: its description, and the replaced functions of the correct runtime."""

    name: str
    what: str
    patches: tuple[Patch, ...]
    shows: tuple[bytes, ...] = ()
    """Empty: it may change any flight."""
    flavour: str | None = None
    """The affected autopilot; None: both."""
    aimed: Aimed | None = None
    """The campaign that is aimed at this mistake."""

    @contextmanager
    def made(self) -> Iterator[None]:
        """Make the runtime wrong in this context, and clear caches before and after."""
        with ExitStack() as stack:
            for remembered in _REMEMBERED:
                remembered.cache_clear()
                stack.callback(remembered.cache_clear)
            for owner, name, broken in self.patches:
                stack.enter_context(patch.object(owner, name, broken(vars(owner)[name])))
            yield


def _hover_by_mode(_: Any) -> Any:
    def stop(seen: Any, system: int) -> Stage:
        hold = Px4Mode.HOLD
        message = messages.set_mode(system, hold)
        return Stage(
            message, messages.DO_SET_MODE, effects.in_mode(hold), frozenset({hold}), flavour.MODE_US, powered=True,
            stops=True,
        )  # fmt: skip

    return stop


def _lets_modes_out(of: Any) -> Any:
    def carries_out(frame: Any, command: Any, *about: Any) -> bool:
        return command.kind == MotionKind.HOLD or bool(of(frame, command, *about))

    return carries_out


def _nothing(_: Any) -> Any:
    return lambda self, *given, **more: None


def _no_mode_of_others(of: Any) -> Any:
    def taken_over(self: Any, seen: Any) -> str | None:
        how: str | None = of(self, seen)
        return how if how in ("landing", "another target") else None

    return taken_over


def _no_target_of_others(of: Any) -> Any:
    def is_foreign(self: Any, seen: Any) -> bool:
        of(self, seen)
        return False

    return is_foreign


def _second_link_first(of: Any) -> Any:
    def begin(self: Any, kind: int, step: int, *, holds: bool = True) -> None:
        of(self, kind, step, holds=holds)
        if kind == FALLBACK_LINK:
            self._chain.after = 0

    return begin


def _record_for(needed: bool) -> Any:
    def broken(of: Any) -> Any:
        def dispatch(self: Any, permit: Any, now_us: int) -> Any:
            made = of(self, permit, now_us)
            return made if isinstance(made, Refusal) else replace(made, needs_record=needed)

        return dispatch

    return broken


def _links_unwritten(of: Any) -> Any:
    def send(self: Any, now: Any, command: Any, ref: Any, lasting_us: Any) -> bool:
        if ref.kind == STEP or isinstance(command, Refusal):
            return bool(of(self, now, command, ref, lasting_us))
        with patch.object(self._journal, "effect", lambda *given, **more: None):
            return bool(of(self, now, command, ref, lasting_us))

    return send


def _never_late(of: Any) -> Any:
    return lambda self, command: of(self, replace(command, not_after_us=_ALWAYS))


def _aged_from_arrival(of: Any) -> Any:
    def measured(self: Any, frame: Any, now_us: int) -> int | None:
        return None if of(self, frame, now_us) is None else now_us

    return measured


def _stale_is_fresh(of: Any) -> Any:
    return lambda state, policy, now: of(replace(state, ages=tuple(min(age, 0) for age in state.ages)), policy, now)


def _unknown_is_true(of: Any) -> Any:
    def fails(self: Any, truth: int, reason: Any, clause: Any) -> bool:
        return False if truth == UNKNOWN else bool(of(self, truth, reason, clause))

    return fails


def _without(which: str) -> Any:
    """Return a supervision without some clauses."""

    def broken(of: Any) -> Any:
        def watch(invocation: Any, state: Any, policy: Any, now: Any) -> Iterator[Any]:
            if which == "degrade":
                left_out = {rule.rule.text for rule in invocation.candidates.degrades}
            else:
                left_out = {clause.text for clause, _ in invocation.assume}
            return (each for each in of(invocation, state, policy, now) if each.text not in left_out)

        return watch

    return broken


def _released_anew(of: Any) -> Any:
    def ask(self: Any, now: Any, state: Any, ref: Any) -> Any:
        if ref.kind == STEP and self._queue.released_us is not None:
            self._queue.released_us = now.monotonic_us
        return of(self, now, state, ref)

    return ask


def _taken_again(of: Any) -> Any:
    def add(self: Any, answered: Any, now: Any) -> None:
        try:
            of(self, answered, now)
        except DocumentError as error:
            if error.slug != "already-answered":
                raise

    return add


def _stop_is_done(of: Any) -> Any:
    return lambda self, seen: True if self._left[0].stops else of(self, seen)


def _ends_in_the_air(_: Any) -> Any:
    def aloft(self: Any) -> bool:
        if self.dispatcher.active is not None:
            return True
        return bool(self.dispatcher.dispatched) and not self.vehicle.at_rest

    return property(aloft)


def _disk_is_fine(of: Any) -> Any:
    def append(self: Any, append: Any, record: Any) -> Any:
        with patch.object(self, "_fail", lambda reason: None):
            after = of(self, append, record)
        return record if after is None else after

    return append


def _anywhere(_: Any) -> Any:
    return lambda self, place, at, through: TRUE


def _times_of_day(of: Any) -> Any:
    def record(self: Any, now: Any, event: Any) -> None:
        of(self, now, event)
        supervised = self._controller._supervisor
        if isinstance(event, ClockStepped) and supervised is not None:
            supervised._started_us -= event.by_us

    return record


def _landed_by_word(of: Any) -> Any:
    return lambda system, mode: of(system, mode)[:1]


def _own_fallback(of: Any) -> Any:
    def come_down(self: Any, now: Any, kind: int = FALLBACK_LINK, cause: Any = None) -> bool:
        return bool(of(self, now, kind) if cause is None else of(self, now, kind, cause))

    return come_down


def _crash_is_nothing(of: Any) -> Any:
    def ended(self: Any, now: Any, event: Any) -> None:
        if isinstance(event, Crashed):
            self._journal.effect(now, "crashed", detail=event.how)
        else:
            of(self, now, event)

    return ended


def _true(_: Any) -> Any:
    return lambda self, *given, **named: True


def _false(_: Any) -> Any:
    return lambda self, *given, **more: False


def _asks_nothing(_: Any) -> Any:
    return lambda self, *given, **more: []


def _nobody(_: Any) -> Any:
    return lambda self: ""


_FALLS = (b'"kind":1', b'"kind":2')

WRONG: Final = (
    Wrong("hover-by-mode", "On PX4 a stop sends only DO_SET_MODE, which has no effect in Hold.",
          ((px4, "_stop", _hover_by_mode), (allow_list, "carries_out", _lets_modes_out)), _FALLS, "px4"),
    Wrong("grace-through-silence", "The grace of an unknown clause runs on while the link is silent.",
          ((supervisor.Grace, "stood", _nothing),), (b'"link-lost"',), aimed=Aimed(("freeze", "link-silence"))),
    Wrong("mode-taken-ignored", "An unrequested mode does not count as a takeover.",
          ((manoeuvre.Manoeuvre, "_taken_over", _no_mode_of_others), (driver.Driver, "_watch_mode", _nothing)),
          (b'"taken-over"',)),
    Wrong("target-taken-ignored", "An unrequested target does not count as a takeover.",
          ((supervision.TargetWatch, "is_foreign", _no_target_of_others),), (b"another target",)),
    Wrong("first-link-skipped", "A step's fallback begins with its second link.",
          ((fallback_flight.Fallback, "begin", _second_link_first),), (b'"kind":1',)),
    Wrong("sent-before-recorded", "A step's command does not wait for the record of its decision.",
          ((executor.Executor, "_dispatch", _record_for(False)),)),  # a disk stall of a second is not visible in a log
    Wrong("fallback-held-for-record", "A fallback waits for its record, like a step.",
          ((executor.Executor, "_dispatch", _record_for(True)),), (b'"gap"',)),
    Wrong("dispatch-unwritten", "The dispatch of a fallback link is not recorded.",
          ((dispatcher.Dispatcher, "_send", _links_unwritten),), _FALLS),
    Wrong("late-frames-leave", "The gate does not check the deadline of a command's first frame.",
          ((frames.FrameSession, "open", _never_late),), (b"frame/late",)),
    Wrong("aged-from-arrival", "A reading counts as measured when it arrives.",
          ((source_time.SourceTime, "of", _aged_from_arrival),)),
    Wrong("stale-is-fresh", "A stale value does not become unknown.",
          ((situation, "_situation", _stale_is_fresh),), (b"unknown", b'"defer"', *_FALLS)),
    Wrong("unknown-is-true", "An unknown condition counts as true.",
          ((decide.ConditionTally, "fails", _unknown_is_true),), (b'"defer"', b"/unknown")),
    Wrong("degrade-not-watched", "A degrade rule is checked at admission, but not in flight.",
          ((supervisor, "watch", _without("degrade")),), (b'"violated"',)),
    Wrong("assume-not-watched", "The assumptions of a step are checked at admission, but not in flight.",
          ((supervisor, "watch", _without("assume")),), (b'"violated"',)),
    Wrong("deadline-moves", "A step's deadline is counted from its last request.",
          ((admission.Admission, "ask", _released_anew),), (b'"defer"', b'"repeated"', b"no-slack")),
    Wrong("approval-taken-again", "A repeated answer is accepted again.",
          ((approval.Approvals, "add", _taken_again),), (b'already-answered',)),
    Wrong("recall-ignored", "A recall is recorded, but the running step continues.",
          ((controller.MissionController, "recall", _nothing),), (b'"recall"',)),
    Wrong("stop-unobserved", "A stop counts as done once it is sent.",
          ((manoeuvre.Manoeuvre, "_is_done", _stop_is_done), (supervision.BrakingWatch, "has_failed", _false))),
    Wrong("last-link-once", "The last link of the contingency is not retried after a failure.",
          ((fallback_flight.Fallback, "_insist", _false),), (b'"kind":2',)),
    Wrong("restart-ends-in-air", "Restarted after a crash of the program, it ends and leaves the vehicle flying.",
          ((controller.MissionController, "aloft", _ends_in_the_air),), (b'"resumed"',)),
    Wrong("restart-over-pilot", "Restarted after a crash of the program, it does not check for a takeover.",
          ((driver.Driver, "_flown_by_others", _nobody),), (b'"taken-over"',),
          aimed=Aimed(("runtime-killed", "pilot-mode"))),
    Wrong("full-disk-unnoticed", "A record that the disk refuses counts as written.",
          ((loop.RunLoop, "_append", _disk_is_fine),), (b'"gap"',)),
    Wrong("airspace-unchecked", "The airspace is not checked for paths, links and predicted stops.",
          ((prepare.PreparedAirspace, "keeps", _anywhere),), (b'"defer"', b'"fallback"', *_FALLS)),
    Wrong("clock-moves-times", "A step of the time of day changes the measured duration of a step.",
          ((runtime.EventHandler, "_record", _times_of_day),), (b'"clock-stepped"',)),
    Wrong("landing-by-word", "A landing counts as done when its mode is reported.",
          ((flavour, "landing", _landed_by_word),), (b'"detail":"emergency_land"',)),
    Wrong("mode-not-asked", "The mode is not requested: the last heartbeat counts.",
          ((manoeuvre.WhoFliesQuery, "is_newer", _true), (manoeuvre.WhoFliesQuery, "is_young", _true),
           (manoeuvre.WhoFliesQuery, "due", _asks_nothing)), (b'"taken-over"',),
          aimed=Aimed(("pilot-mode",), ("px4",))),
    Wrong("denied-trusts-step", "A step denied in the air flies its own fallback instead of the contingency.",
          ((controller.MissionController, "_come_down", _own_fallback),), (b'"deny"', b'"resumed"', b'"gap"')),
    Wrong("crash-ignored", "A crash is recorded, but the mission continues.",
          ((runtime.EventHandler, "_ended", _crash_is_nothing),), (b'"crashed"',)),
    Wrong("judged-before-fresh", "After a silence, old state is checked at once.",
          ((link.LinkSupervision, "awaits", _false),), (b'"link-lost"',)),
)  # fmt: skip
BY_NAME: Final = {each.name: each for each in WRONG}
