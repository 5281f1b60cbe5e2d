"""The configuration of a gateway: from `gateway.toml`, from the command line, or from both.

The options of the command line replace what the file says. Reading is strict: an unknown key, a wrong type or an
address that cannot be used is refused, with the nearest accepted value.
"""

import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeVar

from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.vehicle.address import Address, AddressError, LinkCarrier, parse
from rtshcua.app.exit_codes import words_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import listed, nearest
from rtshcua.ground.gateway.interface import REQUESTS
from rtshcua.ground.project.project_settings import misconfigured
from rtshcua.ground.project.strict_tables import SettingError, SettingsTable

#: the name of the file, by default
FILE: Final = "gateway.toml"
_MOST_OCTETS: Final = 1 << 18
OPERATOR: Final = "operator"
_NAME: Final = re.compile(r"[a-z][a-z0-9_-]{0,39}", re.ASCII)
_ROLE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}", re.ASCII)
_SET: Final = re.compile(r"[A-Z0-9_]{1,16}=.+", re.ASCII)
#: the accepted ranges of a client's numbers: rank, frames a second, senders at once
_RANK, _RATE, _PEERS = (0, 100), (1, 10_000), (1, 64)

T = TypeVar("T")


class Misconfigured(Exception):
    """A configuration that cannot be used; `refusal` says why."""

    def __init__(self, refusal: Refusal) -> None:
        super().__init__(refusal.text)
        self.refusal = refusal


@dataclass(frozen=True, slots=True)
class ConfiguredClient:
    """A client side: its own address, its role in the policy, its rank among clients that contradict each other, the
    kinds of harmless requests that are open to it, and its limits: frames a second, senders at once. A `pilot` has full
    passage.
    """

    name: str
    address: str
    role: str = OPERATOR
    rank: int = 0
    pilot: bool = False
    requests: frozenset[str] = frozenset(REQUESTS)
    rate: int = 200
    peers: int = 4


@dataclass(frozen=True, slots=True)
class VehicleSide:
    """The vehicle: its address (None: the simulated vehicle), its identity (None: the policy's), its MAVLink id, the
    key of its link, a bound on the error of UTC, and parameters that are set for each flight.
    """

    connect: str | None = None
    identity: str | None = None
    system: int | None = None
    signing_key: Path | None = None
    unsigned_radio: bool = False
    utc_error: str | None = None
    settings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class GatewayConfiguration:
    """A whole configuration. Relative paths of a file are those from its folder.

    `sources`: of the policy; `bundle`: one that was signed under it (None: it is signed with the key store's policy
    key). `data`: the folder of the key store (None: the user's). `state`: the folder that records which bundles have
    flown.
    """

    vehicle: VehicleSide = VehicleSide()
    clients: tuple[ConfiguredClient, ...] = ()
    sources: tuple[Path, ...] = ()
    bundle: Path | None = None
    data: Path | None = None
    state: Path | None = None
    runs: Path = Path("runs")


#: where clients find the gateway if no client is configured: as they find a vehicle
DEFAULT_CLIENTS: Final = (
    ConfiguredClient("station", "udpout:127.0.0.1:14550"),  # QGroundControl, MAVProxy, pymavlink
    ConfiguredClient("program", "udpout:127.0.0.1:14540"),  # MAVSDK
    ConfiguredClient("tcp", "tcpin:127.0.0.1:5770"),  # whatever connects by TCP; 5760 is ArduPilot's own simulation
)


def reached(address: str) -> str:
    """The address by which a client on this machine reaches one of the gateway's: its other end."""
    for way, other in (("udpout:", "udpin:"), ("udpin:", "udpout:"), ("tcpin:", "tcp:")):
        if address.startswith(way):
            return other + address[len(way) :].replace("0.0.0.0", "127.0.0.1")
    return address


def clients_of(configuration: GatewayConfiguration) -> tuple[ConfiguredClient, ...]:
    """Return the configured clients, or the default ones that do not meet the vehicle at its port. Raises
    `Misconfigured` for a client that would.
    """
    if not configuration.clients:
        return tuple(each for each in DEFAULT_CLIENTS if not _meets(each, configuration.vehicle))
    for each in configuration.clients:
        if _meets(each, configuration.vehicle):
            text = (
                f"the address of `{each.name}`, `{each.address}`, is the vehicle's: `{configuration.vehicle.connect}`"
            )
            raise _wrong(text, "give the client a port of its own")
    return configuration.clients


