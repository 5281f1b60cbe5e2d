"""Keys that were revoked since a log began: told by newer trust roots, which the auditor gives.

A log carries the trust root of its time and is judged by that one; what came later it cannot know. A key is revoked
when the first root that has it among its revoked ones is issued. What it signed

- before, counts as it did, and it is told that the key was revoked since;
- after, is not to be trusted: the vehicle had not been told, or it was signed by whoever took the key;
- at a time that may be either, makes the log incomplete.

A log's times are what its log key vouches for, so of a log whose log key was revoked they count for nothing: it is
incomplete, unless witnesses saw it to its end before. A trust root of a revoked root key counts where the auditor gives
that very root, and else not at all.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Final, NamedTuple

from rtshcua.evidence.finding import Claim, Finding
from rtshcua.evidence.log_writer import BOUNDARY
from rtshcua.evidence.note import octets
from rtshcua.evidence.records import AnyRecord, Effect, Genesis
from rtshcua.evidence.report import LogReport, utc_of
from rtshcua.ground.audit.audit import Audit, failing
from rtshcua.ground.audit.documents import DOCUMENT_KINDS
from rtshcua.wire import cose
from rtshcua.wire.bundle import MAX_BUNDLE, envelopes
from rtshcua.wire.document import MAX_DOCUMENT
from rtshcua.wire.trust import MAX_ROOT, TrustRoot, follow, open_root
from rtshcua.wire.untrusted import Untrusted

_S: Final = 1_000_000  # us


class Revocation(NamedTuple):
    """By which version of the root a key was revoked: from `early_us` on at the earliest, from `late_us` on surely."""

    version: int
    early_us: int
    late_us: int


class KeyUse(NamedTuple):
    """What a key signed, in which record, and between which times that was here; `document`: in flight."""

    what: str
    kid: bytes
    record: int
    early_us: int
    late_us: int
    document: bool = False


class RevokedKeys:
    """Takes the records of a log that is audited, and judges it by signed trust roots that were given, in any order.

    Each is trusted for being given. Raises `Untrusted` for what is no trust root.
    """

    def __init__(self, roots: Iterable[bytes]) -> None:
        self._roots = {signed: _opened(signed) for signed in roots}
        self._documents: list[KeyUse] = []
        self._statements: dict[bytes, KeyUse] = {}  # of each boundary key the last
        self._read = False

    def take(self, record: AnyRecord) -> None:
        """One sound record. Whether a document or a statement in it is one is for the audit to say."""
        self._read = True
        if not self._roots or not isinstance(record, Effect) or record.event not in (*DOCUMENT_KINDS, BOUNDARY):
            return
        with suppress(Untrusted):
            kid = _signer(octets(record.detail) or b"", MAX_DOCUMENT)
            times = _between(record.utc_us, record.utc_error_us)
            if record.event == BOUNDARY:
                self._statements[kid] = KeyUse("what the boundary made", kid, record.seq, *times)
                return
            self._documents.append(KeyUse(f"the {record.event}", kid, record.seq, *times, document=True))

    def judged(self, audit: Audit) -> Audit:
        """The audit, with what was revoked since. One that failed stays as it is."""
        report, basis, genesis = audit.report, audit.basis, audit.report.genesis
        if report.failure is not None or basis is None or genesis is None:
            return audit
        signed = octets(genesis.root)
        assert signed is not None
        own = basis.root
        given = {data: root for data, root in self._roots.items() if data != signed}
        revoked = _revocations(tuple(given.values()), own)
        if not revoked and all(root.version <= own.version for root in given.values()):
            return audit  # nothing newer was given
        flaw = self._unknown_root(signed, revoked) or next(_after(self._uses(genesis), revoked), None)
        if flaw is not None:
            return audit._replace(report=failing(report, flaw))
        later, doubts = self._told(report, genesis, own, revoked)
        proven, unproven = (
            _lineage(signed, given, " and documents" * self._read) if not later and not doubts else ([], later)
        )
        told = report._replace(proven=(*report.proven, *proven), unproven=(*report.unproven, *unproven))
        if doubts:
            others = tuple(Claim(each.slug, each.text) for each in doubts[report.shortfall is None :])
            told = told._replace(shortfall=report.shortfall or doubts[0], unproven=(*told.unproven, *others))
        return audit._replace(report=told)

    def _uses(self, genesis: Genesis) -> list[KeyUse]:
        """What the keys of a log that was trusted signed; that of the log's own comes first."""
        data = octets(genesis.bundle)
        assert data is not None
        policy, mission = envelopes(data)
        times = _between(genesis.utc_us, genesis.utc_error_us)
        return [
            KeyUse("the log", bytes.fromhex(genesis.log_kid), 0, *times),
            KeyUse("the policy", _signer(policy, MAX_BUNDLE), 0, *times),
            KeyUse("the mission", _signer(mission, MAX_BUNDLE), 0, *times),
            *self._statements.values(),
            *self._documents,
        ]

    def _unknown_root(self, signed: bytes, revoked: Mapping[bytes, Revocation]) -> Finding | None:
        kid = _signer(signed, MAX_ROOT)
        by = revoked.get(kid)
        if by is None or signed in self._roots:
            return None
        text = (
            f"{_by(kid, by)}, and it signed the log's trust root, which is none of those that you gave: whoever took "
            "that key can sign roots for any log"
        )
        return Finding("trust/root-revoked-key", 0, text, kid.hex())

    def _told(
        self, report: LogReport, genesis: Genesis, own: TrustRoot, revoked: Mapping[bytes, Revocation]
    ) -> tuple[list[Claim], list[Finding]]:
        """What was revoked after it signed, and what may have been revoked before."""
        later: list[Claim] = []
        doubts: list[Finding] = []
        for use in self._uses(genesis):
            by = revoked.get(use.kid)
            if by is None:
                continue
            own_word = use.kid.hex() == genesis.log_kid
            late_us = _witnessed_us(report, own, revoked) if own_word else use.late_us
            if late_us is not None and late_us < by.early_us:
                later.append(
                    Claim("revoked", f"that nobody else held the key that signed {use.what}: {_by(use.kid, by)}")
                )
            elif own_word:
                text = (
                    f"{_by(use.kid, by)}, and no witness saw before that what it signed: {use.what}, with all its times"
                )
                doubts.append(Finding("trust/revoked-log-key", use.record, text, use.kid.hex()))
            else:
                text = (
                    f"{_by(use.kid, by)} or one before, and it signed {use.what}: whether before or after is not known"
                )
                doubts.append(Finding("trust/revoked-when", use.record, text, use.kid.hex()))
        return later, doubts


