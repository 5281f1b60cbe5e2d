"""Attestation tokens, verified by a library that is not ours (`cwt`), in an environment of its own."""

import json
import subprocess
import sys
import venv
from base64 import b64decode
from pathlib import Path
from typing import Any

import pytest

from boundary.secure_world import needs_emulator
from boundary.trusted_application import needs_optee
from rtshcua.wire.keys import Duty

pytestmark = pytest.mark.clients

PINS = Path(__file__).resolve().parents[2] / "requirements/attestation.txt"
VERIFY = """
import json, sys
from cwt import COSE, COSEKey
import cbor2
token, public = bytes.fromhex(sys.argv[1]), bytes.fromhex(sys.argv[2])
kid = bytes.fromhex(sys.argv[3])
key = COSEKey.new({1: 1, 2: kid, 3: -19, -1: 6, -2: public})
claims = cbor2.loads(COSE.new().decode(token, key))
(form, measured), = claims[273]
content = cbor2.loads(measured)
print(json.dumps({"nonce": claims[10].hex(), "profile": claims[265], "boots": claims[267], "debug": claims[263],
                  "format": form, "algorithm": content[1], "code": content[2].hex(), "mode": claims[-70001]}))
"""


@pytest.fixture(scope="module")
def outside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Python with that library alone."""
    place = tmp_path_factory.mktemp("cwt")
    venv.create(place, with_pip=False, symlinks=True)
    python = place / "bin/python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "--disable-pip-version-check", "install", "--quiet"]
    made = subprocess.run(
        [*pip, "--require-hashes", "-r", str(PINS)], capture_output=True, text=True, check=False, timeout=300
    )
    assert made.returncode == 0, made.stderr
    return python


@pytest.mark.parametrize(
    "mode",
    [
        "process",
        pytest.param("trustzone-m", marks=needs_emulator),
        pytest.param("optee", marks=[needs_optee, pytest.mark.soak]),
    ],
)
def test_token_of_a_flight_is_verified_by_another_library(mode: str, ground: Any, outside: Path) -> None:
    flown = ground.run(ground.bundle(), "--mode", mode, speed=10).end()
    assert flown.code == 0, flown.stderr
    records = flown.log()
    (token,) = [b64decode(record["detail"]) for record in records if record.get("event") == "attested"]
    key = ground.store.signing_key(Duty.BOUNDARY)
    words = [str(outside), "-c", VERIFY, token.hex(), key.public.hex(), key.kid.hex()]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    claims = json.loads(done.stdout)
    assert claims["nonce"] == records[0]["boot"]
    assert (claims["mode"], claims["profile"], claims["boots"]) == (mode, "tag:rtshcua,2026:boundary", 1)
    assert (claims["format"], claims["algorithm"]) == (60, -16)
    assert claims["debug"] == (1 if mode == "process" else 0)
    spoilt = [*words[:3], (token[:-1] + bytes([token[-1] ^ 1])).hex(), *words[4:]]
    assert subprocess.run(spoilt, capture_output=True, check=False).returncode != 0
