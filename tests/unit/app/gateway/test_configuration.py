"""A gateway's configuration is read strictly, with the nearest fix, and what `--save` writes is read again."""

from pathlib import Path

import pytest

from rtshcua.app.gateway.configuration import (
    DEFAULT_CLIENTS,
    ConfiguredClient,
    GatewayConfiguration,
    Misconfigured,
    VehicleSide,
    client_in,
    clients_of,
    distinct,
    pilot_in,
    read_configuration,
)
from rtshcua.app.gateway.starting import DEVELOPMENT, SOURCE, configuration_text
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal

WHOLE = """
runs = "flights"

[vehicle]
connect = "serial:/dev/ttyAMA0:921600"
identity = "quad-07"
signing-key = "quad-07.key"
unsigned-radio = true
system = 7
utc-error = "500ms"
set = ["RTL_RETURN_ALT=30"]

[policy]
sources = ["rules.rts", "site.rts"]
bundle = "base.bundle"

[keys]
folder = "/etc/gateway"
state = "state"

[clients.script]
address = "udpin:0.0.0.0:14560"
role = "surveyor"
rank = 2
requests = ["parameters", "messages"]
rate = 50
peers = 1

[clients.qgc]
address = "udpout:127.0.0.1:14550"
pilot = true
"""


def read(folder: Path, text: str) -> GatewayConfiguration | Refusal:
    path = folder / "gateway.toml"
    path.write_text(text)
    return read_configuration(path)


def test_paths_are_those_from_the_folder_of_the_file(tmp_path: Path) -> None:
    found = read(tmp_path, WHOLE)
    assert found == GatewayConfiguration(
        VehicleSide(
            "serial:/dev/ttyAMA0:921600", "quad-07", 7, tmp_path / "quad-07.key", True, "500ms", ("RTL_RETURN_ALT=30",)
        ),
        (
            ConfiguredClient(
                "script", "udpin:0.0.0.0:14560", "surveyor", 2, False, frozenset({"parameters", "messages"}), 50, 1
            ),
            ConfiguredClient("qgc", "udpout:127.0.0.1:14550", pilot=True),
        ),
        (tmp_path / "rules.rts", tmp_path / "site.rts"),
        tmp_path / "base.bundle",
        Path("/etc/gateway"),
        tmp_path / "state",
        tmp_path / "flights",
    )


