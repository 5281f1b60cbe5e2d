"""Print the result of a proof verification, as text or JSON."""

from pathlib import Path

import msgspec

from rtshcua.app.pin import Pin
from rtshcua.app.proof_verification import ProofResult
from rtshcua.app.wording import many, shorten, utc
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Claim, Flaw
from rtshcua.evidence.proofs.check import Proven
from rtshcua.evidence.proofs.cose_receipt import ReceiptClaim
from rtshcua.evidence.proofs.file import ProofKind
from rtshcua.evidence.proofs.trust import LogName
from rtshcua.evidence.records import encode
from rtshcua.front.cli.render.claims import listed, write

_SHOWN = 160
_HELPS = {"trust/root-unknown-key": "if the flight used another trust root, name it or its public key with `--root`"}


def as_object(result: ProofResult, path: Path, pinned: Pin, code: ExitCode) -> dict[str, object]:
    """Return the result as a JSON object. Members are only ever added."""
    told: dict[str, object] = {
        "proof": str(path),
        "verdict": "refused" if isinstance(result, Flaw) else "proven",
        "exit_code": int(code),
        "pinned": {"key": pinned.key.hex(), "source": pinned.source},
        "failure": result._asdict() if isinstance(result, Flaw) else None,
    }
    if isinstance(result, Flaw):
        return told
    name = _name(result)
    told |= {
        "kind": _kind(result),
        "log": {"origin": name.origin, "vehicle": name.vehicle, "boot": name.boot},
        "log_key": _key(result),
        "size": result.size if isinstance(result, ReceiptClaim) else result.checkpoint.size,
        "record": _record(result),
        "proven": [claim._asdict() for claim in claims(result)[0]],
        "not_proven": [claim._asdict() for claim in claims(result)[1]],
    }
    if isinstance(result, Proven):
        heads = {"checkpoint": result.checkpoint, "older": result.older}
        told |= {
            key: None if head is None else {"size": head.size, "root": head.root.hex()} for key, head in heads.items()
        }
        told["anchored"] = result.believed.anchored
        told["witnesses"] = [{"name": each.name, "time_s": each.time_s} for each in result.believed.cosigned]
    return told


def as_text(result: ProofResult, path: Path, pinned: Pin, *, kept: bool, first: bool) -> None:
    """Print the result for a person."""
    lines: list[tuple[str, str]] = [] if first else [("", "")]
    if isinstance(result, Flaw):
        lines += [("bold red", f"REFUSED  {visible(str(path))}"), ("", f"  {visible(result.text)}")]
        lines += [
            ("", f"  {word}  {shorten(visible(text), _SHOWN)}")
            for word, text in (("found   ", result.found), ("expected", result.expected))
            if text
        ]
        if help := _HELPS.get(result.slug):
            lines.append(("", f"  {help}"))
    else:
        name = _name(result)
        lines += [
            ("bold green", f"PROVEN  {visible(str(path))}"),
            ("", f"  vehicle  {visible(name.vehicle)}, boot {name.boot}"),
            ("", f"  pinned   {visible(pinned.source)}"),
        ]
        lines += _fields(result)
        proven, unproven = claims(result)
        if kept:
            proven.append(Claim("checkpoint", "the log contains the checkpoint that you kept"))
        lines += listed("Proven", "green", "+", proven) + listed("Not proven", "yellow", "-", unproven)
    write(lines)


def claims(result: Proven | ReceiptClaim) -> tuple[list[Claim], list[Claim]]:
    """Return the claims that the proof proves, and those that it does not."""
    key = f"log key {_key(result)}, which the trust root names for `{_name(result).vehicle}`"
    last = "that no record was added, and the contents of other records: `verify-log` proves a log"
    rewritten = "unanchored: too few witnesses cosigned it, so a holder of the log key could have rewritten it"
    unproven = [Claim("rest", last), Claim("anchor", rewritten)]
    if isinstance(result, ReceiptClaim):
        text = f"record {result.number} is in the log of {many(result.size, 'record')}, signed on export by {key}"
        return [Claim("inclusion", text)], unproven
    size = many(result.checkpoint.size, "record")
    chain = Claim("signature", f"the log of {size} was signed in the chain of keys that begins with {key}")
    match result.kind:
        case ProofKind.INCLUSION:
            what = Claim("inclusion", f"record {result.number} is in the log as signed at {size}")
        case ProofKind.CONSISTENCY:
            before = f"{many(result.number, 'record')} that {'was' if result.number == 1 else 'were'} signed before"
            text = f"the log of {size} begins with the {before}"
            more = f"records added since record {result.number}, and the contents of records: `verify-log` proves a log"
            unproven[0] = Claim("rest", more)
            what = Claim("consistency", f"{text}: none of them was changed, added or removed")
        case ProofKind.RECORD:
            what = Claim("record", f"record {result.number} is a signed record, and is unchanged")
    cosigned = result.believed.cosigned
    if not cosigned:
        return [what, chain], unproven
    seen = ", ".join(f"`{each.name}` {utc(each.time_s * 1_000_000)}" for each in cosigned)
    anchor = Claim("anchor", f"witnesses outside the vehicle cosigned this log at {size}: {seen}")
    return [what, chain, anchor], unproven[:-1] if result.believed.anchored else unproven


def _kind(result: Proven | ReceiptClaim) -> str:
    return "receipt" if isinstance(result, ReceiptClaim) else result.kind.name.lower()


def _name(result: Proven | ReceiptClaim) -> LogName:
    return result.name if isinstance(result, ReceiptClaim) else result.believed.name


def _key(result: Proven | ReceiptClaim) -> str:
    return (result.log_key if isinstance(result, ReceiptClaim) else result.believed.log_key).kid.hex()


def _record(result: Proven | ReceiptClaim) -> dict[str, object] | None:
    """Return the fields of the proven record."""
    if result.record is None:
        return None
    fields: dict[str, object] = msgspec.json.decode(encode(result.record))
    return fields


def _fields(result: Proven | ReceiptClaim) -> list[tuple[str, str]]:
    record = _record(result)
    lines = []
    for key, value in (record or {}).items():
        text = value if isinstance(value, str) else msgspec.json.encode(value).decode()
        shown = utc(value) if key == "utc_us" and isinstance(value, int) else shorten(visible(text), _SHOWN)
        lines.append(("", f"  {key:<16} {shown}"))
    return [("", ""), ("bold", f"Record {result.number}"), *lines] if lines else []