def _meets(side: ConfiguredClient, vehicle: VehicleSide) -> bool:
    """Whether what is sent to a client arrives at the vehicle's port of this machine, or both have one address."""
    if vehicle.connect is None:
        return False
    own, other = parse(side.address), parse(vehicle.connect)
    if own.way is LinkCarrier.UDP_OUT and other.way is LinkCarrier.UDP_IN:
        return own.port == other.port and own.is_loopback
    listens = (LinkCarrier.UDP_IN, LinkCarrier.TCP_IN)
    return own == other or (own.way is other.way and own.way in listens and own.port == other.port)


# ---------------------------------------------------------------------------------------------------- the file


def read_configuration(path: Path) -> GatewayConfiguration | Refusal:
    """Return the configuration in a file."""
    if path.suffix == ".rts":
        kept = path.with_name(FILE)
        help = f"`rtshcua gateway {kept}`" if kept.is_file() else f"`rtshcua gateway --policy {path}`"
        return misconfigured(str(path), "this is a source of a policy; a configuration is expected", help)
    try:
        data = read_regular(path, _MOST_OCTETS)
        if len(data) > _MOST_OCTETS:
            return misconfigured(str(path), f"it has more than {_MOST_OCTETS >> 10} KiB")
        found = tomllib.loads(data.decode())
    except OSError as error:
        return Refusal("input", f"cannot read `{path}`: {words_of(error)}", "", ExitCode.INPUT)
    except UnicodeDecodeError as error:
        return misconfigured(str(path), f"byte {error.start} is not UTF-8", "save it as UTF-8")
    except tomllib.TOMLDecodeError as error:
        return misconfigured(str(path), f"not valid TOML: {str(error)[:1].lower()}{str(error)[1:]}")
    except RecursionError:
        return misconfigured(str(path), "the configuration is nested too deeply")
    try:
        return _configuration(SettingsTable.of(found, ""), path.parent)
    except SettingError as error:
        return misconfigured(str(path), error.message, error.help)
    except Misconfigured as error:
        return misconfigured(str(path), error.refusal.text, error.refusal.help)


def _configuration(table: SettingsTable, folder: Path) -> GatewayConfiguration:
    vehicle, policy, keys, clients = (table.table(name) for name in ("vehicle", "policy", "keys", "clients"))
    runs = _text(table, "runs", 'a folder, as in `runs = "runs"`')
    table.close()
    sides = tuple(_client(clients.table(name), name) for name in clients.names())
    sources = tuple(folder / each for each in policy.texts("sources"))
    bundle = _text(policy, "bundle", 'a bundle, as in `bundle = "base.bundle"`')
    policy.close()
    data, state = (_text(keys, name, f'a folder, as in `{name} = "keys"`') for name in ("folder", "state"))
    keys.close()
    return GatewayConfiguration(
        _vehicle(vehicle, folder),
        distinct(sides),
        sources,
        None if bundle is None else folder / bundle,
        None if data is None else folder / Path(data).expanduser(),
        None if state is None else folder / Path(state).expanduser(),
        folder / (runs or "runs"),
    )


def _vehicle(table: SettingsTable, folder: Path) -> VehicleSide:
    connect = _text(table, "connect", 'an address, as in `connect = "serial:/dev/ttyAMA0:921600"`')
    key = _text(table, "signing-key", 'a file, as in `signing-key = "quad-07.key"`')
    made = VehicleSide(
        None if connect is None else str(address_in(connect, "connect")),
        _text(table, "identity", 'a string, as in `identity = "quad-07"`'),
        table.number("system", 1, 255),
        None if key is None else folder / key,
        table.flag("unsigned-radio", default=False),
        _text(table, "utc-error", 'a time, as in `utc-error = "500ms"`'),
        table.texts("set"),
    )
    table.close()
    wrong = next((each for each in made.settings if not _SET.fullmatch(each)), None)
    if wrong is not None:
        raise SettingError("set", f"`{wrong}` is not NAME=NUMBER", 'as in `set = ["RTL_RETURN_ALT=30"]`')
    return made


def _client(table: SettingsTable, name: str) -> ConfiguredClient:
    address = _text(table, "address", 'an address, as in `address = "udpin:0.0.0.0:14560"`')
    if address is None:
        raise SettingError(name, f"`[{table.name}]` has no `address`", 'write one: `address = "udpin:0.0.0.0:14560"`')
    plain = ConfiguredClient(checked_name(name), str(address_in(address, name)))
    requests = table.any_of("requests", (list,), f"a list of {listed(REQUESTS)}")
    made = replace(
        plain,
        role=_role(_text(table, "role", 'a role of the policy, as in `role = "operator"`') or OPERATOR),
        rank=_or(table.number("rank", *_RANK), plain.rank),
        pilot=table.flag("pilot", default=False),
        requests=plain.requests if requests is None else requests_in(table.texts("requests")),
        rate=_or(table.number("rate", *_RATE), plain.rate),
        peers=_or(table.number("peers", *_PEERS), plain.peers),
    )
    table.close()
    return made