WRONG = {
    "an unknown table": ("[vehicel]\n", "unknown key `vehicel`", "did you mean `vehicle`?"),
    "an unknown key": ('[vehicle]\nconect = "x"\n', "unknown key `conect`", "did you mean `connect`?"),
    "a wrong address": ('[vehicle]\nconnect = "udpin:1"\n', "port of the link is missing", "write it as"),
    "a client without address": ("[clients.a]\nrank = 1\n", "`[clients.a]` has no `address`", 'address = "udpin:'),
    "a rank out of range": ('[clients.a]\naddress = "tcpin:0.0.0.0:5760"\nrank = 101\n', "is 101", "from 0 to 100"),
    "a kind of request": (
        '[clients.a]\naddress = "tcpin:0.0.0.0:5760"\nrequests = ["params"]\n',
        "`params` is not a kind of request",
        "did you mean `parameters`?",
    ),
    "one address twice": (
        '[clients.a]\naddress = "tcpin:0.0.0.0:5760"\n[clients.b]\naddress = "tcpin:0.0.0.0:5760"\n',
        "`a` and `b` have the same address",
        "the address says who speaks",
    ),
    "a name": ('[clients.A]\naddress = "tcpin:0.0.0.0:5760"\n', "`A` cannot be the name", "lower-case"),
    "a parameter": ('[vehicle]\nset = ["RTL"]\n', "`RTL` is not NAME=NUMBER", "RTL_RETURN_ALT"),
    "no TOML": ("[vehicle\n", "not valid TOML", ""),
    "an empty text": ('[vehicle]\nidentity = ""\n', "`identity` is empty", "accepted"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_configuration_is_refused_with_the_nearest_fix(tmp_path: Path, what: str) -> None:
    text, said, help = WRONG[what]
    found = read(tmp_path, text)
    assert isinstance(found, Refusal)
    assert found.slug == "configuration"
    assert said in found.text
    assert help in (found.help or "")


def test_logs_are_kept_beside_the_configuration_by_default(tmp_path: Path) -> None:
    found = read(tmp_path, '[policy]\nsources = ["rules.rts"]\n')
    assert isinstance(found, GatewayConfiguration)
    assert found.runs == tmp_path / "runs"


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    missing = read_configuration(tmp_path / "none.toml")
    assert isinstance(missing, Refusal)
    assert missing.code is ExitCode.INPUT
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe")
    assert isinstance(read_configuration(tmp_path / "binary.toml"), Refusal)
    (tmp_path / "large.toml").write_bytes(b"#" * (1 << 19))
    assert isinstance(read_configuration(tmp_path / "large.toml"), Refusal)
    assert isinstance(read(tmp_path, "a = " + "[" * 100_000), Refusal)


def test_what_is_saved_is_read_again(tmp_path: Path) -> None:
    before = read(tmp_path, WHOLE)
    assert isinstance(before, GatewayConfiguration)
    found = read(tmp_path, configuration_text(before))
    assert isinstance(found, GatewayConfiguration)
    assert found.clients == before.clients
    assert found.vehicle == before.vehicle
    assert found.sources == (tmp_path / SOURCE,)
    assert found.data == tmp_path / DEVELOPMENT
    plain = read(tmp_path, configuration_text(GatewayConfiguration(clients=DEFAULT_CLIENTS)))
    assert isinstance(plain, GatewayConfiguration)
    assert plain.clients == DEFAULT_CLIENTS
    assert plain.vehicle == VehicleSide()


def test_clients_of_the_command_line() -> None:
    made = client_in("script=udpin:0.0.0.0:14560,role=surveyor,rank=2,requests=time+logs,rate=9,peers=2")
    assert made == ConfiguredClient(
        "script", "udpin:0.0.0.0:14560", "surveyor", 2, False, frozenset({"time", "logs"}), 9, 2
    )
    assert client_in("a=serial:/dev/ttyUSB0:57600").requests == ConfiguredClient("a", "").requests
    assert client_in("a=tcpin:0.0.0.0:1,requests=").requests == frozenset()
    assert pilot_in("udpin:0.0.0.0:14550") == ConfiguredClient("pilot", "udpin:0.0.0.0:14550", pilot=True)


@pytest.mark.parametrize(
    ("text", "said", "help"),
    [
        ("udpin:0.0.0.0:14560", "is not NAME=ADDRESS", "as in `--client"),
        ("a=udpin:0.0.0.0:14560,rol=x", "`rol=x` is not an option", "did you mean `role=...`?"),
        ("a=udpin:0.0.0.0:14560,rank=two", "`rank=two` is out of range", "from 0 to 100"),
        ("a=udpin:0.0.0.0:14560,role=a b", "`a b` is not a role", "`operator`"),
        ("a=udp:0.0.0.0:14560", "`udp` is not a kind of link", "udpin"),
        ("a=udpin:0.0.0.0:14560,requests=params", "`params` is not a kind of request", "`parameters`"),
    ],
)
def test_wrong_clients_of_the_command_line(text: str, said: str, help: str) -> None:
    with pytest.raises(Misconfigured) as caught:
        client_in(text)
    assert said in caught.value.refusal.text
    assert help in (caught.value.refusal.help or "")


def test_no_client_meets_the_vehicle_at_its_port() -> None:
    sitl = GatewayConfiguration(VehicleSide("udpin:127.0.0.1:14540"))
    assert [each.name for each in clients_of(sitl)] == ["station", "tcp"]
    assert clients_of(GatewayConfiguration()) == DEFAULT_CLIENTS
    for own, vehicle in (
        ("udpout:127.0.0.1:14550", "udpin:0.0.0.0:14550"),
        ("udpin:127.0.0.1:14550", "udpin:0.0.0.0:14550"),
        ("serial:/dev/ttyUSB0:57600", "serial:/dev/ttyUSB0:57600"),
    ):
        with pytest.raises(Misconfigured, match="is the vehicle's"):
            clients_of(GatewayConfiguration(VehicleSide(vehicle), (ConfiguredClient("a", own),)))
    remote = GatewayConfiguration(
        VehicleSide("udpin:0.0.0.0:14550"), (ConfiguredClient("a", "udpout:192.168.1.9:14550"),)
    )
    assert clients_of(remote) == remote.clients


def test_names_are_distinct() -> None:
    with pytest.raises(Misconfigured, match="two clients are named `pilot`"):
        distinct([client_in("pilot=tcpin:0.0.0.0:1"), pilot_in("tcpin:0.0.0.0:2")])
