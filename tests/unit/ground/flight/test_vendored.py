"""The vendored library is the file of its package, byte for byte; npm verifies the package's integrity."""

import json
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).parents[4]
VENDOR = CHECKOUT / "rtshcua/ground/flight/templates/vendor"
PACKAGE = CHECKOUT / "build/npm/node_modules/@noble/ed25519"
LOCK = json.loads((CHECKOUT / "requirements/npm/package-lock.json").read_text())["packages"][
    "node_modules/@noble/ed25519"
]


def test_table_names_the_pinned_package() -> None:
    table = (VENDOR / "README.md").read_text()
    assert f"| {LOCK['version']} | `{LOCK['integrity']}` | {LOCK['license']}," in table


@pytest.mark.clients
@pytest.mark.skipif(not PACKAGE.exists(), reason="`.make/clients` did not install packages of npm")
@pytest.mark.parametrize(("ours", "theirs"), [("noble-ed25519.js", "index.js"), ("noble-ed25519.LICENSE", "LICENSE")])
def test_files_are_those_of_the_package(ours: str, theirs: str) -> None:
    assert json.loads((PACKAGE / "package.json").read_text())["version"] == LOCK["version"]
    assert (VENDOR / ours).read_bytes() == (PACKAGE / theirs).read_bytes()
