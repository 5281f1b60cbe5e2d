"""The audit of a log. The steps beyond those of `rtshcua.evidence.verify`, numbered on from there:

8. trust: the root under the pinned key, the log key's duty, the bundle under that root (`trust`)
9. the bundle is the one that the caller knows of, if there is one
10. each decision is derived again (`derive`), under the mode of the genesis; what the temporal monitors said is not
    ruled out by the states that the records hold (`observed`)
11. documents: each approval, recall and replacement is verified again, and no decision read another (`documents`)
12. evidence before effect: each dispatch follows a record that permits it (`cover`), in its turn (`turns`); not in mode
    `none`

What no log can prove: that the state it records is what the vehicle's sensors saw, and that the temporal monitors said
what follows from all observations, of which the log has those at which something was decided.
"""

from base64 import b64encode
from collections.abc import Iterable
from typing import NamedTuple

from rtshcua.evidence.finding import Claim, Finding, Flaw
from rtshcua.evidence.records import AnyRecord, Decision, Effect, Genesis
from rtshcua.evidence.report import Report, claims
from rtshcua.evidence.verify import Verifier
from rtshcua.ground.auditor.cover import Cover
from rtshcua.ground.auditor.derive import UNENFORCED, Deriver
from rtshcua.ground.auditor.documents import Documents
from rtshcua.ground.auditor.trust import Basis, establish
from rtshcua.ground.auditor.turns import Turns


class Audit(NamedTuple):
    """A report whose claims say what the pinned key proves, with what the log rests on where that was trusted."""

    report: Report
    basis: Basis | None
    derived: int
    dispatches: int


class Auditor:
    """Takes the lines of a log in order, in memory that the bundle bounds, not the log."""

    def __init__(self, pinned: bytes, *, bundle: bytes | None = None) -> None:
        self._pinned = pinned
        self._expected = bundle
        self._verifier = Verifier()
        self._basis: Basis | None = None
        self._deriver: Deriver | None = None
        self._documents: Documents | None = None
        self._cover = Cover()
        self._turns: Turns | None = None
        self._mode = ""
        self._derived = 0
        self._suspect: Finding | None = None

    def take(self, line: bytes) -> bool:
        """Takes the next line; False when no further one would change the result."""
        record = self._verifier.take(line)
        if self._suspect is not None:
            # A record that means something wrong was perhaps only changed: the link of the line after it tells.
            # What another root vouches for may be sound in itself: it is read to its end, for how long it lasted.
            on = record is None or self._suspect.slug.startswith("trust/")
            return on and self._verifier.failure is None
        if record is not None:
            flaw = self._check(record)
            if flaw is not None:
                self._suspect = flaw.at(record.seq)
        return self._verifier.failure is None

    def _check(self, record: AnyRecord) -> Flaw | None:
        if isinstance(record, Genesis):
            return self._begin(record)
        if isinstance(record, Decision):
            return self._decided(record)
        if isinstance(record, Effect):
            return self._happened(record)
        return None

    def _happened(self, record: Effect) -> Flaw | None:
        assert self._documents is not None
        flaw = self._documents.check(record)
        if flaw is None and self._mode != UNENFORCED:
            self._cover.recalled = self._documents.counts["recall"] > 0
            assert self._turns is not None
            flaw = self._cover.check(record) or self._turns.check(record)
        return flaw

    def _begin(self, genesis: Genesis) -> Flaw | None:
        basis = establish(genesis, self._pinned)
        if isinstance(basis, Flaw):
            return basis
        self._basis, self._deriver, self._mode = basis, Deriver(basis), genesis.mode
        self._documents = Documents(basis, self._deriver)
        self._turns = Turns(basis)
        if self._expected is not None and b64encode(self._expected).decode() != genesis.bundle:
            return Flaw("genesis/other-bundle", "the log is of another bundle than the one that lies beside it")
        return None

    def _decided(self, record: Decision) -> Flaw | None:
        assert self._deriver is not None
        if record.mode != self._mode:
            text = "the decision was made in another mode than the log began in"
            return Flaw("decision/mode", text, record.mode, self._mode)
        flaw = self._deriver.check(record)
        if flaw is None:
            self._derived += 1
            self._cover.decided(record)
        return flaw

    def audit(self) -> Audit:
        """The whole, once the lines are over."""
        report = self._verifier.report()
        if self._suspect is not None and (report.failure is None or report.failure.record > self._suspect.record):
            proven, unproven = claims(report.records, None, None, self._suspect)
            report = report._replace(failure=self._suspect, shortfall=None, proven=proven, unproven=unproven)
        if report.failure is None:
            report = self._claimed(report)
        return Audit(report, self._basis, self._derived, self._cover.dispatches)

    def _claimed(self, report: Report) -> Report:
        genesis, basis = report.genesis, self._basis
        assert genesis is not None
        assert basis is not None
        bundle = basis.bundle
        kind = "development root" if basis.root.development else "trust root"
        proven = [
            Claim("trust", f"the {kind} is signed by the pinned key, and gives log key {genesis.log_kid} its duty"),
            Claim(
                "bundle",
                f"mission `{bundle.mission.name}` under `{bundle.policy.name}@{bundle.policy.version}` on "
                f"`{genesis.vehicle}`, both signed by keys that the root trusts for them",
            ),
            *report.proven,
            Claim("decisions", f"{_many(self._derived, 'decision')} derived again, each with the same answer"),
        ]
        assert self._documents is not None
        documents = [_many(count, kind) for kind, count in self._documents.counts.items() if count]
        if documents:
            text = f"{', '.join(documents)}, each signed by a key that the root trusts for it, and good when it came"
            proven.append(Claim("documents", text))
        unproven = [*report.unproven, Claim("state", "that the recorded state is what the vehicle's sensors saw")]
        if basis.policy.monitors:
            text = "what the temporal monitors said between the records: only that no recorded state rules it out"
            unproven.append(Claim("monitors", text))
        if self._mode == UNENFORCED:
            unproven.append(Claim("enforcement", "mode `none`: nothing was enforced, so dispatches needed no permit"))
        else:
            text = f"{_many(self._cover.dispatches, 'dispatch', 'dispatches')}, each after a record that permits it"
            proven.append(Claim("dispatches", text))
        if basis.root.development:
            text = "development keys lie unencrypted where they were made: whoever can read them can sign anything"
            unproven.append(Claim("development", text))
        return report._replace(proven=tuple(proven), unproven=tuple(unproven))


def audit(lines: Iterable[bytes], pinned: bytes, *, bundle: bytes | None = None) -> Audit:
    """Audits the lines of a log, each with its newline.

    `pinned` is the trust root's public key (32 bytes) or its `kid` (16 bytes), which must come from elsewhere than the
    log. `bundle` is what the log should be of, where the caller knows.
    """
    auditor = Auditor(pinned, bundle=bundle)
    for line in lines:
        if not auditor.take(line):
            break
    return auditor.audit()


def _many(count: int, one: str, more: str | None = None) -> str:
    return f"{count} {one if count == 1 else more or one + 's'}"
