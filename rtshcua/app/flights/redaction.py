"""A redacted picture of a flight: without positions, without names, or without both.

What may stay is listed; everything else goes. Each field of a report has a kind (`field_kinds.py`), and a kind says
whether its value stays. Before a flight is told, the texts of others are removed from its records (`bare`), so that no
sentence can have them. In a sentence of ours each name is in backticks, and of these only known ones stay. What is
then written is searched for what should be gone (`left_over.py`), and if anything is found there is no page.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from dataclasses import replace as dataclass_replace
from functools import cache
from itertools import chain
from pathlib import PurePosixPath
from typing import Any, Final

import msgspec

from rtshcua import library
from rtshcua.adapters.store.reading import read_regular
from rtshcua.adapters.store.runs import SUMMARY, TELEMETRY
from rtshcua.app.flights.left_over import HEX, LeftOver, ordinary_words, shape, words_of
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.finding import Claim
from rtshcua.evidence.image_records import IMAGE, IMAGES_MISSING, encoded, read_image, read_missing
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Recover, Seal
from rtshcua.evidence.report import LogReport
from rtshcua.ground.flight.field_kinds import KINDS, FieldKind, fields_of
from rtshcua.ground.flight.flight_content import DecisionView, FlightReport, ListedRecord, ReadSignal, SignalCurve
from rtshcua.ground.flight.flown import Flight
from rtshcua.ground.language.paths import LIBRARY
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import Signal
from rtshcua.model.quantity import Dimension

#: what can be removed, in the order in which a page names it
REDACTABLE: Final = ("position", "names")
#: the limit of a shipped source, in octets
_MOST_SOURCE: Final = 1 << 20
#: what stands in place of a part of a sentence that is not known, of a place, and of a key
_GONE, _PLACE, _KEY = "(removed)", "(place)", "(key)"
#: the fields of MAVLink messages that say nothing of where the vehicle is or how it moves over ground; None: all
_NO_PLACE: Final[Mapping[str, frozenset[str] | None]] = {
    "BATTERY_STATUS": None,
    "SYS_STATUS": None,
    "RADIO_STATUS": None,
    "POWER_STATUS": None,
    "VIBRATION": None,
    "HEARTBEAT": None,
    "EXTENDED_SYS_STATE": None,
    "GPS_RAW_INT": frozenset({"fix_type", "satellites_visible", "eph", "epv", "h_acc", "v_acc"}),
    "GLOBAL_POSITION_INT": frozenset({"relative_alt", "vz"}),
    "ALTITUDE": frozenset({"altitude_relative"}),
    "VFR_HUD": frozenset({"throttle", "climb"}),
}
#: claims that are made of our words, names in backticks, numbers and keys; of the others only the slug is told
_TOLD_CLAIMS: Final = frozenset({
    "trust", "bundle", "development", "chain", "seals", "signed-close", "log", "recovered", "anchor", "decisions",
    "preparations", "state", "monitors", "enforcement", "dispatches", "boundary", "clock", "gap",
    "telemetry", "frames", "summary", "fallback", "octets", "form", "tree",
})  # fmt: skip
#: code in our sentences that is the same for every flight
_CONSTANT: Final = re.compile(rf"rtshcua [a-z-]+(?: --[a-z]+)*|{re.escape(TELEMETRY)}|{re.escape(SUMMARY)}")
_CALL: Final = re.compile(r"([A-Za-z_]\w*)\s*\(")
#: a length, an angle or a speed that is not a height above home, a coordinate, and the way from home
_MEASURED: Final = re.compile(
    r"-?\d[\d.]*\s?(?:(?:mm|cm|km|m)(?:/s|/h)?|deg|°)(?![\w/])(?:\s?[NSEW]\b)?(?!\s(?:to [^`]*)?above home)"
    r"|-?\d{1,3}\.\d{3,}(?:\s?[NSEW]\b)?|\bat home\b"
)


def redaction_of(text: str | None) -> tuple[str, ...] | Refusal:
    """What `--redact` names, in the order of `REDACTABLE`."""
    if text is None:
        return ()
    named = [each.strip() for each in text.split(",")]
    wrong = [each for each in named if each not in REDACTABLE]
    if wrong:
        help = "accepted: `position`, `names`, or both: `position,names`"
        return Refusal("usage", f"`{wrong[0]}` is nothing that a page can leave out", help, code=ExitCode.USAGE)
    return tuple(each for each in REDACTABLE if each in named)


def may_stay(removed: Iterable[str]) -> Callable[[bytes], bool]:
    """Whether the line of a record may stay in a redacted log. A genesis has the bundle, and with it names and places;
    the checkpoints of signed records name the vehicle; a decision has the position in its state; a detail may have
    anything.
    """
    names = "names" in removed

    def stays(line: bytes) -> bool:
        record = read(line)
        if isinstance(record, Effect):
            return not record.detail
        if isinstance(record, Seal | Recover | Close):
            return not names
        return False

    return stays


def bare_flight(flight: Flight) -> Flight:
    """A flight without the texts of others in its records and its mission."""
    records = tuple(map(_without_texts, flight.records))
    return flight._replace(records=records, mission=msgspec.structs.replace(flight.mission, intent=""))


def bare_report(report: LogReport) -> LogReport:
    """The report of a verification without texts that quote something: flaws, and claims that are not listed."""
    failure, shortfall = report.failure, report.shortfall
    return report._replace(
        failure=None if failure is None else failure._replace(text="what was found is left out", found="", expected=""),
        shortfall=None if shortfall is None else shortfall._replace(text=shortfall.slug, found="", expected=""),
        proven=tuple(map(_bare_claim, report.proven)),
        unproven=tuple(map(_bare_claim, report.unproven)),
    )


def _bare_claim(claim: Claim) -> Claim:
    return claim if claim.slug in _TOLD_CLAIMS else claim._replace(text=f"the claim {claim.slug}, not told here")


def _without_texts(record: AnyRecord) -> AnyRecord:
    if isinstance(record, DecisionRecord):
        return msgspec.structs.replace(record, clause=None, clause_at=None, target=None)
    if not isinstance(record, Effect):
        return record
    return msgspec.structs.replace(record, detail=_numbers_of_images(record))


def _numbers_of_images(record: Effect) -> str:
    """The detail of a record about images without the names of files: numbers, which are removed by what they are."""
    if record.event == IMAGE and (image := read_image(record.detail)) is not None:
        return encoded(msgspec.structs.replace(image, file=""))
    return record.detail if record.event == IMAGES_MISSING and read_missing(record.detail) is not None else ""


class Redaction:
    """Removes what should not be seen from the report of a flight. `missions` are those that it began with and had in
    force, `persons` those who may have signed.
    """

    def __init__(
        self, flight: Flight, persons: Iterable[str], removed: tuple[str, ...], missions: Iterable[Mission] = ()
    ) -> None:
        self.position, self.names = "position" in removed, "names" in removed
        self._removed = removed
        policy = flight.policy
        self._signals = {each.name: each for each in policy.signals}
        self._words = dict(_words(policy))
        self._skills = {each.name for each in policy.contracts}
        self._names = dict(_names(flight, (flight.mission, *missions), persons))
        self._said: set[str] = set()
        self._searched = _searched(flight, {**self._words, **self._names}) if self.names else {}
        distinct = (name for name in self._searched if shape(name) not in ordinary_words())
        choices = "|".join(
            rf"(?<!\w){re.escape(name)}(?!\w)" for name in sorted(distinct, key=len, reverse=True)
        )  # fmt: skip
        self._pattern = re.compile(choices, re.IGNORECASE) if choices else None
        self._folded = {name.casefold(): told for name, told in self._searched.items()}
        projection = policy.projection
        self._home = projection.latitude, projection.longitude

    def report(self, report: FlightReport, flight: Flight) -> FlightReport:
        """The report without what is removed."""
        kept = {name for name, each in self._signals.items() if not self.position or _no_place(each)}
        report = report._replace(
            records=tuple(_listed(each, flight.since_begun(each)) for each in flight.records[: len(report.records)]),
            redacted=self._removed,
            decisions=tuple(each._replace(reads=tuple(self._reads(each, kept))) for each in report.decisions),
            signals=tuple(each for each in report.signals if each.series.name in kept),
        )
        cleaned: FlightReport = self._part(report)
        return cleaned._replace(signals=tuple(map(_with_limits_told, cleaned.signals)))

    def left(self, page: str) -> Refusal | None:
        """The refusal of a page, or of a logbook, in which something is left that should be gone."""
        return _refusal(self._search().in_page(page))

    def left_in(self, report: FlightReport) -> Refusal | None:
        """The refusal of a redacted report in which something is left that should be gone."""
        return _refusal(self._search().in_report(report))

    def _search(self) -> LeftOver:
        return LeftOver(
            tuple(self._searched), self._said, may_stay(self._removed), self._home if self.position else None
        )

    # -------------------------------------------------------------------------------------------- by kind

    def _part(self, value: Any) -> Any:
        """A value of the report, whose fields have kinds."""
        kinds = KINDS[type(value)]
        new = {name: self._kept(kinds[name], getattr(value, name)) for name in fields_of(type(value))}
        if is_dataclass(value) and not isinstance(value, type):
            return dataclass_replace(value, **new)
        return type(value)(**new)

    def _kept(self, kind: FieldKind, value: Any) -> Any:
        """The value of a field, or what stands in its place."""
        if value is None:
            return None
        if kind in (FieldKind.PLACE, FieldKind.NO_PLACE):
            if self.position:
                return None if kind is FieldKind.NO_PLACE else type(value)()
            return self._inner(value)
        if kind is FieldKind.OUTSIDE:
            return type(value)()
        if isinstance(value, tuple) and type(value) is tuple and kind not in (FieldKind.VALUE, FieldKind.MACHINE):
            return tuple(self._kept(kind, each) for each in value)
        if isinstance(value, Mapping) and kind is FieldKind.WORD:
            return {number: self._word(each) for number, each in value.items()}
        return self._one(kind, value)

    def _one(self, kind: FieldKind, value: Any) -> Any:
        match kind:
            case FieldKind.PART:
                return self._part(value)
            case FieldKind.TEXT:
                return self._sentence(value)
            case FieldKind.NAME:
                return self._names.get(value, _GONE if value else "") if self.names else value
            case FieldKind.WORD:
                return self._word(value)
            case FieldKind.CALL:
                return self._code(value) if value else ""
            case FieldKind.SOURCE:
                return "" if self.names else value
            case FieldKind.MACHINE | FieldKind.TIME | FieldKind.HEIGHT | FieldKind.VALUE | FieldKind.LOG:
                if isinstance(value, str) and kind is not FieldKind.LOG:
                    self._said |= words_of(value)
                return value
        raise TypeError(f"{kind} of {type(value).__name__} has no rule")

    def _inner(self, value: Any) -> Any:
        """A place that stays; it may have names in it."""
        if type(value) is tuple:
            return tuple(map(self._inner, value))
        return self._part(value) if type(value) in KINDS else value

    # -------------------------------------------------------------------------------------------- texts

    def _sentence(self, text: str) -> str:
        """A sentence of ours: of its code only what is known, of the rest neither names nor places."""
        parts = text.split("`")
        if len(parts) % 2 == 0:
            return _GONE  # no sentence of ours
        return "`".join(self._code(part) if number % 2 else self._plain(part) for number, part in enumerate(parts))

    def _code(self, part: str) -> str:
        call = _CALL.match(part)
        if call is not None:
            return self._word(call[1]) if call[1] in self._skills else _GONE
        if part in self._names:
            return self._names[part] if self.names else part
        if part in self._words:
            return self._word(part)
        if _CONSTANT.fullmatch(part) or (HEX.fullmatch(part) and not self.names):
            return part
        return _GONE

    def _plain(self, part: str) -> str:
        if self.names:
            part = HEX.sub(_KEY, part)
            if self._pattern is not None:
                part = self._pattern.sub(lambda found: self._folded.get(found[0].casefold(), _GONE), part)
        return _MEASURED.sub(_PLACE, part) if self.position else part

    def _word(self, word: str) -> str:
        """A word of the policy's language: it stays if it is one of ours."""
        if not self.names or word in _public() or word.isdecimal():
            self._said |= words_of(word)
            return word
        return self._words.get(word, _GONE)

    def _reads(self, decision: DecisionView, kept: set[str]) -> Iterator[ReadSignal]:
        """What a decision read of signals that may stay; arguments go."""
        for each in decision.reads:
            signal = self._signals.get(each.name)
            if signal is None or each.age_us is None or each.name not in kept:
                continue
            label, stale, rest = each.value.partition(" (")
            labelled = label in dict(signal.labels).values()
            yield each._replace(value=f"{self._word(label)}{stale}{rest}") if labelled else each


