"""Start a gateway: its policy and keys, the simulated vehicle if no other is named, the relay, and the service."""

import difflib
import json
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from math import isqrt
from pathlib import Path
from typing import Final

from rtshcua.adapters.boundary.process import program
from rtshcua.adapters.simulator import Simulator, SimulatorError
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.laying import lay
from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.writing import PRIVATE_FOLDER, make_folder
from rtshcua.adapters.store.writing import replace as write_file
from rtshcua.adapters.utc import kernel_error_us, vehicle_counts
from rtshcua.app.exit_codes import exit_code_of, words_of
from rtshcua.app.gateway.configuration import (
    FILE,
    OPERATOR,
    ConfiguredClient,
    GatewayConfiguration,
    VehicleSide,
    reached,
)
from rtshcua.app.gateway.gateway_service import FlightWords, GatewayConsole, GatewayService
from rtshcua.app.gateway.policy_in_force import PolicyInForce, Unlock, development_keys, policy_in_force
from rtshcua.app.gateway.quick_policy import POLICY, QuickRules, policy_text, start_inside
from rtshcua.app.gateway.relay_process import StartedRelay
from rtshcua.app.gateway.vehicle_facts import VehicleFacts, examine
from rtshcua.app.gateway.vehicle_state import VehicleFrames
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.exchange.stock_policy import GeoPoint
from rtshcua.ground.language.size_limits import MAX_SIZE
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.situation import Now
from rtshcua.model.flat.zone import unproject
from rtshcua.model.quantity import Dimension, display
from rtshcua.simulation.config import HOME, AutopilotKind

#: where the simulated vehicle sends, unless the port is taken; and the return height of a vehicle that says nothing
_LOCAL: Final = "127.0.0.1"
_RETURN_MM: Final = 30_000
#: the version of a policy for a vehicle that keeps state: minutes since this time, so that it only rises
_SINCE_S: Final = 1_577_836_800  # 2020-01-01
SOURCE: Final = "policy.rts"
#: the name of the folder of development keys
DEVELOPMENT: Final = "gateway-development"
_UTC_ERROR: Final = "500ms"


@dataclass(frozen=True, slots=True)
class GatewayRequest:
    """What is started. `quick`: the rules of the one-minute policy; without them the configuration has sources. `save`:
    the folder for the policy and the configuration. `simulator`: the options of the simulated vehicle, of this
    `flavour`. `sessions`: end after so many. `utc_error_us`: the greatest error of UTC, for a first answer.
    """

    configuration: GatewayConfiguration
    quick: QuickRules | None = None
    save: Path | None = None
    simulator: Sequence[str] = ()
    flavour: AutopilotKind = AutopilotKind.PX4
    sessions: int | None = None
    utc_error_us: int = 500_000
    operator_socket: Path | None = None
    passphrase_file: Path | None = None


def start_gateway(
    request: GatewayRequest, console: GatewayConsole, unlock: Callable[[KeyStore], Unlock]
) -> ExitCode | Refusal:
    """Start everything, and run until it ends. Raises `Untrusted` and OSError."""
    with ExitStack() as stack:
        work = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rtshcua-gateway-")))
        return _Starting(request, console, unlock, stack, work).run()


