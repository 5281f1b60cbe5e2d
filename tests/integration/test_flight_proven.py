"""A real flight, of which single records are shown to someone who gets neither its log nor its keys."""

from typing import Any

FILES = ("whole", "part", "receipt", "since")


def test_records_of_a_flight_are_proven_without_its_log(ground: Any) -> None:
    run = ground.run(ground.bundle()).end()
    assert run.code == 0, run.stderr
    assert (run.folder / "log.secret").stat().st_mode & 0o777 == 0o600
    records = run.log()
    number = next(record["seq"] for record in records if record["type"] == "decision")
    words = ([str(number)], [str(number), "--redact", "state,context"], [str(number), "--cose"], ["--since", "0"])
    for name, asked in zip(FILES, words, strict=True):
        assert ground.start("prove", str(run.folder), *asked, "-o", name, "--json").end().code == 0
    for path in run.folder.iterdir():
        path.unlink()
    verified = ground.start("verify-proof", *FILES, "--json").end()
    assert verified.code == 0, verified.events
    whole, part, receipt, since = verified.events
    assert whole["record"] == receipt["record"] == records[number]
    shown = {key: value for key, value in records[number].items() if key not in part["withheld"]}
    assert (part["record"], part["withheld"]) == (shown, ["_prev", "context", "state"])
    assert (since["kind"], since["size"]) == ("consistency", len(records) - 1)
