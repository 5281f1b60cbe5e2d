"""The records of a log in words: what was decided about which step, and what happened."""

import re
from base64 import b64decode
from collections.abc import Sequence
from contextlib import suppress

from rtshcua.adapters.utc import CLOCK
from rtshcua.app.documents import Claimed, claimed, replaced
from rtshcua.app.telling import prose
from rtshcua.app.telling.document_prose import recorded
from rtshcua.app.telling.people import NOBODY, People
from rtshcua.app.wording import many
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.gaps import STALLED
from rtshcua.evidence.image_records import IMAGE, IMAGES_MISSING, read_image, read_missing
from rtshcua.evidence.log_writer import BOUNDARY
from rtshcua.evidence.note import octets, parse, read_signature, split
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis, Recover, Seal
from rtshcua.evidence.witnessing.anchors import ANCHORED
from rtshcua.model.flat.contract import Link
from rtshcua.model.step_number import number_of, step_words
from rtshcua.onboard.runtime.dispatcher import OBEYED
from rtshcua.wire import statement
from rtshcua.wire.request import CONTINGENCY_LINK, DEGRADE, FALLBACK_LINK, STEP
from rtshcua.wire.untrusted import Untrusted

#: effects whose detail is a signed document
DOCUMENTS = ("approval", "recall", "replacement", "cancellation")

#: the target in the detail of what was obeyed: 1e-7 degree, and mm above the sea
_TARGET = re.compile(r"(-?\d{1,10}) (-?\d{1,10}) (-?\d{1,10})", re.ASCII)
#: effects whose detail has times in us, as a verifier reads them
_TIMED = frozenset({STALLED, CLOCK, "clock-stepped"})
_US = re.compile(r"([+-]?)(\d{1,18}) us\b", re.ASCII)
_KINDS = {STEP: "step", FALLBACK_LINK: "fallback of step", CONTINGENCY_LINK: "contingency"}


def detail_of(event: str, detail: str, people: People = NOBODY) -> str:
    """An effect's detail for a person: a document by what it says and who signed it, a number by what it counts."""
    if event in DOCUMENTS:
        return recorded(detail, people)
    if event == ANCHORED:
        return _witnessed(detail)
    if event == OBEYED and (target := _TARGET.fullmatch(detail)) is not None:
        latitude, longitude, up = map(int, target.groups())
        return f"it flies to {latitude / 1e7:.7f}, {longitude / 1e7:.7f}, {up / 1_000:.1f} m above the sea"
    if event == BOUNDARY:
        return _stated(detail)
    if event in (IMAGE, IMAGES_MISSING):
        return _imaged(detail)
    if event in _TIMED:
        return _US.sub(lambda found: found[1] + prose.duration(int(found[2])), detail)
    return f"the same decision {detail} more times" if event == "repeated" else detail


def _imaged(detail: str) -> str:
    """An image, or the list of missing ones, as a camera reports them."""
    image, gaps = read_image(detail), read_missing(detail)
    if image is not None:
        if image.index is None:
            return f"camera {image.camera} reports a picture that failed"
        where = ""
        if image.latitude is not None and image.longitude is not None:
            where = f" at {image.latitude / 1e7:.7f}, {image.longitude / 1e7:.7f}"
        height = "" if image.above_home_mm is None else f", {image.above_home_mm / 1_000:.1f} m above home"
        again = f" (requested {many(image.asked, 'time')})" if image.asked else ""
        return f"camera {image.camera} took image {image.index}{where}{height}{again}"
    if gaps is None:
        return "no record of an image"
    lost = ", ".join(str(low) if low == high else f"{low} to {high}" for low, high in gaps.lost)
    failed = f"; {many(gaps.failed, 'picture')} failed" if gaps.failed else ""
    counted = f"{many(gaps.taken, 'image')} of camera {gaps.camera}, {gaps.missing} missing"
    return f"{counted}{f': {lost}' if lost else ''}{failed}"


def _stated(detail: str) -> str:
    """How far the boundary says that it got; whether it does, `verify-log --audit` says."""
    try:
        said = statement.claimed(octets(detail) or b"")
    except Untrusted:
        return "no statement"
    ends = ", and it ends there" if said.final else ""
    entries = f"{said.count} entr{'y' if said.count == 1 else 'ies'}"
    frames = f"{said.frames} frame{'s' * (said.frames != 1)} of commands"
    return f"session {said.session} has {entries} and {frames}{ends}"


def _witnessed(note: str) -> str:
    """How far an anchor reaches, and who it names; whether they made it, `verify-log` says."""
    text, signatures = split(note)
    checkpoint = parse(text)
    if isinstance(checkpoint, Flaw):
        return "no checkpoint"
    names = [read_signature(line)[0] for line in signatures[1:]]
    return f"records 0 to {checkpoint.size}, seen by {' and '.join(names)}"


