"""The audit of a log. It continues the steps of `rtshcua.evidence.verify`:

8. trust: the root under the pinned key, the log key's duty, the bundle under that root (`trust`)
9. the bundle is the expected one, if the caller supplies it
10. anchors: the log holds what witnesses cosigned (`rtshcua.evidence.witnessing.anchors`)
11. the records agree with the boundary's own signed evidence (`rtshcua.evidence.attested`)
12. each decision is derived again (`decisions`), in the mode of the genesis; the recorded states do not contradict the
    temporal monitors
13. documents: each approval, recall, replacement and cancellation is verified again, and decisions use no others
    (`documents`)
14. evidence before effect: each dispatch follows a record that permits it, in the right order (`dispatches`); not in
    mode `none`
15. images: none is recorded twice, and the lists of missing ones agree with the records (`evidence.image_records`)

Of several flaws, the first of these is reported: genesis and trust, the log itself, anchors, the boundary's own
evidence, the meaning of the records. A log that is not intact proves nothing, so its own flaws come before those of its
meaning.

A log cannot prove that the recorded state is what the vehicle's sensors measured. Nor can it prove that the temporal
monitors follow from all observations, because it holds only those at which a decision was made.
"""

from collections.abc import Iterable
from typing import NamedTuple

from rtshcua.evidence.attested import BoundaryEvidence
from rtshcua.evidence.finding import Claim, Finding, Flaw
from rtshcua.evidence.image_records import ImageLedger
from rtshcua.evidence.log_writer import origin_of
from rtshcua.evidence.records import AnyRecord, DecisionRecord, Effect, Genesis, Recover
from rtshcua.evidence.report import LogReport, claims, with_anchors, with_boundary
from rtshcua.evidence.verify import LogVerifier
from rtshcua.evidence.witnessing.anchors import ANCHORED, Anchors
from rtshcua.ground.audit.frames import FrameAudit
from rtshcua.ground.audit.record_audit import UNENFORCED, RecordAudit
from rtshcua.ground.audit.trust import Basis, establish
from rtshcua.model.flat.contract import EmissionSuccess
from rtshcua.wire.request import STEP

Claims = tuple[tuple[Claim, ...], tuple[Claim, ...]]


def trust_claims(genesis: Genesis, basis: Basis) -> Claims:
    """Return the claims that the pinned key proves, and those that stay unproven."""
    bundle = basis.bundle
    kind = "development root" if basis.root.development else "trust root"
    proven = (
        Claim("trust", f"the {kind} is signed by the pinned key and authorises log key {genesis.log_kid}"),
        Claim(
            "bundle",
            f"mission `{bundle.mission.name}` under `{bundle.policy.name}@{bundle.policy.version}` on "
            f"`{genesis.vehicle}`, both signed by keys that the root authorises",
        ),
    )
    if not basis.root.development:
        return proven, ()
    text = "development keys are stored unencrypted: anyone who can read them can sign anything"
    return proven, (Claim("development", text),)


def record_claims(basis: Basis, meaning: RecordAudit) -> Claims:
    """Return the claims that the audit of the records proves, and those that stay unproven."""
    proven = [Claim("decisions", f"{_many(meaning.derived, 'decision')} derived again, each with the same answer")]
    documents = [
        f"{_many(count, kind)}{_signed_by(meaning.people[kind])}" for kind, count in meaning.documents.items() if count
    ]
    if documents:
        text = f"{', '.join(documents)}, each signed by an authorised key and valid when it was received"
        proven.append(Claim("documents", text))
    if meaning.preparations.count:
        text = f"{_many(meaning.preparations.count, 'parameter change')} listed, none in flight"
        proven.append(Claim("preparations", text))
    unproven = [Claim("state", "that the recorded state is what the vehicle's sensors measured")]
    if basis.policy.monitors:
        text = "the temporal monitors between the records: the recorded states do not contradict them"
        unproven.append(Claim("monitors", text))
    if meaning.mode == UNENFORCED:
        unproven.append(Claim("enforcement", "mode `none`: nothing was enforced, so dispatches needed no permit"))
    else:
        text = f"{_many(meaning.dispatches, 'dispatch', 'dispatches')}, each after a record that permits it"
        proven.append(Claim("dispatches", text))
    return tuple(proven), tuple(unproven)


