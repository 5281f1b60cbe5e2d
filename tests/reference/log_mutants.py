"""Every small change of a log of 200 records, with the result of every verifier; no verifier may accept one."""

import copyreg
import io
from copy import deepcopy
from functools import cache
from hashlib import sha256

from reference import independent_verifier
from reference.forgery import flight, read
from reference.log_vectors import WITNESSES, anchor, close, effect, genesis, log, seal, sealing, times
from reference.verifiers import ROOT_KEY, careful, independent, quick_accepts
from rtshcua.adapters.store.logs import lines
from rtshcua.evidence.verify import LogVerifier

copyreg.pickle(type(sha256()), lambda hasher: (hasher.copy, ()))

RECORDS = 200


@cache
def whole() -> tuple[bytes, ...]:
    """A log of 200 records: decisions and effects, seals, an anchor, a recovery, texts that need escapes."""
    decision = next(read(line) for line in flight() if read(line)["type"] == "decision")
    records, epoch = [genesis()], 0
    while len(records) < RECORDS - 1:
        number = len(records)
        if number == RECORDS // 2:
            epoch += 1
            again = {"discarded_bytes": 7, "discarded_digest": "5a" * 32, "next_key": seal(0, epoch)["next_key"]}
            records.append(sealing("recover", number, **again) | times(number))
        elif number % 23 == 0:
            epoch += 1
            records.append(seal(number, epoch))
        elif number == 31:
            note = anchor(log(*records[:24])[23], [*WITNESSES][:2])
            records.append(effect(number, event="anchored", detail=note))
        elif number % 5 == 0:
            records.append(decision | times(number))
        else:
            records.append(effect(number, detail='"\\\n\u00e9\U0001f681' if number % 5 == 0 else "", token=number))
    return tuple(log(*records, close(RECORDS, tlog="ab" * 32)))


def flipped(data: bytes, at: int) -> bytes:
    """One bit changed, of each byte another one."""
    return data[:at] + bytes([data[at] ^ 1 << at % 8]) + data[at + 1 :]


class Verifiers:
    """The careful and the independent verifier, each with its state before every line, and the quick one.

    A change only affects later lines, so earlier ones need not be read again. (Except trust: for a change in
    the genesis the whole log is read.)
    """

    def __init__(self) -> None:
        self.lines = whole()
        careful, other = LogVerifier(), independent_verifier.Walk(ROOT_KEY)
        self._before: list[tuple[LogVerifier, independent_verifier.Walk]] = []
        for line in self.lines:
            self._before.append((careful, other))
            careful, other = deepcopy(careful), deepcopy(other)
            assert careful.take(line)
            other.line(line)

    def judge(self, number: int, rest: bytes) -> tuple[str, str, bool]:
        """The results if these octets follow from a line on: two verdicts, and whether the quick verifier accepts."""
        data = b"".join(self.lines[:number]) + rest
        if number == 0:
            return careful(data).report.verdict.value, independent(data), quick_accepts(data)
        one, other = deepcopy(self._before[number])
        for line in lines(io.BytesIO(rest)):
            one.take(line)
            if one.failure is not None:
                break
        return one.report().verdict.value, other.verdict(rest).kind, quick_accepts(data)


#: verdicts on logs that are not closed
REJECTED = {("failed", "broken"), ("failed", "untrusted"), ("failed", "anchor"), ("incomplete", "incomplete")}