def bundle_of(genesis: Genesis) -> Claimed | None:
    """The bundle in the first record of a log; None where it makes no sense."""
    try:
        return claimed(b64decode(genesis.bundle))
    except (Untrusted, ValueError):
        return None


class Names:
    """The words of a bundle for steps and links, numbers where it has none; and the people of a trust root."""

    def __init__(self, bundle: Claimed | None, people: People = NOBODY) -> None:
        self._bundle = bundle
        #: who may have signed documents
        self.people = people

    @classmethod
    def of(cls, genesis: Genesis) -> "Names":
        """The words of the bundle that a log began with."""
        return cls(bundle_of(genesis), People.of(genesis))

    def follow(self, record: AnyRecord) -> None:
        """After a replacement the steps have other words."""
        if isinstance(record, Effect) and record.event == "replacement" and self._bundle is not None:
            with suppress(Untrusted):
                self._bundle = self._bundle._replace(mission=replaced(record.detail, self._bundle.mission))

    @property
    def whole(self) -> bool:
        """Whether it has the words."""
        return self._bundle is not None

    def step(self, step: int) -> str:
        """A step as it was written; empty where that is not known."""
        return self.text(STEP, step, -1)

    def tell(self, record: AnyRecord) -> str:
        """A record as one line of text."""
        if isinstance(record, DecisionRecord):
            subject = self.subject(record.kind, record.step, record.link)
            clause = f" because {self._quoted(record)}" if record.clause is not None else ""
            target = f", to {record.target}" if record.target is not None else ""
            return f"{record.outcome:<9} {subject}: {record.reason}{clause}{target}"
        if isinstance(record, Effect):
            subject = self.subject(record.kind, record.step, record.link)
            detail = self.detail(record)
            return "  ".join(word for word in (f"· {record.event:<15}", subject, detail) if word).rstrip()
        if isinstance(record, Close):
            return f"closed after {many(record.seq, 'record')}: {record.ending}"
        if isinstance(record, Seal):
            return f"  epoch {record.epoch} sealed, {many(record.records, 'record')}"
        if isinstance(record, Recover):
            return f"recovered, {record.discarded_bytes} bytes discarded; epoch {record.epoch} sealed"
        return f"begun in mode {record.mode}"

    def detail(self, record: Effect) -> str:
        """The detail of an effect for a person."""
        return detail_of(record.event, record.detail, self.people)

    def _quoted(self, record: DecisionRecord) -> str:
        steps = () if self._bundle is None else self._bundle.mission.invocations
        if record.kind == STEP and 0 <= record.step < len(steps) and self._bundle is not None:
            of, policy = steps[record.step], self._bundle.policy
            own = (*of.contract.require, *of.contract.assume, *of.contract.maintain)
            clause = next((each for each in own if each.text == record.clause), None)
            if clause is not None and 0 <= of.skill < len(policy.contracts):
                return prose.quoted(policy, of, clause)
        return f"`{record.clause}`"

    def subject(self, kind: int, step: int, link: int) -> str:
        """The step, or the link of a fallback, that a record is about; empty if it is about none."""
        if kind not in _KINDS:
            return ""
        if kind == FALLBACK_LINK and link == DEGRADE:
            return f"target of the degrade rule, at {step_words(step)}"
        text = self.text(kind, step, link)
        number = number_of(link if kind == CONTINGENCY_LINK else step)  # a link by its place in the chain, from 1
        return f"{_KINDS[kind]} {number}{f' `{text}`' if text else ''}"

    def motion(self, record: Effect) -> int | None:
        """The kind of motion (`MotionKind`) of the command that an effect is about; None if that is not known."""
        if self._bundle is None:
            return None
        contracts, steps = self._bundle.policy.contracts, self._bundle.mission.invocations
        chain = self._chain(record.kind, record.step)
        if record.kind == STEP:
            return steps[record.step].plan.kind if 0 <= record.step < len(steps) else None
        if record.link == DEGRADE:
            return next((each.motion.kind for each in contracts if each.name == record.detail), None)
        return contracts[chain[record.link].skill].motion.kind if 0 <= record.link < len(chain) else None

    def _chain(self, kind: int, step: int) -> Sequence[Link]:
        """The links of a step's fallback, or of the contingency."""
        assert self._bundle is not None
        steps = self._bundle.mission.invocations
        if kind == FALLBACK_LINK and 0 <= step < len(steps):
            return steps[step].contract.fallback
        return self._bundle.policy.contingency

    def text(self, kind: int, step: int, link: int) -> str:
        """A step or a link as it was written; empty where that is not known."""
        if self._bundle is None:
            return ""
        if kind != STEP:
            chain = self._chain(kind, step)
            return chain[link].text if 0 <= link < len(chain) else ""
        steps = self._bundle.mission.invocations
        return prose.call(self._bundle.policy, steps[step]) if 0 <= step < len(steps) else ""