def image_claims(images: ImageLedger) -> Claims:
    """Return the claims about images that the log proves, and those that stay unproven; none without images."""
    if not images.taken:
        return (), ()
    text = f"{_many(images.taken, 'image')}, each recorded once; the lists of missing ones agree with these records"
    return (Claim("images", text),), (Claim("images", "that an image exists, and was taken where its record says"),)


def _signed_by(people: list[str]) -> str:
    return f" by {' and '.join(people)}" if people else ""


def _many(count: int, one: str, more: str | None = None) -> str:
    return f"{count} {one if count == 1 else more or one + 's'}"


_NOT_DERIVED = (
    "that decisions follow from their recorded inputs, and commands from decisions: use `--audit` without `--no-derive`"
)


class Audit(NamedTuple):
    """The report of an audit, the basis of a trusted log, and the numbers of decisions and dispatches."""

    report: LogReport
    basis: Basis | None
    derived: int
    dispatches: int


class Auditor:
    """Audits the lines of a log in order. Memory is bounded by the bundle, plus some hundred bytes for each epoch.

    `derive` says whether decisions are derived again. `anchors` are notes that witnesses cosigned, in addition to those
    in the log. `frames` audits the raw frames beside the log; the caller reads its findings.
    """

    def __init__(
        self, pinned: bytes, *, bundle: bytes | None = None, derive: bool = True, anchors: Iterable[str] = (),
        frames: FrameAudit | None = None,
    ) -> None:  # fmt: skip
        self.record: AnyRecord | None = None  # of the last line, if it is valid
        self._pinned = pinned
        self._expected = bundle
        self._derive = derive
        self._given = anchors
        self._frames = frames
        self._verifier = LogVerifier()
        self._basis: Basis | None = None
        self._meaning: RecordAudit | None = None
        self._anchors: Anchors | None = None
        self._untrusted: Finding | None = None
        self._contradicted: Finding | None = None
        self._suspect: Finding | None = None
        self._images = ImageLedger()
        self._boundary: BoundaryEvidence | None = None
        self._unattested: Finding | None = None

    def take(self, line: bytes) -> bool:
        """Audit the next line; return False when further lines cannot change the result."""
        verifier = self._verifier
        record = self.record = verifier.take(line)
        if record is None:
            return verifier.failure is None
        if isinstance(record, Genesis):
            flaw = self._begin(record)
            self._untrusted = flaw and flaw.at(0, 0)
        if self._untrusted is not None:
            return True  # the log may still be intact: the report says how far
        if self._contradicted is None and (flaw := self._witnessed(record)):
            self._contradicted = flaw.at(record.seq, verifier.offset - len(line))
        if self._unattested is None and self._boundary is not None and not isinstance(record, Genesis):
            self._unattested = self._attested(self._boundary, record, verifier.offset - len(line))
        if self._suspect is None and (flaw := self._meant(record)):
            self._suspect = flaw.at(record.seq, verifier.offset - len(line))
        return True

    def _meant(self, record: AnyRecord) -> Flaw | None:
        """The flaw in the meaning of a record, or in what it says of images."""
        flaw = None if self._meaning is None else self._meaning.check(record)
        if flaw is None and isinstance(record, Effect | Recover):
            flaw = self._images.check(record)
        if flaw is None and isinstance(record, Effect) and self._requires_images(record):
            flaw = self._images.incomplete()
        return flaw

    def _requires_images(self, record: Effect) -> bool:
        """Whether a record is the success of a step whose contract requires all images. Without derivation, which
        follows replacements, the mission in force is unknown.
        """
        invocations = () if self._basis is None or self._meaning is None else self._basis.invocations
        if record.event != "succeeded" or record.kind != STEP or not 0 <= record.step < len(invocations):
            return False
        emits = invocations[record.step].invocation.contract.emits
        return any(each.success == EmissionSuccess.ALL_IMAGES and each.required for each in emits)

    def _begin(self, genesis: Genesis) -> Flaw | None:
        basis = establish(genesis, self._pinned, bundle=self._expected)
        if isinstance(basis, Flaw):
            return basis
        self._basis = basis
        self._boundary = BoundaryEvidence(basis.root, genesis)
        if self._derive:
            self._meaning = RecordAudit(basis, genesis.mode, self._frames)
        self._anchors = anchors_of(basis, genesis)
        for note in self._given:
            flaw = self._anchors.anchor(note)
            if flaw is not None and self._contradicted is None:
                self._contradicted = flaw.at(0, 0)
        return None

    def _attested(self, boundary: BoundaryEvidence, record: AnyRecord, offset: int) -> Finding | None:
        before = boundary.last
        found = boundary.check(record, offset)
        statement = boundary.last
        if found is None and statement is not before and statement is not None and self._frames is not None:
            assert isinstance(record, Effect)
            self._frames.stated(statement.frames, statement.left, record, final=statement.final)
        return found

    def _witnessed(self, record: AnyRecord) -> Flaw | None:
        assert self._anchors is not None
        if isinstance(record, DecisionRecord):
            return None
        if isinstance(record, Effect):
            return self._anchors.anchor(record.detail) if record.event == ANCHORED else None
        assert record.checkpoint is not None
        return self._anchors.checkpoint(record.checkpoint)

    def audit(self) -> Audit:
        """Return the result. Call it after the last line."""
        report = self._judged(self._verifier.report())
        meaning = self._meaning
        if meaning is None:
            return Audit(report, self._basis, 0, 0)
        return Audit(report, self._basis, meaning.derived, meaning.dispatches)

    def _judged(self, report: LogReport) -> LogReport:
        if self._untrusted is not None:
            return failing(report, self._untrusted)
        if report.failure is not None:
            return report
        if self._contradicted is not None:
            return failing(report, self._contradicted)
        assert self._anchors is not None
        anchored = self._anchors.finish(report.records)
        if isinstance(anchored, Flaw):
            return failing(report, anchored.at(report.records, self._verifier.offset))
        if self._unattested is not None:
            return failing(report, self._unattested)
        if self._suspect is not None:
            return failing(report, self._suspect)
        return self._claimed(with_anchors(report, anchored))

    def _claimed(self, report: LogReport) -> LogReport:
        assert self._basis is not None
        assert self._boundary is not None
        report = with_boundary(report, self._boundary.gaps)
        seen, unseen = self._boundary.claims()
        shortfall = report.shortfall or self._boundary.shortfall()
        counted, unsure = image_claims(self._images)
        proven, unproven = (*report.proven, *seen, *counted), (*report.unproven, *unseen, *unsure)
        report = report._replace(proven=proven, unproven=unproven, shortfall=shortfall)
        if self._meaning is None:
            unproven = (*report.unproven, Claim("decisions", _NOT_DERIVED))
            return trusted(report._replace(unproven=unproven), self._basis)
        proven, but = record_claims(self._basis, self._meaning)
        report = report._replace(proven=(*report.proven, *proven), unproven=(*report.unproven, *but))
        return trusted(report, self._basis)


