"""`rtshcua qualify`: a flight test of the autopilot itself, and the signed record of it."""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec
import typer

from rtshcua import __version__
from rtshcua.adapters.clock import LinkClock
from rtshcua.adapters.doctor.diagnosis import settings_told
from rtshcua.adapters.doctor.standing import unflown
from rtshcua.adapters.qualification.checks import ends_after, judge
from rtshcua.adapters.qualification.missions import NAME, SortiePlan, source_of, trials
from rtshcua.adapters.qualification.observed import ObservedQualification, ObservedSortie, TakeoverKind
from rtshcua.adapters.qualification.sortie import BY_PILOT, SORTIES, QualifyingDriver, Sortie
from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.qualifications import keep_record, read_record
from rtshcua.adapters.store.writing import write_new
from rtshcua.adapters.vehicle import address
from rtshcua.adapters.vehicle.address import AddressError
from rtshcua.adapters.vehicle.bounds import FlightReach
from rtshcua.adapters.vehicle.connected import ConnectedVehicle
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.app.exit_codes import code_of, exit_code, untrusted
from rtshcua.app.fly.interrupts import Interrupts
from rtshcua.app.fly.replay_check import AIR_S
from rtshcua.app.fly.session import EXIT_CODES
from rtshcua.app.programs import compile_sources, read_text
from rtshcua.app.signing_keys import check_trusted
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.connection import Connect, LinkKey, NoFence, System, UnsignedRadio, UtcError, duration_us
from rtshcua.front.cli.faults import fail, misaddressed, say
from rtshcua.front.cli.findings import Findings
from rtshcua.front.cli.launch import IDENTITY_HELP, Launch, Refused, launch
from rtshcua.front.cli.refused import say_refused
from rtshcua.front.cli.showing.qualification import described, told
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.cli.unlock import unlock, unlock_for
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.ground.pipeline.sign import sign
from rtshcua.mavlink import dialect
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.onboard.enforcement.frames import Gate
from rtshcua.onboard.enforcement.load import EnforcementMode
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

app = typer.Typer(add_completion=False)

#: s that a vehicle which somebody else flies is watched until it is down
_LANDS_S: Final = 180.0
_POLL_S: Final = 0.05
_DOWN_HELP: Final = "land and disarm it first; `rtshcua doctor` shows what it reports"
#: nothing is recorded of a qualification that ends so: it says nothing of the autopilot
_BROKEN_OFF: Final = (
    Ending.INTERRUPTED, Ending.REFUSED, Ending.LINK_LOST, Ending.EVIDENCE_LOST, Ending.RECALLED, Ending.STOOD_DOWN,
)  # fmt: skip
_CONSENT_HELP: Final = (
    "`--sitl`: it is a simulation, and a second ground station takes it over; `--pilot NAME`: it is a real vehicle, "
    "and this pilot consents, with the mode switch in hand"
)