def _or(value: T | None, default: T) -> T:
    return default if value is None else value


def _text(table: SettingsTable, key: str, accepted: str) -> str | None:
    found = table.any_of(key, (str,), accepted)
    if found is not None and not found.strip():
        raise SettingError(key, f"`{key}` is empty", f"accepted: {accepted}")
    return None if found is None else str(found)


# ---------------------------------------------------------------------------------------------------- the command line


def client_in(text: str) -> ConfiguredClient:
    """Return the client of `--client NAME=ADDRESS[,role=R][,rank=N][,requests=A+B][,rate=N][,peers=N]`. Raises
    `Misconfigured`.
    """
    name, sign, rest = text.partition("=")
    address, *options = rest.split(",")
    if not sign or ":" in name:
        raise _wrong(f"`{text}` is not NAME=ADDRESS", "as in `--client script=udpin:0.0.0.0:14560,role=operator`")
    made = ConfiguredClient(checked_name(name), str(address_in(address, "--client")))
    for option in options:
        key, sign, value = option.partition("=")
        read = _OPTIONS.get(key)
        if read is None or not sign:
            near = nearest(key, _OPTIONS)
            help = f"did you mean `{near}=...`?" if near else f"accepted: {listed(_OPTIONS)}"
            raise _wrong(f"`{option}` is not an option of a client", help)
        made = read(made, value)
    return made


def pilot_in(address: str) -> ConfiguredClient:
    """Return the client of `--pilot ADDRESS`. Raises `Misconfigured`."""
    return ConfiguredClient("pilot", str(address_in(address, "--pilot")), pilot=True)


def _number(key: str, least: int, most: int) -> Callable[[ConfiguredClient, str], ConfiguredClient]:
    def read(side: ConfiguredClient, text: str) -> ConfiguredClient:
        if not (text.isascii() and text.isdigit()) or not least <= int(text) <= most:
            raise _wrong(f"`{key}={text}` is out of range", f"accepted: a whole number from {least} to {most}")
        return replace(side, **{key: int(text)})  # type: ignore[arg-type]  # a field that holds a number

    return read


_OPTIONS: Final[Mapping[str, Callable[[ConfiguredClient, str], ConfiguredClient]]] = {
    "role": lambda side, text: replace(side, role=_role(text)),
    "rank": _number("rank", *_RANK),
    "requests": lambda side, text: replace(side, requests=requests_in(text.split("+") if text else ())),
    "rate": _number("rate", *_RATE),
    "peers": _number("peers", *_PEERS),
}


# ---------------------------------------------------------------------------------------------------- both


def address_in(text: str, where: str) -> Address:
    """Return the address in a text. Raises `Misconfigured`."""
    try:
        return parse(text)
    except AddressError as error:
        raise _wrong(f"{error.text} in `{where}`: `{text}`", error.help) from None


def checked_name(name: str) -> str:
    """Return the name of a client, which appears in logs and messages. Raises `Misconfigured`."""
    if not _NAME.fullmatch(name):
        help = "accepted: at most 40 lower-case letters, digits, `-` and `_`, beginning with a letter"
        raise _wrong(f"`{name}` cannot be the name of a client", help)
    return name


def requests_in(texts: Sequence[str]) -> frozenset[str]:
    """Return the kinds of requests. Raises `Misconfigured`."""
    for text in texts:
        if text not in REQUESTS:
            near = nearest(text, REQUESTS)
            help = f"did you mean `{near}`?" if near else f"accepted: {listed(REQUESTS)}"
            raise _wrong(f"`{text}` is not a kind of request", help)
    return frozenset(texts)


def distinct(sides: Sequence[ConfiguredClient]) -> tuple[ConfiguredClient, ...]:
    """Return the clients if their names and addresses differ. Raises `Misconfigured`."""
    for number, side in enumerate(sides):
        for other in sides[:number]:
            if side.name == other.name:
                raise _wrong(f"two clients are named `{side.name}`", "give each a name of its own")
            if side.address == other.address:
                text = f"`{other.name}` and `{side.name}` have the same address, `{side.address}`"
                raise _wrong(text, "give each an address of its own: the address says who speaks")
    return tuple(sides)


def _role(text: str) -> str:
    if not _ROLE.fullmatch(text):
        raise _wrong(f"`{text}` is not a role", "accepted: a role of the policy, such as `operator`")
    return text


def _wrong(text: str, help: str) -> Misconfigured:
    return Misconfigured(Refusal("usage", text, help))