def _refusal(found: str | None) -> Refusal | None:
    if found is None:
        return None
    what = f"the page would still have `{found}`: it is not written"
    return Refusal("redaction", what, "please report it", code=ExitCode.FAULT)


def _with_limits_told(curve: SignalCurve) -> SignalCurve:
    """A signal whose limits have words in place of the clauses that state them."""
    return curve._replace(limits=tuple(each._replace(told="a limit of a condition") for each in curve.limits))


def _no_place(signal: Signal) -> bool:
    """Whether all that a signal may be read from is listed as saying nothing of a place."""
    return bool(signal.sources) and all(
        each.message in _NO_PLACE and ((allowed := _NO_PLACE[each.message]) is None or allowed.issuperset(each.fields))
        for each in signal.sources
    )


def _listed(record: AnyRecord, t_us: int) -> ListedRecord:
    """A record without its details."""
    if isinstance(record, DecisionRecord):
        told = f"decision: {record.outcome}, {record.reason}"
    elif isinstance(record, Effect):
        told = f"effect: {record.event}"
    else:
        told = record.type
    return ListedRecord(record.seq, t_us, told)


@cache
def _public() -> frozenset[str]:
    """The identifiers of the shipped skills and signals, and the names of dimensions: they tell nothing of anybody."""
    files = sorted((library.root() / "skills").glob("*.rts"))
    texts = (read_regular(each, _MOST_SOURCE).decode("utf-8") for each in files)
    plain = (re.sub(r"//.*|/\*.*?\*/", "", text) for text in texts)
    found = {word for text in plain for word in re.findall(r"[A-Za-z_][\w.]*", text)}
    return frozenset(found | {each.value for each in Dimension} | {"position"})