def trusted(report: LogReport, basis: Basis) -> LogReport:
    """Return the report of a trusted log with the claims that the pinned key proves."""
    assert report.genesis is not None
    proven, unproven = trust_claims(report.genesis, basis)
    return report._replace(proven=(*proven, *report.proven), unproven=(*report.unproven, *unproven))


def anchors_of(basis: Basis, genesis: Genesis) -> Anchors:
    """Return the check of a log's checkpoints against what the witnesses of its root cosigned."""
    root, origin = basis.root, origin_of(genesis.vehicle, genesis.boot)
    return Anchors(origin, root.witnesses(genesis.vehicle, genesis.utc_us), root.witness_threshold)


def failing(report: LogReport, failure: Finding) -> LogReport:
    """Return the report with a failure that verification of the chain and seals does not find."""
    proven, unproven = claims(report.records, 0, 0, report.genesis, None, failure)
    return report._replace(failure=failure, shortfall=None, proven=proven, unproven=unproven)


def audit(
    lines: Iterable[bytes], pinned: bytes, *, bundle: bytes | None = None, derive: bool = True,
    anchors: Iterable[str] = (),
) -> Audit:  # fmt: skip
    """Audit the lines of a log, each with its newline.

    `pinned` is the trust root's public key (32 bytes) or its `kid` (16 bytes); it must not come from the log. `bundle`
    is the expected bundle, if known. `derive` and `anchors`: see `Auditor`.
    """
    auditor = Auditor(pinned, bundle=bundle, derive=derive, anchors=anchors)
    for line in lines:
        if not auditor.take(line):
            break
    return auditor.audit()
