"""The writer's side of a log: turns what happened into lines, chained and counted in the tree. Does no I/O."""

from base64 import b64encode
from collections.abc import Callable
from urllib.parse import quote

from msgspec.structs import replace

from rtshcua.evidence.merkle import Tree, leaf_hash
from rtshcua.evidence.note import Checkpoint, sign
from rtshcua.evidence.records import (
    FORMAT,
    VERSION,
    Close,
    Decision,
    Effect,
    Genesis,
    Record,
    RecordedContext,
    RecordedState,
    encode,
)
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome, Reason
from rtshcua.wire.keys import Duty, key_id

START = "0" * 64  # the genesis has no line before it

_OUTCOMES = tuple(outcome.name.lower() for outcome in Outcome)  # by number


def origin_of(vehicle: str, boot: str) -> str:
    """The origin of a log's checkpoints: no spaces and no plus, whatever the vehicle is called."""
    return f"rtshcua/log/{quote(vehicle, safe='')}/{boot}"


class Chain:
    """Where a log stands: the number of the next record, the hash of the last line, the tree over all lines."""

    __slots__ = ("prev", "seq", "tree")

    def __init__(self) -> None:
        self.seq = 0
        self.prev = START
        self.tree = Tree()

    def add(self, record: Record) -> bytes:
        """The line of a record that was made with this chain's `prev` and `seq`; the chain then stands after it."""
        line = encode(record)
        leaf = leaf_hash(line)
        self.tree.push(leaf)
        self.prev = leaf.hex()
        self.seq += 1
        return line


class Recorder:
    """Makes the lines of one log, in order; each method returns one whole line.

    `sign` signs bytes with the Ed25519 key of duty `log` whose public half is `public` (32 bytes); it is called
    once, by `close`. The caller's clock never goes back from call to call, and its integers stay within 2**53 - 1: a
    verifier refuses a log where they do not.
    """

    __slots__ = ("_chain", "_mode", "_origin", "_public", "_sign")

    def __init__(self, sign: Callable[[bytes], bytes], public: bytes) -> None:
        self._sign, self._public = sign, public
        self._chain = Chain()
        self._origin = self._mode = ""

    @property
    def final_hash(self) -> str:
        """The hash of the last line, hexadecimal: `before` in the genesis of the next log."""
        return self._chain.prev

    @property
    def count(self) -> int:
        """The number of records so far."""
        return self._chain.seq

    def genesis(
        self,
        now: Now,
        *,
        bundle: bytes,
        root: bytes,
        boot: bytes,
        vehicle: str,
        mission: str,
        mode: str,
        before: str | None = None,
    ) -> bytes:
        """The first line. `boot` is 16 random bytes; `mode`, the enforcement mode, stands in each decision too."""
        self._mode = mode
        self._origin = origin_of(vehicle, boot.hex())
        return self._chain.add(
            Genesis(
                prev=self._chain.prev,
                at_us=now.monotonic_us,
                before=before,
                boot=boot.hex(),
                bundle=b64encode(bundle).decode(),
                format=FORMAT,
                log_key=self._public.hex(),
                log_kid=key_id(Duty.LOG, self._public).hex(),
                mission=mission,
                mode=mode,
                root=b64encode(root).decode(),
                seq=self._chain.seq,
                type="genesis",
                utc_error_us=now.utc_error_us,
                utc_us=now.utc_us,
                vehicle=vehicle,
                version=VERSION,
            )
        )

    def decision(
        self,
        now: Now,
        *,
        kind: int,
        step: int,
        link: int,
        invocation: bytes,
        state: State,
        context: Context,
        outcome: Outcome,
        reason: Reason,
        rule_step: int,
        clause: str | None,
        clause_at: tuple[int, int, int] | None,
        target: str | None,
        target_link: int,
        valid_until_us: int,
    ) -> bytes:
        """The line of one decision, its inputs included; the fields are those of `Decision`."""
        chain = self._chain
        return chain.add(
            Decision(  # by position, in the order of definition: a third faster than by name
                chain.prev,
                now.monotonic_us,
                context.binding.hex(),
                clause,
                clause_at,
                RecordedContext(
                    tuple([(a.rule, a.role, a.granted, a.monotonic_us) for a in context.approvals]),
                    context.consumed,
                    context.phase,
                    context.policy_version,
                    context.released_us,
                    context.remaining_us,
                    context.vehicle,
                ),
                invocation.hex(),
                kind,
                link,
                self._mode,
                _OUTCOMES[outcome],
                reason.value,
                rule_step,
                chain.seq,
                RecordedState(ages=state.ages, monitors=state.monitors, values=state.values),
                step,
                target,
                target_link,
                "decision",
                now.utc_error_us,
                now.utc_us,
                valid_until_us,
            )
        )

    def effect(
        self, now: Now, event: str, *, kind: int = -1, step: int = -1, link: int = -1, token: int = -1, detail: str = ""
    ) -> bytes:
        """The line of something that happened; `detail` is the world's own text, kept as it came."""
        chain = self._chain
        return chain.add(
            Effect(  # by position, as above
                chain.prev,
                now.monotonic_us,
                _storable(detail),
                event,
                kind,
                link,
                chain.seq,
                step,
                token,
                "effect",
                now.utc_error_us,
                now.utc_us,
            )
        )

    def close(self, now: Now, *, ending: str, tlog: bytes | None) -> bytes:
        """The last line, signed. `tlog` is the SHA-256 of the telemetry log."""
        chain = self._chain
        close = Close(
            prev=chain.prev,
            at_us=now.monotonic_us,
            checkpoint=None,
            count=chain.seq,
            ending=ending,
            seq=chain.seq,
            tlog=None if tlog is None else tlog.hex(),
            type="close",
            utc_error_us=now.utc_error_us,
            utc_us=now.utc_us,
        )
        chain.tree.push(leaf_hash(encode(close)))
        checkpoint = Checkpoint(self._origin, chain.tree.size, chain.tree.root())
        line = encode(replace(close, checkpoint=sign(checkpoint, self._public, self._sign)))
        chain.prev = leaf_hash(line).hex()
        chain.seq += 1
        return line


def _storable(text: str) -> str:
    """The text, with what UTF-8 cannot carry (lone surrogates) replaced: the world's text must not stop a record."""
    return text if text.isascii() else text.encode("utf-8", "replace").decode()