def _names(flight: Flight, missions: Sequence[Mission], persons: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield each name with what stands in its place; of a name with two meanings, the last."""
    policy, genesis, vehicle = flight.policy, flight.genesis, flight.policy.vehicle
    signed = f"{policy.name}@{policy.version}"
    sources = chain(policy.sources, *(each.sources for each in missions))
    names = [
        *_numbered("role", policy.roles),
        *_numbered("phase", chain(policy.phases, *(each.phases for each in missions))),
        *((name, told) for name, told in _numbered("source", sources) if not name.startswith(LIBRARY)),
        *_numbered("zone", (each.name for each in policy.zones)),
        *_numbered("person", persons),
    ]
    names += [(each.proposer, "a proposer") for each in missions]
    names += [(each.name, "the mission") for each in missions]
    names += [(genesis.mission, "the mission"), (policy.name, "the policy"), (signed, "the policy")]
    names += [(each, "the vehicle") for each in (vehicle.identity, vehicle.name, genesis.vehicle)]
    yield from ((name, told) for name, told in names if name)


def _numbered(what: str, names: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield each name once, with what it is and its number."""
    return ((name, f"{what} {number}") for number, name in enumerate(dict.fromkeys(names), 1))


def _words(policy: Policy) -> Iterator[tuple[str, str]]:
    """Yield each word of the policy's own language with what stands in its place if it is not one of ours."""
    for number, signal in enumerate(policy.signals, 1):
        yield from ((label, f"value {at}") for at, label in signal.labels)
        yield signal.dimension, "a quantity"
        yield signal.name, f"signal {number}"
    for number, contract in enumerate(policy.contracts, 1):
        for parameter in contract.parameters:
            yield from ((label, f"choice {at}") for at, label in enumerate(parameter.labels))
        yield contract.name, f"skill {number}"


def _searched(flight: Flight, replaced: Mapping[str, str]) -> dict[str, str]:
    """What must not be left, with what stands in its place: names, and words that are not ours."""
    found = {name: told for name, told in replaced.items() if name not in _public()}
    found[flight.genesis.boot] = "the flight"
    for name in tuple(found):
        path = PurePosixPath(name)
        if found[name].startswith("source ") and path.stem not in _public():
            found.setdefault(path.name, found[name])
            found.setdefault(path.stem, found[name])
    return found