class _Starting:
    """The start of one gateway, in a private folder `work`."""

    def __init__(
        self, request: GatewayRequest, console: GatewayConsole, unlock: Callable[[KeyStore], Unlock],
        stack: ExitStack, work: Path,
    ) -> None:  # fmt: skip
        self._request, self._console, self._unlock = request, console, unlock
        self._stack, self._work = stack, work
        configuration = self._configuration = request.configuration
        self._simulated = configuration.vehicle.connect is None
        self._facts: VehicleFacts | None = None
        self._text = ""  # of the policy of `--allow`
        self._version = 1 if self._simulated else int(time.time() - _SINCE_S) // 60
        own = data_folder() / DEVELOPMENT if request.save is None else request.save / DEVELOPMENT
        self._data = configuration.data or (data_folder() if request.quick is None else own)

    def run(self) -> ExitCode | Refusal:
        address = self._configuration.vehicle.connect or f"udpin:{_LOCAL}:{_free_port()}"
        early = self._relay(address) if self._needs_examination else None
        if isinstance(early, Refusal):
            return early
        if early is not None:
            facts = self._examined(early)
            if isinstance(facts, Refusal):
                return facts
            self._facts = facts
        policy = self._policy()
        if isinstance(policy, Refusal):
            return policy
        relay = early or self._relay(address)
        if isinstance(relay, Refusal):
            return relay
        refusal = self._simulator(address, policy.missions.policy) if self._simulated else None
        if refusal is not None:
            return refusal
        make_folder(self._configuration.runs)
        words = self._words(policy)
        self._introduce(policy, relay, words)
        service = GatewayService(
            relay, policy, self._configuration.clients, words, self._console, self._configuration.runs,
            system=self._configuration.vehicle.system, utc_error_us=self._request.utc_error_us,
            renew=self._renewed, sessions=self._request.sessions,
        )  # fmt: skip
        self._stack.callback(service.close)
        return service.run()

    @property
    def _needs_examination(self) -> bool:
        return self._request.quick is not None and not self._simulated

    # ---------------------------------------------------------------- the vehicle

    def _relay(self, address: str) -> StartedRelay | Refusal:
        relay = StartedRelay.start(address, self._configuration.clients)
        if not isinstance(relay, Refusal):
            self._stack.callback(relay.close)
        return relay

    def _examined(self, relay: StartedRelay) -> VehicleFacts | Refusal:
        assert self._request.quick is not None
        area = self._request.quick.area
        somewhere = policy_text(self._request.quick, start_inside(area) if area else _home(), _RETURN_MM)
        if isinstance(somewhere, Refusal):
            return somewhere
        source = self._work / "somewhere.rts"
        write_file(source, somewhere.encode())
        self._console.tell({"event": "examining", "vehicle": self._configuration.vehicle.connect})
        return examine(relay, source, self._configuration.vehicle, self._data / "state")

    def _simulator(self, address: str, policy: Policy) -> Refusal | None:
        """Start the simulated vehicle at the policy's home, which returns at the policy's height."""
        home, height = policy.projection, policy.vehicle.return_altitude
        words = [f"--home={home.latitude / 1e7:.7f},{home.longitude / 1e7:.7f},{HOME.amsl_mm / 1000:g}"]
        if height:
            name, unit = ("RTL_RETURN_ALT", 1000) if self._request.flavour is AutopilotKind.PX4 else ("RTL_ALT", 10)
            words.append(f"--parameter={name}={height / unit:g}")
        port = address.rpartition(":")[2]
        try:
            vehicle = Simulator(["--port", port, "--stock", *words, *self._request.simulator])
        except SimulatorError as error:
            return Refusal("simulator", str(error), "", ExitCode.USAGE if error.usage else ExitCode.LINK)
        self._stack.callback(vehicle.stop)
        return None

    # ---------------------------------------------------------------- the policy

    def _policy(self) -> PolicyInForce | Refusal:
        """The policy, from the configuration's sources or from the rules of the command line."""
        roles = [each.role for each in self._configuration.clients if not each.pilot]
        configuration = self._configuration
        if self._request.quick is None:
            store = KeyStore(self._data)
            return policy_in_force(
                configuration.sources, configuration.bundle, self._work, roles, store, self._unlock(store)
            )
        home, return_mm = self._place(self._request.quick)
        text = policy_text(self._request.quick, home, return_mm, self._version)
        if isinstance(text, Refusal):
            return text
        source = self._work / SOURCE
        if not self._text:
            if self._request.save is not None and (refusal := self._save(text)) is not None:
                return refusal
            self._console.tell({"event": "policy", "text": text})
        self._text = text
        write_file(source, text.encode())
        store = development_keys(self._data, (POLICY,))
        return policy_in_force([source], None, self._work, roles, store, self._unlock(store))

    def _place(self, quick: QuickRules) -> tuple[GeoPoint, int]:
        """Home and the height of a return: as the vehicle reports, or where the simulated vehicle will start."""
        if self._facts is not None:
            return self._facts.home, min(self._facts.return_mm or _RETURN_MM, quick.below_mm)
        home = _home()
        if quick.area and isinstance(policy_text(quick, home, _RETURN_MM), Refusal):
            home = start_inside(quick.area)
        return home, min(_RETURN_MM, quick.below_mm)

    def _renewed(self, frames: VehicleFrames | None, now: Now) -> PolicyInForce | None:
        """The one-minute policy again, if the vehicle has landed away from its home."""
        if self._request.quick is None or frames is None:
            return None
        place = frames.landed_at(now)
        policy = frames.policy
        if place is None or max(map(abs, place)) <= policy.vehicle.home_within // 2:
            return None
        before = self._text, self._version
        self._version += 1
        home = GeoPoint(*unproject(policy.projection, *place))
        self._facts = (self._facts or VehicleFacts(home, policy.vehicle.return_altitude))._replace(home=home)
        renewed = self._policy()
        if isinstance(renewed, Refusal):
            self._text, self._version = before
            self._console.tell({"event": "note", "text": f"the policy keeps its home: {renewed.text}"})
            return None
        away_mm = isqrt(place[0] ** 2 + place[1] ** 2) // 100 * 100
        why = f"the vehicle landed {display(away_mm, Dimension.LENGTH)} from its home"
        lines = difflib.ndiff(before[0].splitlines(), self._text.splitlines())
        changed = [line for line in lines if line[:1] in "+-"]
        self._console.tell({"event": "policy", "text": self._text, "why": why, "changed": changed})
        if self._request.save is not None:
            self._save_renewed(self._request.save, before[1])
        return renewed

    def _save_renewed(self, folder: Path, version: int) -> None:
        """Write the renewed policy in the place of the saved one, which is kept beside it by its version."""
        saved, kept = folder / SOURCE, folder / f"policy-{version}.rts"
        try:
            if saved.exists():
                write_file(kept, read_regular(saved, MAX_SIZE))
            write_file(saved, self._text.encode())
        except OSError as error:
            text = f"cannot write the renewed policy to `{folder}`: {words_of(error)}"
            self._console.tell({"event": "note", "text": text})

    def _save(self, text: str) -> Refusal | None:
        """Write the policy and the configuration, so that an engineer can go on with them."""
        assert self._request.save is not None
        files = {SOURCE: text.encode(), FILE: configuration_text(self._configuration).encode()}
        folder = self._request.save
        try:
            taken = lay(files, folder)
        except OSError as error:
            return Refusal("output", f"cannot write to `{folder}`: {words_of(error)}", "", exit_code_of(error))
        if taken is None:
            return None
        there = ", ".join(f"`{each}`" for each in taken.paths)
        return Refusal("exists", f"these exist already: {there}", "choose an empty folder for `--save`", ExitCode.INPUT)

    # ---------------------------------------------------------------- the flight

    def _words(self, policy: PolicyInForce) -> FlightWords:
        """The options of each session's `rtshcua run`."""
        vehicle, configuration = self._configuration.vehicle, self._configuration
        sockets = self._work / "agent.sock", self._request.operator_socket or self._work / "operator.sock"
        state = self._work / "state" if self._simulated else configuration.state or self._data / "state"
        make_folder(state, mode=PRIVATE_FOLDER)
        options = [
            "--wait", "--live", "--vehicle", vehicle.identity or policy.missions.policy.vehicle.identity,
            "--runs", str(configuration.runs),
            "--state-dir", str(state), "--agent-socket", str(sockets[0]), "--operator-socket", str(sockets[1]),
        ]  # fmt: skip
        named = {
            "--signing-key": vehicle.signing_key, "--system": vehicle.system, "--utc-error": self._utc_error(vehicle),
            "--passphrase-file": self._request.passphrase_file,
        }  # fmt: skip
        options += [word for name, value in named.items() if value is not None for word in (name, str(value))]
        options += ["--unsigned-radio"] if vehicle.unsigned_radio else []
        options += [word for each in (*vehicle.settings, *self._settings(policy)) for word in ("--set", each)]
        environment = {"RTSHCUA_DATA_DIR": str(self._data.absolute())}
        return FlightWords(tuple(options), sockets[0], environment, KeyStore(self._data).root_path)

    def _utc_error(self, vehicle: VehicleSide) -> str | None:
        """The bound on the error of UTC that a flight is told: the simulated vehicle shares this machine's clock."""
        if vehicle.utc_error is not None or not self._simulated or kernel_error_us() is not None:
            return vehicle.utc_error
        counts = vehicle_counts(apart=program() is not None, keyed=vehicle.signing_key is not None)
        return None if counts else _UTC_ERROR

    def _settings(self, policy: PolicyInForce) -> Iterator[str]:
        """The policy's return height, if the vehicle's own differs: it is restored after each flight."""
        facts, height = self._facts, policy.missions.policy.vehicle.return_altitude
        if facts is not None and facts.return_mm != height and facts.return_name:
            yield f"{facts.return_name}={height / facts.return_unit_mm:g}"

    def _introduce(self, policy: PolicyInForce, relay: StartedRelay, words: FlightWords) -> None:
        clients = [
            {
                "name": each.name, "address": each.address, "opened": opened, "connect": reached(opened),
                "pilot": each.pilot, "role": each.role,
            }
            for each, opened in zip(self._configuration.clients, relay.bound, strict=True)
        ]  # fmt: skip
        self._console.tell(
            {
                "event": "ready",
                "policy": f"{policy.missions.policy.name}@{policy.missions.policy.version}",
                "vehicle": self._configuration.vehicle.connect or f"simulated {self._request.flavour}",
                "clients": clients,
                "operator_socket": words.options[words.options.index("--operator-socket") + 1],
                "runs": str(self._configuration.runs),
                "keys": str(self._data),
                "development": self._request.quick is not None,
                "saved": None if self._request.save is None else str(self._request.save),
            }
        )


