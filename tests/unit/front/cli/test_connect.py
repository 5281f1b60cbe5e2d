"""`--connect`: errors for a link that cannot be opened, or without a vehicle."""

import os
import pty
import socket
import threading
from collections.abc import Iterator
from contextlib import suppress
from random import Random

import pytest

from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.adapters.vehicle.transport import SerialTransport
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from rtshcua.front.cli.commands import doctor


@pytest.fixture(autouse=True)
def _hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "_HEARTBEAT_S", 0.6)


@pytest.fixture
def line() -> Iterator[tuple[str, int]]:
    """A serial device, and the other end of it."""
    far, near = pty.openpty()
    os.set_blocking(far, False)
    yield os.ttyname(near), far
    os.close(near)
    os.close(far)


def says(address: str, capsys: pytest.CaptureFixture[str]) -> tuple[ExitCode, str]:
    code = app.main(["doctor", "--connect", address, "--seconds", "3"])
    return ExitCode(code), capsys.readouterr().err


def test_garbage_is_distinguished_from_no_heartbeat(line: tuple[str, int], capsys: pytest.CaptureFixture[str]) -> None:
    device, far = line
    over, chance = threading.Event(), Random(3)

    def babble() -> None:
        while not over.wait(0.05):  # bytes received before the device was opened are dropped
            with suppress(BlockingIOError):
                os.write(far, chance.randbytes(40))

    thread = threading.Thread(target=babble)
    thread.start()
    code, said = says(f"serial:{device}:57600", capsys)
    over.set()
    thread.join()
    assert code == ExitCode.LINK
    assert "octets arrived, but no MAVLink frame: the baud rate is probably wrong" in said


def test_a_busy_port(line: tuple[str, int], capsys: pytest.CaptureFixture[str]) -> None:
    device, _ = line
    other = SerialTransport(Address(LinkCarrier.SERIAL, device, 57_600))
    code, said = says(f"serial:{device}:57600", capsys)
    other.close()
    assert code == ExitCode.LINK
    assert f"cannot open `serial:{device}:57600`: another program has it open" in said
    assert "ModemManager" in said


def test_unreachable_address_exits_with_link_error(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    code, said = says(f"tcp:127.0.0.1:{port}", capsys)
    assert code == ExitCode.LINK
    assert "connection refused" in said
    code, said = says(f"tcpin:127.0.0.1:{port}", capsys)
    assert code == ExitCode.LINK
    assert "nobody has connected" in said


def test_invalid_serial_address_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    code, said = says("serial:ttyUSB0:57600", capsys)
    assert code == ExitCode.USAGE
    assert said.splitlines() == [
        "error[usage]: `ttyUSB0` is not the path of a device",
        "   --> --connect",
        "    | serial:ttyUSB0:57600",
        "    |        ^^^^^^^",
        " help: a device is an absolute path: write it as `serial:/dev/ttyAMA0:921600`",
    ]


def test_invalid_address_is_reported_before_missing_vehicle(
    capsys: pytest.CaptureFixture[str],
) -> None:
    for address, says_so in (
        ("serial", "the device and baud rate of the link are missing"),
        ("udpin", "the host and port of the link are missing"),
    ):
        assert app.main(["run", "any.bundle", "--connect", address]) == ExitCode.USAGE
        assert says_so in capsys.readouterr().err
    assert app.main(["run", "any.bundle", "--connect", "udpin:127.0.0.1:14550"]) == ExitCode.USAGE
    assert "`--connect` requires `--vehicle ID`" in capsys.readouterr().err
