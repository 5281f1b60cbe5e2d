"""What `make dist` builds can be built again by anybody: the same bytes, and all that it needs is listed."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.clients
def test_a_wheel_has_the_same_bytes_whoever_builds_it(tmp_path: Path) -> None:
    wheels = []
    for name, mask, zone in (("one", 0o022, "UTC"), ("two", 0o077, "Asia/Tokyo")):
        words = [
            sys.executable,
            "-m",
            "build",
            "--wheel",
            "--no-isolation",
            "--outdir",
            str(tmp_path / name),
            str(CHECKOUT),
        ]
        subprocess.run(words, check=True, capture_output=True, umask=mask, env=os.environ | {"TZ": zone})
        (wheel,) = (tmp_path / name).glob("*.whl")
        wheels.append(wheel.read_bytes())
    assert wheels[0] == wheels[1]


def test_the_bill_of_materials_lists_what_is_needed() -> None:
    said = [
        subprocess.run([sys.executable, ".make/sbom"], cwd=CHECKOUT, check=True, capture_output=True).stdout
        for _ in range(2)
    ]
    assert said[0] == said[1]
    tree = json.loads(said[0])
    assert (tree["bomFormat"], tree["specVersion"]) == ("CycloneDX", "1.5")
    scopes = {each["name"]: each["scope"] for each in tree["components"]}
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert {each.partition(">")[0] for each in project["dependencies"]} <= {
        name for name, scope in scopes.items() if scope == "required"
    }
    assert scopes["duckdb"] == scopes["pygls"] == scopes["distributed"] == "optional"
    names = {each["bom-ref"] for each in tree["components"]} | {tree["metadata"]["component"]["bom-ref"]}
    assert {each["ref"] for each in tree["dependencies"]} == names