def configuration_text(configuration: GatewayConfiguration) -> str:
    """Return a configuration as `gateway.toml`, beside its policy."""
    vehicle = configuration.vehicle
    lines = [
        "# The configuration of `rtshcua gateway gateway.toml`: docs/gateway.md.",
        "",
        "[vehicle]",
        '# connect = "serial:/dev/ttyAMA0:921600"  # without it, the simulated vehicle is started'
        if vehicle.connect is None
        else f"connect = {_quoted(vehicle.connect)}",
        *([] if vehicle.identity is None else [f"identity = {_quoted(vehicle.identity)}"]),
        *([] if vehicle.signing_key is None else [f"signing-key = {_quoted(str(vehicle.signing_key.absolute()))}"]),
        *(["unsigned-radio = true"] if vehicle.unsigned_radio else []),
        *([] if vehicle.system is None else [f"system = {vehicle.system}"]),
        *([] if vehicle.utc_error is None else [f"utc-error = {_quoted(vehicle.utc_error)}"]),
        *([f"set = [{', '.join(map(_quoted, vehicle.settings))}]"] if vehicle.settings else []),
        "",
        "[policy]",
        f"sources = [{_quoted(SOURCE)}]",
        "",
        "[keys]",
        "# Development keys. For a vehicle of yours: `rtshcua keys init --encrypted`, and remove this line.",
        f"folder = {_quoted(DEVELOPMENT)}",
    ]
    for each in configuration.clients:
        lines += ["", f"[clients.{each.name}]", f"address = {_quoted(each.address)}", *_client_lines(each)]
    return "\n".join(lines) + "\n"


def _client_lines(side: ConfiguredClient) -> Iterator[str]:
    plain = ConfiguredClient(side.name, side.address)
    if side.pilot:
        yield "pilot = true  # full passage to the vehicle"
        return
    yield f"role = {_quoted(side.role or OPERATOR)}"
    for key in ("rank", "rate", "peers"):
        if getattr(side, key) != getattr(plain, key):
            yield f"{key} = {getattr(side, key)}"
    if side.requests != plain.requests:
        yield f"requests = [{', '.join(map(_quoted, sorted(side.requests)))}]"


def _quoted(text: str) -> str:
    """A basic string of TOML, whose escapes are those of JSON."""
    return json.dumps(text, ensure_ascii=False)


def _home() -> GeoPoint:
    return GeoPoint(HOME.latitude, HOME.longitude)


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((_LOCAL, 0))
        return int(probe.getsockname()[1])
