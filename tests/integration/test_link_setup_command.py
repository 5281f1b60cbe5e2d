"""`rtshcua keys link --connect` sets the key of a vehicle in a separate process and reports the result."""

from pathlib import Path

import pytest

from integration.test_doctor_command import free_port
from rtshcua.adapters import link_setup
from rtshcua.adapters.link_setup import SetUp
from rtshcua.adapters.simulator import Simulator
from rtshcua.adapters.store.signing import read_link_key, write_link_key
from rtshcua.app import key_management
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli import app

AT = "udpin:127.0.0.1:{}"


@pytest.mark.slow
def test_link_key_is_set_over_udp(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port, path = free_port(), tmp_path / "link.key"
    with Simulator(["--port", str(port), "--flavour", "ardupilot"]):
        assert app.main(["keys", "link", str(path), "--connect", AT.format(port), "--trusted-link"]) == ExitCode.OK
    told = capsys.readouterr()
    assert "ardupilot 4.7.0, system 1: disarmed, on the ground; the key was sent" in told.out
    assert "answers an unsigned request   no" in told.out
    assert "SERIAL0" in told.out
    key = read_link_key(path)
    assert key.hex() not in told.out + told.err


SEEN = SetUp("ardupilot", 1, (4, 7, 0), False, True, True, False, ("\x1b[2Jhello",))


@pytest.mark.parametrize(
    ("seen", "code", "slug"),
    [
        (SEEN, ExitCode.OK, None),
        (
            SEEN._replace(answers_unsigned=True),
            ExitCode.REFUSED,
            "the vehicle has the key, but accepts unsigned commands on this link",
        ),
        (SEEN._replace(signs=False, answers_unsigned=True), ExitCode.REFUSED, "the key has no effect on this link"),
        (SEEN._replace(answers_signed=False, answers_unsigned=True), ExitCode.REFUSED, "no effect"),
        (SEEN._replace(release=None, already=True), ExitCode.OK, None),
        (Refusal("armed", "the motors are armed"), ExitCode.REFUSED, "the motors are armed"),
        (Refusal("no-vehicle", "no heartbeat"), ExitCode.LINK, "no heartbeat"),
        (Refusal("no-answer", "it answers nothing"), ExitCode.LINK, "it answers nothing"),
    ],
)
def test_observed_result_is_reported(
    seen: SetUp | Refusal, code: ExitCode, slug: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path = tmp_path / "link.key"
    write_link_key(path, bytes(range(32)))
    monkeypatch.setattr(key_management, "carry_out", lambda *_: seen)
    assert app.main(["keys", "link", str(path), "--connect", AT.format(free_port()), "--trusted-link"]) == code
    told = capsys.readouterr()
    assert (slug or "") in told.err
    assert "\x1b" not in told.out
    assert bytes(range(32)).hex() not in told.out + told.err


def test_invalid_options_are_refused_before_sending(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(link_setup.LinkSetup, "__init__", lambda *_, **__: pytest.fail("nothing is to be sent"))
    path = tmp_path / "link.key"
    at = ["--connect", AT.format(free_port())]
    for words, code, says in (
        (at, ExitCode.USAGE, "requires `--trusted-link`"),
        (["--trusted-link"], ExitCode.USAGE, "`--connect`"),
        (["--system", "2"], ExitCode.USAGE, "`--connect`"),
        (["--connect", "nonsense", "--trusted-link"], ExitCode.USAGE, "nonsense"),
    ):
        assert app.main(["keys", "link", str(path), *words]) == code
        assert says in capsys.readouterr().err
        assert not path.exists(), "no key is made either"
    path.write_text("short")
    path.chmod(0o600)
    assert app.main(["keys", "link", str(path), *at, "--trusted-link"]) == ExitCode.INPUT
    path.unlink()
    taken = ["--connect", "serial:/dev/null:57600", "--trusted-link"]
    assert app.main(["keys", "link", str(path), *taken]) == ExitCode.LINK
    words = ["--passphrase-file", str(path)]
    assert app.main(["keys", "link", str(path), *words, *at, "--trusted-link"]) == ExitCode.REFUSED, "not overwritten"
