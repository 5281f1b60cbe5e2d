"""Parameters of the autopilot, set before a flight as configured, and put back after it (docs/adr/0051).

What is to be written is on the disk first, for the next run (`keep_owed`) and in the log (`record`). Then a permit is
asked for, which opens the gate for just that; then it is written; and what is read back counts, nothing else. All of it
happens on the ground: a vehicle that flies is left as it is, and what it is owed is kept for when it stands.
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

#: the effects that say, in the signed log, what is about to be written, that it was read back, and what was not done
PREPARATION: Final = "preparation"
PREPARED: Final = "prepared"
NOT_PREPARED: Final = "not-prepared"
#: and what the boundary permitted of it, or why it did not
PERMITTED: Final = "permitted"
NOT_PERMITTED: Final = "not-permitted"
NOT_RESTORED: Final = "not-restored"

#: how long it is waited for that the vehicle is known to stand on the ground, before a flight and after one,
BEFORE_US: Final = 30_000_000
AFTER_US: Final = 8_000_000
#: and for all of the answers to what is asked for at once
ANSWERS_US: Final = 12_000_000

Values = Mapping[str, int]


def told_of(writes: Iterable[ParameterWrite], *, restoring: bool) -> str:
    """What is about to be written, as the log says it and an audit reads it."""
    listed = ", ".join(f"{each.name} from {shown(each.before)} to {shown(each.value)}" for each in writes)
    return f"{'restore' if restoring else 'set'} {listed}"


class _Stopped(Exception):
    """Whoever lets time pass does not go on."""


class Preparations:
    """What is set, and owed, in one run. Each method waits by `turn`, which lets time pass, and says whether to go on.

    `record` puts an effect into the log and comes back when it is on the disk, `note` does not wait for that; they and
    `keep_owed` raise OSError. With `trouble`, which says why nobody knows what is owed, nothing is set.
    """

    def __init__(
        self, loaded: Loaded, driver: Driver, clock: Clock, owed: Mapping[str, Owed],
        record: Callable[[str, str], None], note: Callable[[str, str], None],
        keep_owed: Callable[[Mapping[str, Owed]], None],
        slack: int = 1, trouble: str | None = None,
    ) -> None:  # fmt: skip
        #: what is to be put back
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
        """Put back what an earlier run left, and set what is configured. Why the mission cannot fly, in words."""
        if not self._driver.prepares:
            return None
        try:
            problem = self._begin(turn)
            return None if self._flies else problem  # what flies is brought down as it is
        except _Stopped:
            return None  # `end` puts back what was set
        except OSError as error:
            if self._flies:
                return None
            return f"parameters are not set, because that cannot be recorded: {error.strerror or error}"
        finally:
            self._over()
            self._driver.prepares = False

    def end(self, turn: Callable[[], bool]) -> str | None:
        """Put back what was set. Why it was not, in words."""
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
        """Nothing more is asked for or set, wherever it broke off."""
        self._executor.prepared()
        if self._driver.flavour is not None:  # it was heard, so it could be asked
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
        """Put it into the log if that takes it, and wait for nothing: the vehicle is in the air."""
        with suppress(OSError):
            self._note(event, detail)

    def _refuse(self, why: str) -> str:
        self._record(NOT_PREPARED, why)
        return why

    def _restore(self, turn: Callable[[], bool], within_us: int) -> str | None:
        """Put back all that is owed, as far as it can be."""
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
        """Nothing is owed of what is as it was, or was set by somebody else since, which is left to them."""
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
        """Record, permit, write, read back. What was not done, in words."""
        self._keep_owed(self.owed)
        listed = tuple(ParameterWrite(name, values[name], value) for name, value in wanted.items())
        self._record(PREPARATION, told_of(listed, restoring=restoring))
        self._stands(turn, ANSWERS_US)  # the disk took its time: what is known of where it is may be old by now
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
        if not restoring:  # what the vehicle made of a value is of our making too, and is put back
            self.owed |= {name: Owed(self.owed[name].before, found[name]) for name in wrong if name in found}
            self._keep_owed(self.owed)
        self._record(NOT_PREPARED, text)
        return text

    def _permitted(self, sealed: bytes, now_us: int) -> Preparation | Refusal:
        """What the boundary lets be set. That it does is recorded, and nothing waits for the disk: all is on it."""
        opened = self._executor.prepare(sealed, now_us)
        if isinstance(opened, Refusal):
            self._note(NOT_PERMITTED, opened.slug)
        else:
            self._note(PERMITTED, told_of(opened.writes, restoring=opened.restoring))
        return opened

    def _read(self, names: Iterable[str], turn: Callable[[], bool]) -> dict[str, int]:
        """What the vehicle says now that these parameters are, of those that it tells."""
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
        """Whether it is known to rest on the ground, at once where it is known to fly."""
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
