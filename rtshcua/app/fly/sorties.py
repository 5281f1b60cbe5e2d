"""Plan, fly, judge and record the sorties of a qualification."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from rtshcua import __version__
from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.doctor.diagnosis import settings_told
from rtshcua.adapters.doctor.identity import unflown
from rtshcua.adapters.qualification.checks import ends_after, judge
from rtshcua.adapters.qualification.missions import NAME, SortiePlan, source_of, trials
from rtshcua.adapters.qualification.observed import ObservedQualification, ObservedSortie, TakeoverKind
from rtshcua.adapters.qualification.sortie import BY_PILOT, SORTIES, QualifyingDriver, Sortie
from rtshcua.adapters.store.vehicle_records import keep_qualification, kept_qualification
from rtshcua.adapters.store.writing import write_new
from rtshcua.adapters.vehicle.bounds import FlightReach
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.app.fly.flight_request import FlightRequest
from rtshcua.app.fly.flight_session import EXIT_CODES
from rtshcua.app.fly.replay_check import AIR_S
from rtshcua.app.fly.stages import fly
from rtshcua.app.fly.stop_wishes import Interrupts
from rtshcua.app.fly.view_ports import Console
from rtshcua.app.programs import read_text
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.ground.pipeline.sign import sign
from rtshcua.mavlink import dialect
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.frames import Gate
from rtshcua.onboard.ports import Ending, Event
from rtshcua.wire import cose
from rtshcua.wire.bundle import policy_digest, policy_payload
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.qualification import (
    MAX_QUALIFICATION,
    Firmware,
    Qualification,
    QualificationCheck,
    parameters_digest,
    read_qualification,
    sign_qualification,
)
from rtshcua.wire.untrusted import Untrusted

#: the longest wait for the landing of a vehicle that another pilot flies, in seconds
_LANDS_S: Final = 180.0
_POLL_S: Final = 0.05
_DOWN_HELP: Final = "land and disarm it first; `rtshcua doctor` shows what it reports"
#: endings without a record, because they say nothing about the autopilot
_BROKEN_OFF: Final = (
    Ending.INTERRUPTED, Ending.REFUSED, Ending.LINK_LOST, Ending.EVIDENCE_LOST, Ending.RECALLED, Ending.STOOD_DOWN,
)  # fmt: skip
_REAL: Final = "not sent to a real vehicle: a second ground station takes over in simulation only"
_UNASKED: Final = "not requested (`--takeover` asks the pilot to take over)"
_KEYED: Final = "not possible on a signed link: the second ground station has no key"


def plan_sorties(*, sitl: bool, takeover: bool, keyed: bool) -> tuple[list[Sortie], dict[str, str]]:
    """The sorties to fly, and the reasons why others are left out."""
    alone = [each for each in SORTIES if each.takeover is None]
    if sitl and not keyed:
        return list(SORTIES), {}
    if sitl:
        return alone, {str(kind): _KEYED for kind in TakeoverKind}
    missing = {str(kind): _REAL for kind in TakeoverKind if kind is not TakeoverKind.MODE}
    return ([*alone, BY_PILOT], missing) if takeover else (alone, missing | {str(TakeoverKind.MODE): _UNASKED})


@dataclass
class FlownSortie:
    """One sortie, as flown and observed. `ask` shows a request to the pilot, `announce` shows which sortie begins."""

    sortie: Sortie
    sends: bool
    ask: Callable[[str], None]
    announce: Callable[[Sortie], None]
    driven: QualifyingDriver | None = None
    observed: ObservedSortie | None = None
    final_hash: str = ""
    slack: int = 1
    left: bool = False
    """Whether the user left before the landing."""

    def driver(self, policy: Policy, frames: Gate, slack: int, **more: Any) -> Driver:
        """The driver, which observes the sortie."""
        self.slack = slack
        self.driven = QualifyingDriver(
            policy, frames, slack, sortie=self.sortie, sends=self.sends, ask=self.ask, **more
        )
        return self.driven

    def before(self, vehicle: ConnectedVehicle, clock: LinkClock) -> list[Event] | Refusal:
        """Check that the vehicle is on the ground and disarmed."""
        seen, events = vehicle.driver.seen, list[Event]()
        until_s = time.monotonic() + AIR_S
        while not seen.down and not (seen.landed_state and seen.armed) and time.monotonic() < until_s:
            events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
        if seen.down:
            self.announce(self.sortie)
            return events
        what = (
            "the vehicle is armed or in the air"
            if seen.armed or seen.airborne
            else "the vehicle does not report that it is on the ground"
        )
        text = f"{what}: a qualification starts on the ground, disarmed"
        return Refusal("not-down", text, _DOWN_HELP, ExitCode.REFUSED)

    def after(
        self, vehicle: ConnectedVehicle, clock: LinkClock, interrupts: Interrupts, ending: Ending, final_hash: str
    ) -> None:
        """After a take-over, wait until the pilot has landed the vehicle."""
        assert self.driven is not None
        if ending is Ending.STOOD_DOWN and not self.sends:
            self.ask("PILOT: the vehicle is yours; land it")
        until_s = time.monotonic() + _LANDS_S
        while not self.driven.seen.down and ending is Ending.STOOD_DOWN and time.monotonic() < until_s:
            if interrupts.wish() is not None:
                self.left = True
                break
            vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
        self.observed, self.final_hash = self.driven.finish(ending), final_hash


class QualificationResult(NamedTuple):
    """The result of a qualification: the record, the ending that broke it off or None, the path of the stored record or
    None, and the exit code.
    """

    record: Qualification
    broken_off: Ending | None
    path: Path | None
    code: ExitCode


@dataclass
class Qualifying:
    """The sorties of one qualification, from compiling their missions to the record."""

    source: Path
    policy: Policy
    mission: Mission
    sorties: Sequence[Sortie]
    missing: dict[str, str]
    pilot: str
    data: Path
    trial: SortiePlan | None = None
    flown: list[FlownSortie] = field(default_factory=list)

    def choose_leg(self) -> Compiled | Refusal | None:
        """Choose a leg that the policy permits. Return None, or the diagnostics of the first leg if none is permitted,
        or a refusal if a skill is missing.
        """
        first: Compiled | None = None
        for trial in trials():
            refused = self._refused(trial)
            if refused is None:
                self.trial = trial
                return None
            if isinstance(refused, Refusal):
                return refused
            first = first or refused
        assert first is not None
        return first

    def fly(
        self, request: FlightRequest, console: Console, keys: Mapping[Duty, SigningKey],
        announce: Callable[[Sortie], None],
    ) -> Refusal | None:  # fmt: skip
        """Fly the sorties in order, until one does not go as planned. The bundles are written to the folder of
        `request`.
        """
        for sortie in self.sorties:
            flown = FlownSortie(sortie, not self.pilot, lambda text: console.say(f">>> {text}"), announce)
            bundle = request.bundle / f"{NAME}-{sortie.name}.bundle"
            write_new(bundle, self._bundle(sortie, keys))
            ended = fly(replace(request, bundle=bundle, sortie=flown), console)
            if isinstance(ended, Refusal):
                return ended
            assert flown.observed is not None
            self.flown.append(flown)
            why = "interrupted" if flown.left else ends_after(flown.observed)
            if why is not None:
                left = self.sorties[len(self.flown) :]
                self.missing |= {each.name: why for each in left}
                break
        return None

    def judge(self, log_key: SigningKey) -> QualificationResult:
        """Judge the observations, and store the record unless the qualification was broken off."""
        last = self.flown[-1]
        ended = Ending.INTERRUPTED if last.left or last.observed is None else Ending(last.observed.ending)
        observed = self._observed()
        record = self._record(observed, judge(observed, self.policy))
        planned = not last.left and last.observed is not None and ends_after(last.observed) is None
        broken = ended in _BROKEN_OFF and not planned
        path = None
        if not broken:
            signed = sign_qualification(record, log_key)
            whole = not unflown(record) or bool(record.failed) or not self._was_whole()
            path = keep_qualification(self.data, record.vehicle, signed) if whole else None
        if broken or ended is Ending.CRASHED:
            code = EXIT_CODES[ended]
        else:
            code = ExitCode.OK if record.qualifies else ExitCode.TESTS
        return QualificationResult(record, ended if broken else None, path, code)

    def _was_whole(self) -> bool:
        """Whether the stored record is of a complete qualification, which a partial one does not replace."""
        try:
            signed = kept_qualification(self.data, self.policy.vehicle.identity)
            return signed is not None and not unflown(
                read_qualification(cose.unverified(signed, limit=MAX_QUALIFICATION).payload)
            )
        except Untrusted:
            return False

    def _refused(self, trial: SortiePlan) -> Compiled | Refusal | None:
        """The result of the first mission that does not compile; those with a leg are compiled first."""
        for sortie in sorted(self.sorties, key=lambda each: MotionKind.FLY not in each.steps):
            compiled = self._compiled(sortie, trial)
            if isinstance(compiled, Refusal) or compiled.mission is None:
                return compiled
        return None

    def _compiled(self, sortie: Sortie, trial: SortiePlan) -> Compiled | Refusal:
        by_pilot = sortie is BY_PILOT
        try:
            text = source_of(sortie, trial, self.source.name, self.policy, self.mission, by_pilot=by_pilot)
        except LookupError as error:
            text = f"`{self.policy.name}` has no skill whose motion is `{error.args[0]}`"
            return Refusal("no-skill", text, "import the skills that ship: `lib:skills/goto.rts`", ExitCode.REFUSED)
        reading = read_text(str(self.source.parent / f"{NAME}.rts"), text)
        return compile_program(reading.program, dialect.load(), mission=NAME, issued_at_us=time.time_ns() // 1_000)

    def _bundle(self, sortie: Sortie, keys: Mapping[Duty, SigningKey]) -> bytes:
        assert self.trial is not None
        compiled = self._compiled(sortie, self.trial)
        assert not isinstance(compiled, Refusal)
        assert compiled.policy is not None
        assert compiled.mission is not None
        return sign(compiled.policy, compiled.mission, policy_key=keys[Duty.POLICY], mission_key=keys[Duty.MISSION])

    def _observed(self) -> ObservedQualification:
        driven = [each.driven for each in self.flown if each.driven is not None]
        first, flavour = driven[0], driven[0].flavour
        questions = first.questions
        sorties = tuple(each.observed for each in self.flown if each.observed is not None)
        if flavour is None or questions is None:
            return ObservedQualification(None, 0, None, sorties, (), self.missing)
        trips = [each.source.clock.round_trip_us for each in driven]
        return ObservedQualification(
            questions.firmware,
            flavour.mode_within_us * self.flown[0].slack,
            max((each for each in trips if each is not None), default=None),
            sorties,
            tuple(settings_told(flavour.name, questions.values.values, self.policy, FlightReach())),
            self.missing,
        )

    def _record(self, observed: ObservedQualification, checks: Sequence[QualificationCheck]) -> Qualification:
        driven = self.flown[0].driven
        questions = None if driven is None else driven.questions
        parameters = tuple(sorted({} if questions is None else questions.parameters.items()))
        return Qualification(
            vehicle=self.policy.vehicle.identity,
            firmware=observed.firmware or Firmware("", 0, b""),
            parameters=parameters,
            digest=parameters_digest(parameters),
            policy=policy_digest(policy_payload(self.policy)),
            pilot=self.pilot,
            release=__version__,
            issued_at_us=time.time_ns() // 1_000,
            flown_us=sum(each.airborne_us for each in observed.sorties),
            logs=tuple(each.final_hash for each in self.flown),
            checks=tuple(checks),
        )
