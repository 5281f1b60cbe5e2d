"""Writes logs: turns events into lines that are chained, counted in the tree, and sealed. Does no I/O.

The format is specified in docs/log-format.md.
"""

from base64 import b64encode
from collections.abc import Callable
from typing import Any, Final, Protocol
from urllib.parse import quote

from rtshcua.evidence.epoch_key import EPOCH_RECORDS, EPOCH_US, LONGEST_US, EpochKey
from rtshcua.evidence.gaps import STALLED, detail_of
from rtshcua.evidence.heads import Head
from rtshcua.evidence.records import (
    FORMAT,
    VERSION,
    Close,
    DecisionRecord,
    Effect,
    Genesis,
    RecordedContext,
    RecordedState,
    Recover,
    Seal,
    in_words,
)
from rtshcua.model.decision import Decision as Decided
from rtshcua.model.durability import SYNC_US, SYNCED, WRITTEN
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.wire.keys import Duty, key_id
from rtshcua.wire.request import NOTHING, Ref

#: the effect with the boundary's signed statement of its own evidence (`wire.statement`), in base64
BOUNDARY: Final = "boundary"
#: the effect that reports the permanent loss of the boundary: it makes nothing in the log after that
BOUNDARY_LOST: Final = "boundary-lost"
#: the event of an effect whose detail is what the boundary's home attests of itself (`wire.attestation`), in base64
ATTESTED: Final = "attested"

#: The delay after `EPOCH_US` and `EPOCH_RECORDS` at which an epoch is sealed before anything else is recorded; a
#: fifth.
_LATE = 5
_LATE_US, _LATE_RECORDS = EPOCH_US + EPOCH_US // _LATE, EPOCH_RECORDS + EPOCH_RECORDS // _LATE


class Attest(Protocol):
    """Signs the state of the boundary's own evidence; None if there is no boundary."""

    def __call__(self, now: Now, *, final: bool = False) -> bytes | None:
        """The signed statement at a moment; nothing follows a `final` one."""
        ...


def origin_of(vehicle: str, boot: str) -> str:
    """The origin of a log's checkpoints, without spaces and plus signs."""
    return f"rtshcua/log/{quote(vehicle, safe='')}/{boot}"


