"""`rtshcua run --dry-run` on a real link: what it says, and that nothing is left of it."""

import json
from typing import Any


def test_it_decides_the_mission_and_leaves_nothing_behind(ground: Any) -> None:
    bundle = ground.bundle()
    run = ground.run(bundle, "--dry-run").end()
    assert run.code == 0, run.stderr
    (said,) = run.events
    assert (said["event"], said["ready"], said["exit_code"]) == ("rehearsal", True, 0)
    assert {step["outcome"] for step in said["steps"]} == {"allow"}
    poor = ground.run(bundle, "--dry-run", "--battery", "30").end()
    assert poor.code == 5
    first = poor.events[0]["steps"][0]
    assert (first["outcome"], first["hopeful"]) == ("fallback", False)
    assert first["nearest"][0]["subject"] == "battery"
    flown = ground.run(bundle).end()
    assert flown.code == 0, json.dumps(flown.events[-1])
