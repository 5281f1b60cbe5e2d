"""The results of the careful, the quick and the independent verifier on some octets."""

import io
from functools import lru_cache
from itertools import pairwise

from reference import independent_verifier
from rtshcua.adapters.store.logs import lines
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.quick_verification import outline, quick, scan
from rtshcua.evidence.records import Genesis
from rtshcua.evidence.report import LogVerdict
from rtshcua.ground.audit.audit import Audit, Auditor, anchors_of
from rtshcua.ground.audit.trust import Basis, establish
from rtshcua.wire.keys import Duty
from virtual import case

ROOT_KEY = case.KEYS[Duty.ROOT].public
#: equivalent verdicts of the two
WORDS = {
    LogVerdict.VERIFIED: ("closed",),
    LogVerdict.INCOMPLETE: ("incomplete",),
    LogVerdict.FAILED: ("broken", "untrusted", "anchor", "boundary", "images"),
}
#: findings outside docs/log-format.md: the meaning of records and bundle
OF_MEANING = (
    "decision/", "dispatch/", "document/", "frames/", "preparation/", "genesis/other",
    "trust/bundle-binding-mismatch", "trust/bundle-id-mismatch",
)  # fmt: skip
#: findings about the form of a bundle beyond what the page requires
OF_FORM_OF_BUNDLES = ("trust/bundle-malformed",)


#: findings that only a key holder can cause, and that the quick verifier reports as unchecked
OF_FORM = ("record/", "clock/", "chain/sequence", "seal/missing", "seal/gap", "genesis/repeated")


def careful(data: bytes, pinned: bytes = ROOT_KEY, *, derive: bool = False) -> Audit:
    """The careful verifier, line by line."""
    auditor = Auditor(pinned, derive=derive)
    for line in lines(io.BytesIO(data)):
        if not auditor.take(line):
            break
    return auditor.audit()


def quick_accepts(data: bytes, pinned: bytes = ROOT_KEY) -> bool:
    """Whether the quick verifier accepts, without its fallback to the careful one."""
    log = outline(lambda offset, length: data[offset : offset + length], len(data))
    if log is None:
        return False
    basis = _established(log.genesis, pinned)
    if isinstance(basis, Flaw):
        return False
    parts = [scan(data[start:end]) for start, end in pairwise(log.offsets)]
    return quick(log, parts, anchors_of(basis, log.genesis)) is not None


@lru_cache(maxsize=64)
def _established(genesis: Genesis, pinned: bytes) -> Basis | Flaw:
    return establish(genesis, pinned)


def independent(data: bytes, pinned: bytes = ROOT_KEY) -> str:
    """Return the result of the independent verifier."""
    return independent_verifier.verify(data, pinned).kind


def agree(data: bytes, audit: Audit, pinned: bytes = ROOT_KEY) -> None:
    """Check that the independent verifier agrees with the audit, and that the quick one accepts no more."""
    report = audit.report
    slug = report.failure.slug if report.failure else ""
    short = report.shortfall is not None and report.shortfall.slug == "boundary/lost"
    word = independent(data, pinned)
    if slug.startswith(OF_FORM_OF_BUNDLES):
        assert word in ("closed", "incomplete", "untrusted"), (word, report.failure)
    elif slug.startswith("boundary/"):
        assert word == "boundary", (word, report.failure)
    elif slug.startswith("image/"):
        assert word == "images", (word, report.failure)
    elif slug.startswith(OF_MEANING):
        assert word in ("closed", "incomplete", "images"), (word, report.failure)
    else:
        assert word in WORDS[report.verdict], (word, report.failure)
    if quick_accepts(data, pinned):
        unasked = slug.startswith((*OF_MEANING, *OF_FORM_OF_BUNDLES, *OF_FORM, "boundary/", "image/"))
        assert report.verdict is LogVerdict.VERIFIED or unasked or short, report.failure
    else:
        assert report.verdict is not LogVerdict.VERIFIED