class Recorder:
    """Makes the lines of one log, in order; each method returns whole lines.

    `certify` signs bytes with the Ed25519 key of duty `log` whose public half is `public` (32 bytes). It is called
    once, by `genesis` or `recover`, and then dropped. Epoch keys sign the rest; `draw` returns 32 secret random
    bytes for each. The caller's clock must never go back, its UTC and monotonic time must advance alike, and its
    integers must stay within 2**53 - 1: a verifier refuses a log where they do not.

    `attest` signs for the boundary: its statement is recorded before each seal and before the close. Once the
    boundary is `lost`, a text records the loss instead.
    """

    __slots__ = (
        "_certify", "_draw", "_head", "_key", "_last_us", "_mode", "_origin", "_public", "_signed_us", "_told_gap",
        "attest", "lost", "told_loss",
    )  # fmt: skip

    def __init__(self, certify: Callable[[bytes], bytes], public: bytes, draw: Callable[[], bytes]) -> None:
        self._certify: Callable[[bytes], bytes] | None = certify
        self._public = public
        self._draw = draw
        self._head = Head()
        self._key: EpochKey | None = None
        self._origin = self._mode = ""
        self._signed_us = self._last_us = 0  # monotonic time of the last signed record, and of the last record
        self._told_gap = False  # in this epoch
        self.attest: Attest = nobody
        self.lost: Callable[[], str | None] = lambda: None
        #: whether the loss of the boundary was recorded, after which none of its entries are
        self.told_loss = False

    @classmethod
    def resumed(
        cls, head: Head, origin: str, certify: Callable[[bytes], bytes], public: bytes, draw: Callable[[], bytes]
    ) -> "Recorder":
        """A recorder that continues after the records in `head`; its first record must be a `recover`."""
        recorder = cls(certify, public, draw)
        recorder._head, recorder._origin = head, origin
        return recorder

    @property
    def final_hash(self) -> str:
        """The hash of the last line, hexadecimal: `before` in the genesis of the next log."""
        return self._head.prev

    @property
    def count(self) -> int:
        """The number of records so far."""
        return self._head.seq

    def due(self, now: Now) -> bool:
        """Whether the epoch is over: `seal` it when there is nothing else to do."""
        return self._head.records >= EPOCH_RECORDS or now.monotonic_us - self._signed_us >= EPOCH_US

    def overdue(self, now: Now) -> bool:
        """Whether the epoch must be sealed before anything else is recorded."""
        head = self._head
        return now.monotonic_us - self._signed_us >= _LATE_US or head.seq - head.first >= _LATE_RECORDS

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
        received_us: int | None = None,
        sync_us: int = SYNC_US,
    ) -> bytes:
        """The first line. `boot` is 16 random bytes; `mode`, the enforcement mode, is in each decision too.
        `received_us` is the monotonic time of receipt of the bundle; by default, now.
        """
        self._mode = mode
        self._origin = origin_of(vehicle, boot.hex())
        key = EpochKey(self._draw())
        genesis = Genesis(
            prev=self._head.prev,
            at_us=now.monotonic_us,
            before=before,
            boot=boot.hex(),
            bundle=b64encode(bundle).decode(),
            checkpoint=None,
            format=FORMAT,
            log_key=self._public.hex(),
            log_kid=key_id(Duty.LOG, self._public).hex(),
            mission=mission,
            mode=mode,
            next_key=key.public.hex(),
            received_us=now.monotonic_us if received_us is None else received_us,
            root=b64encode(root).decode(),
            seq=self._head.seq,
            sync_us=sync_us,
            type="genesis",
            utc_error_us=now.utc_error_us,
            utc_us=now.utc_us,
            vehicle=vehicle,
            version=VERSION,
        )
        return self._certified(genesis, key)

    def decision(
        self,
        now: Now,
        ref: Ref,
        invocation: bytes,
        state: State,
        context: Context,
        decided: Decided,
        durability: int = SYNCED,
    ) -> bytes:
        """The line of one decision, with its inputs. `invocation` is its id, empty for the contingency."""
        head = self._head
        kind, step, link = ref
        outcome, reason, rule_step, clause, clause_at, target, target_link, valid_until_us = in_words(decided)
        self._last_us = now.monotonic_us
        return head.add(
            DecisionRecord(  # positional arguments: an append with keywords takes 14 % longer (bench/evidence.py)
                head.prev,
                now.monotonic_us,
                context.binding.hex(),
                clause,
                clause_at,
                RecordedContext(
                    _approvals(context) if context.approvals else (),
                    context.consumed,
                    context.phase,
                    context.policy_version,
                    context.released_us,
                    context.remaining_us,
                    context.vehicle,
                ),
                durability,
                invocation.hex(),
                kind,
                link,
                self._mode,
                outcome,
                reason,
                rule_step,
                head.seq,
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
        self,
        now: Now,
        event: str,
        ref: Ref = NOTHING,
        *,
        token: int = -1,
        detail: str = "",
        durability: int = WRITTEN,
    ) -> bytes:
        """The line of an event; `detail` is text from outside, recorded unchanged."""
        head = self._head
        kind, step, link = ref
        self._last_us = now.monotonic_us
        return head.add(
            Effect(
                prev=head.prev,
                at_us=now.monotonic_us,
                detail=detail if detail.isascii() else _storable(detail),
                durability=durability,
                event=event,
                kind=kind,
                link=link,
                seq=head.seq,
                step=step,
                token=token,
                type="effect",
                utc_error_us=now.utc_error_us,
                utc_us=now.utc_us,
            )
        )

    def attested(self, now: Now, *, final: bool = False) -> tuple[bytes, ...]:
        """The line of the boundary's present statement; empty if there is no boundary."""
        return self._stated(now, self.attest(now, final=final))

    def _stated(self, now: Now, statement: bytes | None) -> tuple[bytes, ...]:
        if statement is None:
            return self.loss(now)
        return (self.effect(now, BOUNDARY, detail=b64encode(statement).decode()),)

    def loss(self, now: Now) -> tuple[bytes, ...]:
        """The line that records the loss of the boundary, once."""
        lost = None if self.told_loss else self.lost()
        if lost is None:
            return ()
        self.told_loss = True
        return (self.effect(now, BOUNDARY_LOST, detail=lost),)

    def sealing(self, now: Now, *, tells_loss: bool = True) -> tuple[bytes, ...]:
        """The lines that end an epoch: a late seal's gap, the boundary's statement, and the seal. Without
        `tells_loss`, only the gap if the loss of the boundary is not recorded yet, because records of its earlier
        entries must come first.
        """
        gap = self._gap(now)
        statement = self.attest(now, final=False)
        if statement is None and not tells_loss and not self.told_loss and self.lost() is not None:
            return gap
        return (*gap, *self._stated(now, statement), self.seal(now))

    def caught_up(self, now: Now) -> tuple[bytes, ...]:
        """The lines that must precede any other record: those that end an epoch which is over."""
        return self.sealing(now) if self.overdue(now) else ()

    def _gap(self, now: Now) -> tuple[bytes, ...]:
        """The line with the length of the gap if the epoch is sealed too late; else empty."""
        if self._told_gap or now.monotonic_us - self._signed_us <= LONGEST_US:
            return ()
        self._told_gap = True
        return (self.effect(now, STALLED, detail=detail_of(now.monotonic_us - self._last_us)),)

    def closing(self, now: Now, *, ending: str, tlog: bytes | None) -> tuple[bytes, ...]:
        """The lines that end the log: a late seal's gap, the boundary's final statement, and the close."""
        return (*self._gap(now), *self.attested(now, final=True), self.close(now, ending=ending, tlog=tlog))

    def seal(self, now: Now) -> bytes:
        """The end of an epoch: signed by its key, which is then dropped. It names the key of the next one."""
        key, last = EpochKey(self._draw()), self._epoch_key()
        seal = Seal(**self._segment(now), next_key=key.public.hex(), type="seal")
        self._key = key
        self._begin(now.monotonic_us)
        return self._head.seal(seal, self._origin, last.public, last.sign)

    def recover(self, now: Now, *, discarded_bytes: int, discarded_digest: bytes) -> bytes:
        """The first line after a crash, signed by the log key; monotonic time restarts."""
        key = EpochKey(self._draw())
        recover = Recover(
            **self._segment(now),
            discarded_bytes=discarded_bytes,
            discarded_digest=discarded_digest.hex(),
            next_key=key.public.hex(),
            type="recover",
        )
        return self._certified(recover, key)

    def close(self, now: Now, *, ending: str, tlog: bytes | None) -> bytes:
        """The last line. `tlog` is the SHA-256 of the telemetry log."""
        last = self._epoch_key()
        close = Close(
            **self._segment(now),
            ending=ending,
            tlog=None if tlog is None else tlog.hex(),
            type="close",
        )
        self._key = None
        return self._head.seal(close, self._origin, last.public, last.sign)

    def _segment(self, now: Now) -> dict[str, Any]:
        """The fields of every record that ends a segment."""
        head = self._head
        return {
            "prev": head.prev,
            "at_us": now.monotonic_us,
            "bytes": head.octets,
            "checkpoint": None,
            "digest": head.digest(),
            "epoch": head.epoch,
            "records": head.records,
            "seq": head.seq,
            "utc_error_us": now.utc_error_us,
            "utc_us": now.utc_us,
        }

    def _begin(self, at_us: int) -> None:
        """Begin an epoch."""
        self._signed_us = self._last_us = at_us
        self._told_gap = False

    def _epoch_key(self) -> EpochKey:
        assert self._key is not None, "no epoch has begun, or the log is closed"
        return self._key

    def _certified(self, record: Genesis | Recover, key: EpochKey) -> bytes:
        """A record signed by the log key, which is then dropped."""
        assert self._certify is not None, "the log key signs only once"
        certify, self._certify = self._certify, None
        self._key = key
        self._begin(record.at_us)
        return self._head.seal(record, self._origin, self._public, certify)


def nobody(now: Now, *, final: bool = False) -> None:
    """A signer that signs nothing."""


def _approvals(context: Context) -> tuple[tuple[int, int, int, int, int], ...]:
    return tuple([(a.rule, a.role, a.granted, a.monotonic_us, a.person) for a in context.approvals])


def _storable(text: str) -> str:
    """The text with characters replaced that UTF-8 cannot represent (lone surrogates), so that any text can be
    recorded.
    """
    return text.encode("utf-8", "replace").decode()
