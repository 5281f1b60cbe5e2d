"""A run with the link's key flies a simulated vehicle that obeys nothing that is not signed."""

from typing import Any

KEY = b"shared/traces test key, 32 bytes"


def test_a_run_with_the_key_flies_a_vehicle_that_insists_on_it(ground: Any, port: int) -> None:
    path = ground.folder / "link.key"
    path.write_bytes(KEY)
    path.chmod(0o600)
    words = ("--flavour", "ardupilot", "--speed", "20", "--signing-key", str(path), "--json")
    ground.start("sim", "--port", str(port), *words).until("ready")
    link = ("--connect", f"udpin:127.0.0.1:{port}", "--vehicle", "quad-07")
    run = ground.run(ground.bundle(), *link, "--signing-key", str(path), "--unsigned-radio").end()
    assert run.code == 0, "\n".join(map(str, run.events))
    assert run.dispatched()[0] == "takeoff"