def _opened(signed: bytes) -> TrustRoot:
    return open_root(signed, pinned=_signer(signed, MAX_ROOT), now_us=0)


def _signer(envelope: bytes, limit: int) -> bytes:
    return cose.unverified(envelope, limit=limit).kid


def _between(utc_us: int, error_us: int) -> tuple[int, int]:
    return utc_us - error_us, utc_us + error_us


def _revocations(roots: Sequence[TrustRoot], own: TrustRoot) -> dict[bytes, Revocation]:
    """What these roots revoke and the log's own does not, with when. Where one between is not known, that is not exact;
    where the log's own is no older, it should have known.
    """
    found: dict[bytes, Revocation] = {}
    for root in sorted(roots, key=lambda each: each.version):
        for kid in root.revocations - own.revocations - found.keys():
            before = [each for each in (own, *roots) if each.version < root.version and kid not in each.revocations]
            if own not in before:
                found[kid] = Revocation(root.version, 0, 0)
                continue
            last = max(before, key=lambda each: each.version)
            exact = last.version == root.version - 1
            found[kid] = Revocation(root.version, root.issued_at_us if exact else last.issued_at_us, root.issued_at_us)
    return found


def _after(uses: Iterable[KeyUse], revoked: Mapping[bytes, Revocation]) -> Iterator[Finding]:
    """What was signed by a key that was revoked already."""
    for use in uses:
        by = revoked.get(use.kid)
        if by is not None and use.early_us >= by.late_us:
            slug = "document/revoked-key" if use.document else "trust/revoked-key"
            text = f"{_by(use.kid, by)}, and it signed {use.what} after that: whoever flew had not been told"
            yield Finding(slug, use.record, text, use.kid.hex())


def _witnessed_us(report: LogReport, own: TrustRoot, revoked: Mapping[bytes, Revocation]) -> int | None:
    """When the threshold of witnesses, revoked ones apart, had seen a log to its end; None where it had not."""
    if report.outside is None:
        return None
    gone = {key.public for key in own.keys if key.kid in revoked}
    saw = [seen for seen in report.outside.witnessed if seen.size + 1 >= report.records and seen.public not in gone]
    times = sorted(seen.time_s for seen in saw)[: report.outside.threshold]
    return (times[-1] + 1) * _S if len(times) == report.outside.threshold else None


def _by(kid: bytes, by: Revocation) -> str:
    when = f" of {utc_of(by.late_us // _S)}" if by.late_us else ""
    return f"key {kid.hex()} was revoked by root version {by.version}{when}"


def _lineage(signed: bytes, roots: Mapping[bytes, TrustRoot], also: str) -> tuple[list[Claim], list[Claim]]:
    """That the newest of some roots follows from a log's, and revokes nothing that signed there; or that it may not."""
    chain = sorted(roots, key=lambda data: roots[data].version)
    newest = roots[chain[-1]]
    try:
        follow(chain, current=signed, now_us=0)
    except Untrusted as error:
        text = f"that root version {newest.version} is of those who flew: it does not follow from the log's: {error}"
        return [], [Claim("revocations", text)]
    text = f"root version {newest.version} of {utc_of(newest.issued_at_us // _S)} revokes none of the keys that "
    text += f"signed log, policy, mission{also}"
    return [Claim("revocations", text)], []
