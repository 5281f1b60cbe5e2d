"""Set parameters of the autopilot before a flight as configured, and restore them after it (docs/adr/0051).

The values to write are on the disk first, for the next run (`keep_owed`) and in the log (`record`). Then a permit opens
the gate for exactly these; then they are written; and only the value that is read back counts. All of this happens on
the ground: a flying vehicle is left alone, and its parameters stay owed until it has landed.
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import Final

from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink.parameters import bits_of, shown, value_of
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.enforcement.preparation import Owed
from rtshcua.onboard.ports import Clock
from rtshcua.wire.preparation import ParameterWrite, Preparation, encode

#: the effects in the signed log: the values to be written, the values read back, and failures
PREPARATION: Final = "preparation"
PREPARED: Final = "prepared"
NOT_PREPARED: Final = "not-prepared"
#: and what the boundary permitted, or why it did not
PERMITTED: Final = "permitted"
NOT_PERMITTED: Final = "not-permitted"
NOT_RESTORED: Final = "not-restored"

#: how long to wait until the vehicle is known to be on the ground, before and after a flight
BEFORE_US: Final = 30_000_000
AFTER_US: Final = 8_000_000
#: and for all answers to requests that are sent together
ANSWERS_US: Final = 12_000_000

Values = Mapping[str, int]


def told_of(writes: Iterable[ParameterWrite], *, restoring: bool) -> str:
    """The values to be written, in the form of the log, which an audit reads."""
    listed = ", ".join(f"{each.name} from {shown(each.before)} to {shown(each.value)}" for each in writes)
    return f"{'restore' if restoring else 'set'} {listed}"


class _Stopped(Exception):
    """The function that lets time pass has ended."""


class Preparations:
    """The parameters that one run sets and owes. Each method waits by `turn`, which lets time pass and returns whether
    to go on. `record` writes an effect to the log and returns once it is on the disk, `note` does not wait for that;
    they and `keep_owed` raise OSError. With `trouble`, the reason why the owed parameters are unknown, nothing is set.
    """

    def __init__(
        self, loaded: Loaded, driver: Driver, clock: Clock, owed: Mapping[str, Owed],
        record: Callable[[str, str], None], note: Callable[[str, str], None],
        keep_owed: Callable[[Mapping[str, Owed]], None],
        slack: int = 1, trouble: str | None = None,
    ) -> None:  # fmt: skip
        #: the parameters to restore
        self.owed = dict(owed)
        self._issuer, self._executor = loaded.preparation, loaded.executor
        self._settings = loaded.preparation.settings
        self._driver = driver
        self._clock = clock
        self._record = record
        self._note = note
        self._keep_owed = keep_owed
        self._slack = slack
        self._trouble = trouble
        driver.prepares = bool(self._settings or self.owed)

    def begin(self, turn: Callable[[], bool]) -> str | None:
        """Restore what an earlier run owes, and set what is configured. Returns why no mission can fly, in words."""
        if not self._driver.prepares:
            return None
        try:
            problem = self._begin(turn)
            return None if self._flies else problem  # a flying vehicle is brought down with its present values
        except _Stopped:
            return None  # `end` restores the values
        except OSError as error:
            if self._flies:
                return None
            return f"parameters are not set, because that cannot be recorded: {error.strerror or error}"
        finally:
            self._over()
            self._driver.prepares = False

    def end(self, turn: Callable[[], bool]) -> str | None:
        """Restore the values. Returns why that failed, in words."""
        if not self.owed:
            return None
        try:
            return self._restore(turn, AFTER_US)
        except _Stopped:
            return f"left: {self._kept()}"
        except OSError as error:
            return f"{self._kept()}, because that cannot be recorded: {error.strerror or error}"
        finally:
            self._over()

    def _over(self) -> None:
        """Stop all reading and writing, at any stage."""
        self._executor.prepared()
        if self._driver.flavour is not None:  # without a heartbeat nothing could be requested
            for name in {*self._settings, *self.owed}:
                self._driver.settings.drop(name)

    def _begin(self, turn: Callable[[], bool]) -> str | None:
        # a run that broke off in the air is not waited for: nothing steers the vehicle until this is over
        if not self._stands(turn, 0 if self._driver.resumes else BEFORE_US):
            return self._leave()
        if self._trouble is not None:
            return self._refuse(self._trouble)
        self._restore(turn, BEFORE_US)
        if not self._settings:
            return None  # a value that is not restored is recorded, and the mission is judged by the present values
        values = self._read(self._settings, turn)
        changes = {name: value for name, value in self._settings.items() if values.get(name) != value}
        why = self._why_not(changes, values)
        if why or not changes:
            return self._refuse(why) if why else None
        self.owed |= {name: Owed(values[name], value) for name, value in changes.items()}
        problem = self._write(changes, values, turn, restoring=False)
        if problem is not None:
            self._restore(turn, AFTER_US)
        return problem

    def _leave(self) -> str | None:
        """Record that nothing is set or restored, because the vehicle may not be on the ground."""
        record, why = self._tell if self._flies else self._record, "the vehicle is not known to be on the ground"
        if self.owed:
            record(NOT_RESTORED, f"{why}: {self._kept()}")
        if not self._settings:
            return None
        record(NOT_PREPARED, f"{why}: nothing is set")
        return f"{why}: nothing is set"

    def _why_not(self, changes: Values, values: Values) -> str | None:
        missing = [name for name in self._settings if name not in values]
        if missing:
            return f"the vehicle does not report `{'`, `'.join(missing)}`, which is to be set"
        left = sorted(self._settings.keys() & self.owed)
        if left:
            return f"`{'`, `'.join(left)}` could not be restored first"
        fits = self._driver.settings.fits
        unfit = [f"{name} {shown(value)}" for name, value in changes.items() if not fits(name, value_of(value))]
        return f"the vehicle's type for the parameter cannot hold {', '.join(unfit)}" if unfit else None

    @property
    def _flies(self) -> bool:
        return self._driver.seen.airborne or self._driver.resumes

    def _tell(self, event: str, detail: str) -> None:
        """Record an effect if the log accepts it, without waiting: the vehicle is in the air."""
        with suppress(OSError):
            self._note(event, detail)

    def _refuse(self, why: str) -> str:
        self._record(NOT_PREPARED, why)
        return why

    def _restore(self, turn: Callable[[], bool], within_us: int) -> str | None:
        """Restore everything owed, as far as possible."""
        if not self.owed:
            return None
        if not self._stands(turn, within_us):
            text = f"the vehicle is not known to be on the ground: {self._kept()}"
            self._record(NOT_RESTORED, text)
            return text
        values = self._read(self.owed, turn)
        silent = sorted(set(self.owed) - set(values))
        self._forgive(values)
        left = {name for name in self.owed if name in values}
        problem = self._put_back(left, values, turn) if left else None
        if silent:
            problem = f"the vehicle does not report `{'`, `'.join(silent)}`: {self._kept()}"
            self._record(NOT_RESTORED, problem)
        return problem

    def _put_back(self, names: Iterable[str], values: Values, turn: Callable[[], bool]) -> str | None:
        wanted = {name: self.owed[name].before for name in sorted(names)}
        problem = self._write(wanted, values, turn, restoring=True)
        if problem is None:
            for name in wanted:
                del self.owed[name]
            self._keep_owed(self.owed)
        return None if problem is None else f"{problem}: {self._kept()}"

    def _forgive(self, values: Values) -> None:
        """Drop owed parameters that have their earlier value, or that somebody else has changed since; those are left
        unchanged.
        """
        for name, each in list(self.owed.items()):
            value = values.get(name)
            if value is None or (value == each.value and value != each.before):
                continue
            if value != each.before:
                set_to = f"which was set to {shown(each.value)}, but is {shown(value)} now"
                self._record(NOT_RESTORED, f"somebody else changed {name}, {set_to}: it is left unchanged")
            del self.owed[name]
            self._keep_owed(self.owed)

    def _write(self, wanted: Values, values: Values, turn: Callable[[], bool], *, restoring: bool) -> str | None:
        """Record, permit, write, read back. Returns what failed, in words."""
        self._keep_owed(self.owed)
        listed = tuple(ParameterWrite(name, values[name], value) for name, value in wanted.items())
        self._record(PREPARATION, told_of(listed, restoring=restoring))
        self._stands(turn, ANSWERS_US)  # the disk may have been slow: the vehicle's state may have changed
        now_us = self._clock.now().monotonic_us
        sealed = self._issuer.permit(encode(Preparation(0, restoring, 0, listed)), now_us)
        opened = sealed if isinstance(sealed, Refusal) else self._permitted(sealed, now_us)
        why = ""
        found: Values = {}
        if isinstance(opened, Refusal):
            why = f" ({opened.slug})"
        else:
            settings = self._driver.settings
            for name, value in wanted.items():
                settings.write(name, value_of(value))
            self._await(lambda: all(map(settings.is_settled, wanted)), turn, ANSWERS_US)
            if settings.refused is not None:
                why = f" ({settings.refused.slug})"
            self._executor.prepared()
            found = self._read(wanted, turn)
        wrong = [name for name, value in wanted.items() if found.get(name) != value]
        if not wrong:
            self._record(PREPARED, ", ".join(f"{name} is {shown(value)}" for name, value in found.items()))
            return None
        said = [f"{name} is {shown(found[name])}" if name in found else f"{name} is not reported" for name in wrong]
        text = f"{'not put back' if restoring else 'not set'} as it was to be{why or ': ' + ', '.join(said)}"
        if not restoring:  # a value that the vehicle adapted came from us too, and is restored
            self.owed |= {name: Owed(self.owed[name].before, found[name]) for name in wrong if name in found}
            self._keep_owed(self.owed)
        self._record(NOT_PREPARED, text)
        return text

    def _permitted(self, sealed: bytes, now_us: int) -> Preparation | Refusal:
        """The boundary's permit. It is recorded without waiting for the disk, which has the values already."""
        opened = self._executor.prepare(sealed, now_us)
        if isinstance(opened, Refusal):
            self._note(NOT_PERMITTED, opened.slug)
        else:
            self._note(PERMITTED, told_of(opened.writes, restoring=opened.restoring))
        return opened

    def _read(self, names: Iterable[str], turn: Callable[[], bool]) -> dict[str, int]:
        """The present values of these parameters, as far as they are reported."""
        settings, names = self._driver.settings, sorted(names)
        for name in names:
            settings.forget(name)
            settings.read(name)
        self._await(lambda: all(settings.is_known(name) for name in names), turn, ANSWERS_US)
        found = {name: bits_of(settings.values[name]) for name in names if name in settings.values}
        for name in names:
            settings.drop(name)
        return {name: bits for name, bits in found.items() if bits is not None}

    def _stands(self, turn: Callable[[], bool], within_us: int) -> bool:
        """Whether the vehicle is known to rest on the ground; returns at once if it is known to fly."""
        seen, frames = self._driver.seen, self._executor.frames

        def known() -> bool:
            return (seen.rests and frames.stands(self._clock.now().monotonic_us)) or seen.airborne or seen.armed

        self._await(known, turn, within_us)
        return seen.rests and frames.stands(self._clock.now().monotonic_us)

    def _await(self, done: Callable[[], bool], turn: Callable[[], bool], within_us: int) -> None:
        until_us = self._clock.now().monotonic_us + within_us * self._slack
        while not done() and self._clock.now().monotonic_us < until_us:
            if not turn():
                raise _Stopped

    def _kept(self) -> str:
        listed = ", ".join(f"{name} to {shown(each.before)}" for name, each in sorted(self.owed.items()))
        return f"to be restored at the next start: {listed}"
