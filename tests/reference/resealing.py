"""Rewrite a log with all of its keys: number, link, count and sign it, without the evidence code.

`resealed(lines, keys)` takes lines without these parts; `keys` gives the secret seed of a public key;
without a seed, the checkpoint is unchanged, and so are fields named in `keep` in all signed records.
"""

import json
from base64 import b64encode
from collections.abc import Callable, Iterable
from hashlib import sha256
from typing import Any
from urllib.parse import quote

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

Fields = dict[str, Any]


def line_of(fields: Fields) -> bytes:
    """The canonical line of some fields."""
    return json.dumps(fields, ensure_ascii=False, separators=(",", ":"), sort_keys=True).encode() + b"\n"


def leaf_of(line: bytes) -> bytes:
    """Chain link and Merkle leaf of a line."""
    return sha256(b"\0" + line).digest()


def root_of(leaves: list[bytes]) -> bytes:
    """RFC 9162, section 2.1.1, recursively."""
    if len(leaves) < 2:
        return leaves[0] if leaves else sha256(b"").digest()
    half = 1 << (len(leaves) - 1).bit_length() - 1
    return sha256(b"\1" + root_of(leaves[:half]) + root_of(leaves[half:])).digest()


def note_of(origin: str, text: str, seed: bytes) -> str:
    """The signed note of a text."""
    key = Ed25519PrivateKey.from_private_bytes(seed)
    name = sha256(origin.encode() + b"\n\1" + key.public_key().public_bytes_raw()).digest()[:4]
    return f"{text}\n\u2014 {origin} {b64encode(name + key.sign(text.encode())).decode()}\n"


def checkpoint_text(origin: str, fields: Fields, leaves: list[bytes], before: str = "") -> str:
    """The text of a signed record's checkpoint; `before` is the previous text."""
    own = leaf_of(line_of(fields | {"checkpoint": None}))
    lines = [origin, str(len(leaves)), b64encode(root_of(leaves)).decode(), f"record {b64encode(own).decode()}"]
    if "next_key" in fields:
        lines.append(f"key {b64encode(bytes.fromhex(fields['next_key'])).decode()}")
    if before:
        lines.append(f"after {b64encode(sha256(before.encode()).digest()).decode()}")
    return "\n".join(lines) + "\n"


def resealed(
    lines: Iterable[bytes],
    keys: Callable[[str], bytes],
    *,
    keep: Iterable[str] = (),
    text: Callable[[int, str], str] = lambda number, text: text,
    relink: bool = True,
) -> list[bytes]:
    """The rewritten lines. `text` may change the signed text of a record by number."""
    done: list[bytes] = []
    leaves: list[bytes] = []
    origin = log_key = next_key = before = ""
    segment, epoch = 0, -1
    for number, line in enumerate(lines):
        fields = json.loads(line)
        if relink:
            fields |= {"seq": number, "_prev": leaves[-1].hex() if leaves else "0" * 64}
        kind = fields["type"]
        if kind == "genesis":
            origin = f"rtshcua/log/{quote(fields['vehicle'], safe='')}/{fields['boot']}"
            log_key = fields["log_key"]
        if "digest" in fields:
            data = b"".join(done[segment:])
            made = {
                "bytes": len(data), "digest": sha256(data).hexdigest(), "epoch": epoch, "records": len(done) - segment,
            }  # fmt: skip
            fields |= {name: value for name, value in made.items() if name not in keep}
        if "checkpoint" in fields:
            key = log_key if kind in ("genesis", "recover") else next_key
            if "checkpoint" not in keep and (seed := keys(key)):
                signed = text(number, checkpoint_text(origin, fields, leaves, before))
                fields["checkpoint"] = note_of(origin, signed, seed)
            next_key = fields.get("next_key", "")
            before = (fields["checkpoint"] or "").rpartition("\n\n")[0] + "\n"
            segment, epoch = number, epoch + 1
        done.append(line_of(fields))
        leaves.append(leaf_of(done[-1]))
    return done