@app.command()
def qualify(
    source: Annotated[Path, typer.Argument(help="a source with a mission (.rts): the sorties fly under its policy")],
    connect: Connect,
    vehicle: Annotated[str, typer.Option(metavar="IDENTITY", help="who this vehicle is, as its policy says")],
    sitl: Annotated[
        bool, typer.Option("--sitl", help="it is a simulation: a second ground station takes it over")
    ] = False,
    pilot: Annotated[
        str | None, typer.Option(metavar="NAME", help="it is a real vehicle, and this pilot consents, switch in hand")
    ] = None,
    takeover: Annotated[
        bool, typer.Option("--takeover", help="with --pilot: ask the pilot to take over, and wait for it")
    ] = False,
    only: Annotated[
        list[str] | None, typer.Option(metavar="SORTIE", help="fly these sorties alone (repeatable)")
    ] = None,
    mission: Annotated[str | None, typer.Option(help="which mission, where the source has several")] = None,
    speed: Annotated[float, typer.Option(min=0.1, max=50, help="seconds of flight in a second; in simulation")] = 1.0,
    passphrase_file: Annotated[Path | None, typer.Option(help="a file with the keys' passphrase")] = None,
    signing_key: LinkKey = None,
    unsigned_radio: UnsignedRadio = False,
    system: System = None,
    no_fence: NoFence = False,
    utc_error: UtcError = None,
    runs: Annotated[Path, typer.Option(help="where the folders of the sorties are made")] = Path("runs"),
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object an event, the record last")] = False,
) -> ExitCode:  # fmt: skip
    """Fly a short test of the autopilot: does it do what the adapters assume? Sign a record of the result.

    It flies, so somebody has to consent: `--sitl` or `--pilot NAME`. Ends with 0 when every check that was made holds,
    with 13 when one does not.
    """
    if sitl and pilot is not None:
        return fail(ExitCode.USAGE, "`qualify` requires consent: `--sitl` or `--pilot NAME`, not both", _CONSENT_HELP)
    if sitl == (pilot is not None) or (pilot is not None and not pilot.strip()):
        return fail(ExitCode.USAGE, "`qualify` requires consent: either `--sitl` or `--pilot NAME`", _CONSENT_HELP)
    if takeover and sitl:
        return fail(ExitCode.USAGE, "`--takeover` requires `--pilot`: in a simulation takeovers are always tried")
    if unsigned_radio and signing_key is None:
        return fail(ExitCode.USAGE, "`--unsigned-radio` requires `--signing-key`")
    try:
        link = address.parse(connect)
    except AddressError as error:
        return misaddressed("--connect", error)
    if sitl and not link.is_loopback:
        what = f"`--sitl` requires a loopback address: the vehicle at `{link}` may be real"
        return fail(ExitCode.USAGE, what, "forward the simulation's port to this machine, or use `--pilot NAME`")
    if speed != 1 and not sitl:
        return fail(ExitCode.USAGE, "`--speed` requires a simulated vehicle: `--sitl`")
    planned, missing = _planned(sitl=sitl, takeover=takeover, keyed=signing_key is not None)
    named = {each.name: each for each in planned}
    unknown = sorted(set(only or ()) - named.keys())
    if unknown:
        return fail(ExitCode.USAGE, f"unknown sortie `{unknown[0]}`", f"accepted: {', '.join(named)}")
    if only:
        missing |= {name: "not flown (`--only`)" for name in named if name not in only}
        planned = [each for each in planned if each.name in only]
    found = Findings(json=as_json)
    compiled, sources = compile_sources([source], mission=mission, issued_at_us=time.time_ns() // 1_000)
    if found.report(compiled.diagnostics, sources) or compiled.policy is None or compiled.mission is None:
        return found.finish(exit_code(compiled.diagnostics))
    if compiled.policy.vehicle.identity != vehicle:
        text = f"the policy is for `{compiled.policy.vehicle.identity}`, this vehicle is `{vehicle}`"
        return fail(ExitCode.REFUSED, text, IDENTITY_HELP, slug="wrong-vehicle")
    plan = Qualifying(
        source, compiled.policy, compiled.mission, planned, missing, pilot=pilot or "", passphrase_file=passphrase_file
    )
    try:
        plan.prepare()
        with tempfile.TemporaryDirectory(prefix="rtshcua-") as folder:
            order = Launch(
                bundle=Path(folder), link=link, simulator=(), mode=EnforcementMode.SOFTWARE, speed=speed,
                vehicle=vehicle,
                roots=(), log_key=None, passphrase_file=passphrase_file, data=data_folder(),
                state=state_folder(), runs=runs,
                style="json" if as_json else "lines", fence=not no_fence, signing_key=signing_key,
                unsigned_radio=unsigned_radio, system=system, utc_error_us=duration_us(utc_error),
            )  # fmt: skip
            ended = plan.fly(order, as_json=as_json)
        return plan.finish(ended, as_json=as_json)
    except Refused as refused:
        return say_refused(refused, as_json=as_json)


_REAL: Final = "not sent to a real vehicle: a second ground station takes over in simulation only"
_UNASKED: Final = "not requested (`--takeover` asks the pilot to take over)"
_KEYED: Final = "not possible on a signed link: the second ground station has no key"


def _planned(*, sitl: bool, takeover: bool, keyed: bool) -> tuple[list[Sortie], dict[str, str]]:
    """The sorties, and why others are not flown."""
    alone = [each for each in SORTIES if each.takeover is None]
    if sitl and not keyed:
        return list(SORTIES), {}
    if sitl:
        return alone, {str(kind): _KEYED for kind in TakeoverKind}
    missing = {str(kind): _REAL for kind in TakeoverKind if kind is not TakeoverKind.MODE}
    return ([*alone, BY_PILOT], missing) if takeover else (alone, missing | {str(TakeoverKind.MODE): _UNASKED})


# ---------------------------------------------------------------- one sortie of it


@dataclass
class _Flown:
    """One sortie, as `launch` flies it."""

    sortie: Sortie
    sends: bool
    as_json: bool = False
    driven: QualifyingDriver | None = None
    observed: ObservedSortie | None = None
    final_hash: str = ""
    slack: int = 1
    left: bool = False
    """Whoever waited for the landing was told to leave."""

    def driver(self, policy: Policy, frames: Gate, slack: int, **more: Any) -> Driver:
        """Its driver, which observes it."""
        self.slack = slack
        self.driven = QualifyingDriver(policy, frames, slack, sortie=self.sortie, sends=self.sends, ask=_ask, **more)
        return self.driven

    def before(self, vehicle: ConnectedVehicle, clock: LinkClock) -> list[Event]:
        """It stands, with its motors off: nobody else flies it. Raises `Refused`."""
        seen, events = vehicle.driver.seen, list[Event]()
        until_s = time.monotonic() + AIR_S
        while not seen.down and not (seen.landed_state and seen.armed) and time.monotonic() < until_s:
            events += vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
        if seen.down:
            _announce(self.sortie, as_json=self.as_json)
            return events
        what = (
            "the vehicle is armed or in the air"
            if seen.armed or seen.airborne
            else "the vehicle does not report that it is on the ground"
        )
        raise Refused(
            ExitCode.REFUSED, "not-down", f"{what}: a qualification starts on the ground, disarmed", _DOWN_HELP
        )

    def after(
        self, vehicle: ConnectedVehicle, clock: LinkClock, interrupts: Interrupts, ending: Ending, final_hash: str
    ) -> None:
        """Whoever took it over lands it: watch until it is down."""
        assert self.driven is not None
        if ending is Ending.STOOD_DOWN and not self.sends:
            _ask("PILOT: the vehicle is yours; land it")
        until_s = time.monotonic() + _LANDS_S
        while not self.driven.seen.down and ending is Ending.STOOD_DOWN and time.monotonic() < until_s:
            if interrupts.wish() is not None:
                self.left = True
                break
            vehicle.poll(clock.now().monotonic_us, clock.us_in(_POLL_S))
        self.observed, self.final_hash = self.driven.finish(ending), final_hash


def _ask(text: str) -> None:
    say(f">>> {text}")


# ---------------------------------------------------------------- all of it


@dataclass
class Qualifying:
    """The sorties of one qualification, from compiling their missions to the record."""

    source: Path
    policy: Policy
    mission: Mission
    sorties: Sequence[Sortie]
    missing: dict[str, str]
    pilot: str
    passphrase_file: Path | None
    trial: SortiePlan | None = None
    keys: dict[Duty, SigningKey] = field(default_factory=dict)
    flown: list[_Flown] = field(default_factory=list)

    def prepare(self) -> None:
        """Find a leg that the policy permits, and unlock the keys. Raises `Refused`."""
        first: Compiled | None = None
        for trial in trials():
            refused = self._refused(trial)
            first = first or refused
            if refused is None:
                self.trial = trial
                break
        if self.trial is None:
            assert first is not None
            Findings(json=False).report(first.diagnostics, first.sources)
            text = f"`{self.policy.name}` permits none of the candidate legs; the findings on the first one are above"
            raise Refused(ExitCode.REFUSED, "not-permitted", text, _PERMIT_HELP)
        store = KeyStore(data_folder())
        try:
            for duty in (Duty.POLICY, Duty.LOG):
                self.keys[duty] = unlock(store, duty, passphrase_file=self.passphrase_file)
            self.keys[Duty.MISSION] = unlock_for(store, self.mission, passphrase_file=self.passphrase_file)
            check_trusted(store, self.keys[Duty.MISSION], self.policy, self.mission)
        except Untrusted as error:
            raise Refused(code_of(error.slug), *untrusted(error)) from None

    def fly(self, order: Launch, *, as_json: bool) -> Ending:
        """Fly one after the other, until one does not go as planned; how the last one ended."""
        folder = order.bundle
        for sortie in self.sorties:
            flown = _Flown(sortie, sends=not self.pilot, as_json=as_json)
            bundle = folder / f"{NAME}-{sortie.name}.bundle"
            write_new(bundle, self._bundle(sortie))
            launch(replace(order, bundle=bundle, sortie=flown))
            assert flown.observed is not None
            self.flown.append(flown)
            why = "interrupted" if flown.left else ends_after(flown.observed)
            if why is not None:
                left = self.sorties[len(self.flown) :]
                self.missing |= {each.name: why for each in left}
                break
        last = self.flown[-1]
        return Ending.INTERRUPTED if last.left or last.observed is None else Ending(last.observed.ending)

    def finish(self, ended: Ending, *, as_json: bool) -> ExitCode:
        """Judge, print the table, and keep the record, unless it was broken off."""
        observed = self._observed()
        checks = judge(observed, self.policy)
        record = self._record(observed, checks)
        last = self.flown[-1]
        planned = not last.left and last.observed is not None and ends_after(last.observed) is None
        broken = ended in _BROKEN_OFF and not planned
        path = None
        if not broken:
            signed = sign_qualification(record, self.keys[Duty.LOG])
            whole = not unflown(record) or bool(record.failed) or not self._was_whole()
            path = keep_record(data_folder(), record.vehicle, signed) if whole else None
        if broken or ended is Ending.CRASHED:
            code = EXIT_CODES[ended]
        else:
            code = ExitCode.OK if record.qualifies else ExitCode.TESTS
        if as_json:
            about = {"record": None if path is None else str(path), "exit_code": int(code)}
            out_json(msgspec.json.encode({"event": "qualification"} | described(record) | about).decode())
        else:
            out(*told(record, ended if broken else None))
            if path is not None:
                out(f"the record is in {path}")
            elif not broken:
                out("no record is made of it: that of the whole qualification before stays")
        return code

    def _was_whole(self) -> bool:
        """Whether the record that there is is one of a whole qualification, which no partial one replaces."""
        try:
            signed = read_record(data_folder(), self.policy.vehicle.identity)
            return signed is not None and not unflown(
                read_qualification(cose.unverified(signed, limit=MAX_QUALIFICATION).payload)
            )
        except Untrusted:
            return False

    def _refused(self, trial: SortiePlan) -> Compiled | None:
        """The first of the missions that does not compile; those with a leg are tried before the others."""
        legs = sorted(self.sorties, key=lambda each: MotionKind.FLY not in each.steps)
        return next((each for sortie in legs if (each := self._compiled(sortie, trial)).mission is None), None)

    def _compiled(self, sortie: Sortie, trial: SortiePlan) -> Compiled:
        by_pilot = sortie is BY_PILOT
        try:
            text = source_of(sortie, trial, self.source.name, self.policy, self.mission, by_pilot=by_pilot)
        except LookupError as error:
            text = f"`{self.policy.name}` has no skill whose motion is `{error.args[0]}`"
            raise Refused(
                ExitCode.REFUSED, "no-skill", text, "import the skills that ship: `lib:skills/goto.rts`"
            ) from None
        reading = read_text(str(self.source.parent / f"{NAME}.rts"), text)
        return compile_program(reading.program, dialect.load(), mission=NAME, issued_at_us=time.time_ns() // 1_000)

    def _bundle(self, sortie: Sortie) -> bytes:
        assert self.trial is not None
        compiled = self._compiled(sortie, self.trial)
        assert compiled.policy is not None
        assert compiled.mission is not None
        return sign(
            compiled.policy, compiled.mission, policy_key=self.keys[Duty.POLICY], mission_key=self.keys[Duty.MISSION]
        )

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


_PERMIT_HELP: Final = "permit takeoff to 6 or 10 m, goto 30 or 50 m from home at 2 to 5 m/s, hover, return and landing"


def _announce(sortie: Sortie, *, as_json: bool) -> None:
    if as_json:
        said = {"event": "sortie", "name": sortie.name, "about": sortie.about}
        out_json(msgspec.json.encode(said).decode(), flush=True)
    else:
        out(f"sortie {sortie.name}: {sortie.about}", flush=True)
