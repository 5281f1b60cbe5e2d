"""Refusals before a flight: the documented exit code, one clear message, no traceback, and no frame sent."""

import os
import pty
import socket
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest

from rtshcua.adapters import utc
from rtshcua.app.fly import connect
from rtshcua.front.cli.app import main

IDENTITY = ("--vehicle", "quad-07")


@pytest.fixture(autouse=True)
def here(ground: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """In the ground's folder, with little patience, and no simulated vehicle that could be spoken to."""
    monkeypatch.chdir(ground.folder)
    monkeypatch.setattr(connect, "HEARTBEAT_S", 0.3)
    yield
    assert not Path("runs").exists()


def refused(capfd: Any, *words: str) -> tuple[int, str]:
    code = main(["run", *words])
    out, err = capfd.readouterr()
    assert "Traceback" not in err
    assert err.startswith("error[")
    assert out == ""
    return code, err


@pytest.mark.parametrize("words", [(), ("--dry-run",), ("--connect", "PORT", *IDENTITY), ("--wait",)])
def test_expired_bundle_is_refused(
    ground: Any, capfd: Any, port: int, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    """Before a vehicle is looked for; one that is waited with says the policy alone, and may be of any age."""
    monkeypatch.setattr(utc, "kernel_error_us", lambda: 1_000)
    monkeypatch.setattr("rtshcua.app.fly.connect.start_simulator", None)
    if words == ("--wait",):
        words = ("--connect", "PORT", *IDENTITY, "--mode", "software", "--wait", "--agent-socket", "agents")
    link = [f"udpin:127.0.0.1:{port}" if word == "PORT" else word for word in words]
    code, err = refused(capfd, ground.bundle(age_s=100_000), *link)
    said = ("no heartbeat", 8) if "--wait" in words else ("the bundle expired at 2", 5)
    assert (said[0] in err, code) == (True, said[1]), err
    assert ("compile the mission again" in err) == (code == 5)


def test_missing_vehicle_is_refused(ground: Any, capfd: Any, port: int) -> None:
    code, err = refused(capfd, ground.bundle(), "--connect", f"udpin:127.0.0.1:{port}", *IDENTITY)
    assert code == 8
    assert "no heartbeat from a vehicle" in err
    assert "rtshcua sim" in err
    assert not (ground.folder / "runs").exists()


def test_missing_vehicle_leaves_the_bundle_unused(ground: Any, capfd: Any, port: int) -> None:
    bundle = ground.bundle()
    refused(capfd, bundle, "--connect", f"udpin:127.0.0.1:{port}", *IDENTITY)
    assert not (ground.store.folder.parent / "state" / "replay").exists()


def test_busy_port_is_refused(ground: Any, capfd: Any) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        busy = other.getsockname()[1]
        code, err = refused(capfd, ground.bundle(), "--connect", f"udpin:127.0.0.1:{busy}", *IDENTITY)
    assert code == 8
    assert f"cannot listen at `udpin:127.0.0.1:{busy}`: address already in use" in err


def test_line_with_too_little_capacity_is_refused(ground: Any, capfd: Any) -> None:
    far, near = pty.openpty()
    code, err = refused(capfd, ground.bundle(), "--connect", f"serial:{os.ttyname(near)}:9600", *IDENTITY)
    os.close(far)
    os.close(near)
    assert code == 5
    assert "the link carries 960 octets a second" in err
    assert "19200 baud would" in err


def test_foreign_address_is_refused(ground: Any, capfd: Any) -> None:
    assert refused(capfd, ground.bundle(), "--connect", "udpin:203.0.113.7:14550", *IDENTITY)[0] == 8


@pytest.mark.parametrize("text", ["udpin:127.0.0.1", "14550", "udpin:host:99999", "tcp:a:b", "serial:ttyS0:57600"])
def test_malformed_address_is_refused(ground: Any, capfd: Any, text: str) -> None:
    assert refused(capfd, ground.bundle(), "--connect", text, *IDENTITY)[0] == 2


@pytest.mark.slow
def test_changed_bundle_is_refused(ground: Any, capfd: Any) -> None:
    bundle = ground.bundle()
    good = Path(bundle).read_bytes()
    chance = Random(11)
    for at in [0, 1, len(good) - 1, *(chance.randrange(len(good)) for _ in range(40))]:
        bad = bytearray(good)
        bad[at] ^= 1 << chance.randrange(8)
        Path("bad.bundle").write_bytes(bad)
        code, _ = refused(capfd, "bad.bundle")
        # where the byte held the format together it is malformed, elsewhere it fails its signature or digest
        assert code == 4 if at == len(good) - 1 else code in (3, 4), at


@pytest.mark.parametrize("data", [b"", b"\0" * 5_000, b"mission m {}\n", bytes(range(256)) * 9], ids=len)
def test_other_file_is_malformed(ground: Any, capfd: Any, data: bytes) -> None:
    Path("no.bundle").write_bytes(data)
    assert refused(capfd, "no.bundle")[0] == 3


def test_truncated_bundle_is_malformed(ground: Any, capfd: Any) -> None:
    good = Path(ground.bundle()).read_bytes()
    for length in range(1, len(good), len(good) // 17):
        Path("cut.bundle").write_bytes(good[:length])
        assert refused(capfd, "cut.bundle")[0] == 3


def test_source_is_refused_with_the_compile_command(ground: Any, capfd: Any) -> None:
    Path("m.rts").write_text("mission m {}\n")
    code, err = refused(capfd, "m.rts")
    assert code == 3
    assert "`m.rts` is a source, not a bundle" in err
    assert "`rtshcua compile m.rts -o m.bundle`" in err


def test_missing_bundle_is_refused(ground: Any, capfd: Any) -> None:
    code, err = refused(capfd, "none.bundle")
    assert (code, err) == (3, "error[input]: no such file or directory: `none.bundle`\n")


def test_bundle_for_another_vehicle_is_refused(ground: Any, capfd: Any) -> None:
    code, err = refused(capfd, ground.bundle(), "--vehicle", "quad-08")
    assert code == 5
    assert "`quad-08`" in err


def test_mode_none_refuses_a_connected_vehicle(ground: Any, capfd: Any, port: int) -> None:
    code, err = refused(capfd, ground.bundle(), "--mode", "none", "--connect", f"udpin:127.0.0.1:{port}", *IDENTITY)
    assert code == 5
    assert "mode `none`" in err


def test_conflicting_options_are_refused(ground: Any, capfd: Any) -> None:
    for words in (
        ["--connect", "udpin:127.0.0.1:14550", *IDENTITY, "--battery", "50"],
        ["--connect", "udpin:127.0.0.1:14550", *IDENTITY, "--fresh-state"],
        ["--connect", "udpin:0.0.0.0:14550", *IDENTITY, "--speed", "2"],
        ["--connect", "serial:/dev/ttyAMA0:57600", *IDENTITY, "--speed", "2"],
        ["--state-dir", "state", "--fresh-state"],
        ["--battery", "101"],
        ["--fault", "meteor,at=3s"],
        ["--wind", "strong"],
        ["--speed", "0"],
        ["--mode", "sideways"],
    ):
        assert refused(capfd, ground.bundle(), *words)[0] == 2, words


def test_missing_keys_are_refused(ground: Any, capfd: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = ground.bundle()
    monkeypatch.setenv("RTSHCUA_DATA_DIR", str(ground.folder / "nobody"))
    code, err = refused(capfd, bundle)
    assert code == 4
    assert "rtshcua keys init" in err


def test_simulated_vehicle_that_cannot_start_is_reported(
    ground: Any, capfd: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rtshcua.adapters.simulator._MODULE", "rtshcua.no_such_module")
    code, err = refused(capfd, ground.bundle())
    assert code == 8
    assert "the simulated vehicle did not start: " in err


def test_connected_vehicle_must_be_named(ground: Any, capfd: Any, port: int) -> None:
    code, err = refused(capfd, ground.bundle(), "--connect", f"udpin:127.0.0.1:{port}")
    assert code == 2
    assert "`--connect` requires `--vehicle ID`" in err


def test_bundle_for_another_connected_vehicle_is_refused(ground: Any, capfd: Any, port: int) -> None:
    code, _ = refused(capfd, ground.bundle(), "--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-08")
    assert code == 5
