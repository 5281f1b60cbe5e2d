"""The service `approve --wait`: follows a flight, shows the step that waits for a person, and signs what they confirm.

What is signed is the draft that was shown: an answer names the question by a nonce, which is good for one attempt.
Nothing that the flight says is signed: a step is taken from a verified bundle, and must be the one that the flight
requests, by its id and its binding.
"""

import secrets
import threading
import time
from base64 import b64decode
from collections import deque
from collections.abc import Callable, Iterator
from itertools import count
from typing import Any, Final, NamedTuple

import msgspec

from rtshcua.adapters.agent_socket import FlightFollower, FlightReply, hand_in
from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.app.approvals import ApprovalDraft, DeskRequest, dated, draft_about, told_other_path, told_spacing
from rtshcua.app.exit_codes import untrusted, words_of
from rtshcua.app.flight_documents import bundle_in_flight, trusted_root, with_replacements
from rtshcua.app.logs import log_below
from rtshcua.app.open_questions import AskedStep, OpenQuestions, asked_roles
from rtshcua.app.telling.prose import step_parts
from rtshcua.app.wording import shorten
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis
from rtshcua.model.step_number import number_of, step_words
from rtshcua.wire.approval import confirms, sign_approval
from rtshcua.wire.bundle import Bundle, open_bundle
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import HUMAN, TrustRoot, speaker_refusal
from rtshcua.wire.untrusted import Untrusted

#: between two attempts to connect again, and for all of them, s
_AGAIN_S: Final = 0.5
_LOST_S: Final = 60.0
#: a flight whose clock is further ahead than this is sped up, us; an answer to it is valid for so many seconds
_AHEAD_US: Final = 5_000_000
_AHEAD_S: Final = 3_600
#: how many events the page shows, and how much of a mission's name, which its proposer chose, is shown
_EVENTS: Final = 6
_NAME: Final = 80


class StepQuestion(NamedTuple):
    """A question as it is shown. `nonce` is for one answer; without a `draft` it cannot be answered here, and `why_not`
    says why.
    """

    asked: AskedStep
    nonce: str
    draft: ApprovalDraft | None
    why_not: str = ""


class DeskEvent(NamedTuple):
    """Something that the approver is told: a stable name, and a text."""

    event: str
    text: str
    question: StepQuestion | None = None


class _Announced(msgspec.Struct):
    """The members read of a line that is not a record."""

    type: str = ""
    digest: str = ""
    policy_digest: str = ""


_read_announced = msgspec.json.Decoder(_Announced).decode


def open_desk(request: DeskRequest, unlock: Callable[[KeyStore, str], SigningKey]) -> "ApprovalDesk | Refusal":
    """Verify the bundle, unlock the key of the approver, and connect to the flight. Raises OSError."""
    now_us = time.time_ns() // 1000
    try:
        trusted = trusted_root(request.root, now_us)
        base = bundle_in_flight(request.bundle, request.replacements, request.root, now_us)
        asked = asked_roles(base.policy)
        role = request.role or (asked[0] if len(asked) == 1 else "")
        if role not in asked:
            text = f"the `confirm` rules of `{base.policy.name}` ask {'several roles' if asked else 'nobody'}"
            text = f"no `confirm` rule of `{base.policy.name}` asks the role `{role}`" if role else text
            return Refusal("usage", text, f"accepted: --role {', '.join(f'`{each}`' for each in asked)}" * bool(asked))
        key = unlock(KeyStore(data_folder()), role)
    except Untrusted as error:
        return untrusted(error)
    named, vehicle = trusted.keys_for(Duty.APPROVAL).get(key.kid), base.policy.vehicle.identity
    if named is None or speaker_refusal(named, role=role, source=HUMAN, vehicle=vehicle, now_us=now_us):
        text = f"the trust root does not let this key answer as `{role}` on `{vehicle}` now"
        return Refusal("wrong-role", text, "`rtshcua keys approver NAME --role ROLE` makes a key that may")
    return ApprovalDesk(request._replace(role=role), base, trusted, key, named.person)


class ApprovalDesk:
    """One approver at one flight. `turn` never waits for the flight; `answer` and `state` may be called by other
    threads. `code` is the exit code once it is over; `lock` keeps other threads out. Raises OSError where no flight is.
    """

    def __init__(self, request: DeskRequest, base: Bundle, trusted: TrustRoot, key: SigningKey, person: str) -> None:
        self._request, self._base, self._trusted, self._key = request, base, trusted, key
        self.person, self.role = person, request.role or ""
        self.code: ExitCode | None = None
        self.lock = threading.RLock()
        self._events: list[DeskEvent] = []
        self._told: deque[str] = deque(maxlen=_EVENTS)
        self._numbers = count(1)
        self._answered = 0  # the number of the question that was answered last
        self._shown: StepQuestion | None = None
        self._flying: Bundle | None = base  # the mission in force, as far as it is known here
        self._flight, self._lost_s, self._tried_s = b"", 0.0, 0.0
        self._follower: FlightFollower | None = None
        self._connect(FlightFollower(request.to))

    @property
    def descriptor(self) -> int | None:
        """What to wait for before `turn`; None while the connection is lost."""
        return None if self._follower is None else self._follower.fileno()

    def close(self) -> None:
        """Close the connection."""
        if self._follower is not None:
            self._follower.close()

    def turn(self) -> list[DeskEvent]:
        """Take what the flight sent, and return what is new. Raises OSError where the peer is not a flight."""
        with self.lock:
            if self._follower is None:
                self._reconnect()
            elif self.code is None:
                self._hear(self._follower)
            events, self._events = self._events, []
            return events

    def tell(self, event: str, text: str, question: StepQuestion | None = None) -> None:
        """Tell the approver something."""
        with self.lock:
            self._events.append(DeskEvent(event, text, question))
            self._told.append(text)

    def state(self) -> tuple[str, tuple[str, ...], StepQuestion | None]:
        """What a page shows now: the stage (`waiting`, `following`, `lost` or `over`), the latest events, the question
        that is open.
        """
        with self.lock:
            return "over" if self.code is not None else self._stage, tuple(self._told), self._shown

    def view(self, shown: StepQuestion) -> dict[str, Any]:
        """A question in words, for programs and pages; `left_ms` is by the flight's clock as far as it is known."""
        asked, draft, (at_us, heard_s) = shown.asked, shown.draft, self._heard
        left_us = asked.until_us - at_us - int((time.monotonic() - heard_s) * 1e6)
        told: dict[str, Any] = {
            "number": asked.number, "step_number": number_of(asked.step), "role": self.role, "missing": asked.missing,
            "rule": asked.rule, "left_ms": max(0, left_us // 1_000), "why_not": shown.why_not,
        }  # fmt: skip
        if draft is None:
            return told
        parts, bundle = step_parts(draft.bundle.policy, draft.step), draft.bundle
        arguments = [{"name": name, "value": value, "where": where} for name, value, where in parts.arguments]
        return told | {
            "mission": shorten(bundle.mission.name, _NAME), "vehicle": draft.document.vehicle, "skill": parts.skill,
            "arguments": arguments, "path": parts.path, "spacing": told_spacing(draft),
            "other_path": told_other_path(draft), "binding": asked.binding,
        }  # fmt: skip

    def answer(self, nonce: str, *, granted: bool, other_path: bool = False) -> FlightReply | Refusal:
        """Sign the draft of the question that has this nonce, and hand it in. The nonce is used up, whatever the flight
        answers; a question that stays open has another one then.
        """
        with self.lock:
            shown = self._shown
            if not nonce or shown is None or not secrets.compare_digest(nonce.encode(), shown.nonce.encode()):
                return Refusal("question-over", "this question is not open any more: nothing was signed")
            if shown.draft is None:
                return Refusal("unanswerable", f"nothing was signed: {shown.why_not}")
            differs = told_other_path(shown.draft)
            if granted and differs and not other_path:
                return Refusal("other-path", f"nothing was signed: {differs}", "accept that path, or refuse")
            self._shown = shown._replace(nonce="")  # no second answer until the flight has replied
        now_us = time.time_ns() // 1000
        seconds = _AHEAD_S if self._utc_us > now_us + _AHEAD_US else self._request.seconds
        document = dated(shown.draft.document, now_us, seconds, granted=granted)
        try:
            reply = hand_in(self._request.to, sign_approval(document, self._key))
        except OSError as error:
            reply = FlightReply("not-sent", f"the answer did not reach the flight: {words_of(error)}")
        with self.lock:
            done = f"{'approved' if granted else 'refused'} as {document.role}: {step_words(shown.asked.step)}"
            if reply.slug == "accepted":
                self._answered, self._shown = shown.asked.number, None
                self.tell("answered", f"{done}; {reply.text}")
            else:
                self.tell("not-accepted", f"not {done}: {reply.text} ({reply.slug})")
                still = self.state()[2]
                if still is not None and still.asked == shown.asked:
                    self._shown = shown._replace(nonce=secrets.token_urlsafe(16))
        return reply

    # ---------------------------------------------------------------- the connection

    def _connect(self, follower: FlightFollower) -> None:
        """Begin to follow a connection: what came before is in the log, if that is here."""
        self._follower, self._caught_up, self._stage = follower, False, "following"
        if follower.flight != self._flight:
            people = {key.kid: key.person for key in self._trusted.keys_for(Duty.APPROVAL).values()}
            self._open = OpenQuestions(self._base.policy, self.person, self.role, people, self._numbers)
            self._flight, self._flying, self._digest, self._shown = follower.flight, self._base, "", None
            self._seq, self._utc_us, self._heard = -1, 0, (0, time.monotonic())
        self._catch_up()
        where = f"`{self._base.policy.name}` on `{self._base.policy.vehicle.identity}`"
        text = f"flight {self._flight.hex()} under {where}; questions wait for {self.person} as {self.role}"
        self.tell("following", text)

    def _reconnect(self) -> None:
        now_s = time.monotonic()
        if now_s - self._lost_s >= _LOST_S:
            self._end(ExitCode.LINK, "gone", "the connection is lost; whether the flight ended is unknown")
        if self.code is not None or now_s - self._tried_s < _AGAIN_S:
            return
        self._tried_s = now_s
        try:
            self._connect(FlightFollower(self._request.to, patience_s=_AGAIN_S))
        except (ConnectionError, FileNotFoundError, TimeoutError, BlockingIOError) as error:
            if isinstance(error, ConnectionError) and error.errno is None:
                raise  # the peer is not a flight

    def _hear(self, follower: FlightFollower) -> None:
        received = follower.receive()
        for line in received or ():
            if isinstance(line, bytes) and self.code is None:
                self._take(line)
        if received is None:
            follower.close()
            self._follower, self._stage, self._lost_s = None, "lost", time.monotonic()
            self.tell("lost", "the flight closed the connection, and did not say that it is over: it is tried again")

    def _take(self, line: bytes) -> None:
        record = read(line)
        if isinstance(record, Flaw):
            self._announced(line)
        elif isinstance(record, Close):
            self._end(ExitCode.OK, "over", f"the flight has ended: {record.ending}")
        else:
            if not self._caught_up and record.seq > self._seq + 1:
                self._catch_up()  # what was recorded while the log was read
            self._caught_up = True
            if record.seq > self._seq:
                self._utc_us, self._heard = record.utc_us, (record.at_us, time.monotonic())
                self._follow(record)
                self._look()

    def _announced(self, line: bytes) -> None:
        """Learn which mission is in force."""
        try:
            told = _read_announced(line)
        except (ValueError, RecursionError):
            raise ConnectionError("the program that listens there is not a flight: its reply is malformed") from None
        if told.type not in ("mission", "waiting"):
            return
        self._stage = "waiting" if told.type == "waiting" else "following"
        if told.policy_digest != self._base.policy_digest.hex():
            self._end(ExitCode.REFUSED, "other-policy", "the flight is under another policy than that of the bundle")
        elif told.digest != self._digest:
            self._digest = told.digest
            if self._shown is not None and self._shown.draft is None:
                self._open.ask_again()  # its mission may be known now
            self._look()

    def _end(self, code: ExitCode, event: str, text: str) -> None:
        self.code, self._shown = code, None
        self.tell(event, text)

    # ---------------------------------------------------------------- the questions

    def _follow(self, record: AnyRecord) -> None:
        self._seq = record.seq
        if not isinstance(record, DecisionRecord | Effect):
            return
        why = self._open.take(record)
        if isinstance(record, Effect) and record.event == "replacement":
            self._replace(record.detail)
        if why and self._shown is not None:
            if self._shown.nonce:  # else an answer is on its way, and its reply says the same
                number, step = self._shown.asked.number, self._shown.asked.step
                self.tell("closed", f"question {number}, {step_words(step)}: {why}")
            self._shown = None

    def _look(self) -> None:
        """Show the question that is open, unless it is shown or answered."""
        asked, shown = self._open.current, self._shown
        if asked is None or asked.number == self._answered or (shown is not None and shown.asked == asked):
            return
        draft = self._draft(asked)
        why_not = "" if isinstance(draft, ApprovalDraft) else draft
        found = draft if isinstance(draft, ApprovalDraft) else None
        self._shown = StepQuestion(asked, secrets.token_urlsafe(16), found, why_not)
        self.tell("question", f"{step_words(asked.step)} waits for {' and '.join(asked.missing)}", self._shown)

    def _draft(self, asked: AskedStep) -> ApprovalDraft | str:
        """The answer to the step of a question, in the verified mission in force; else why it cannot be answered."""
        for attempt in (self._read_log, None):
            flying = self._flying
            if flying is not None and self._digest in ("", flying.mission_digest.hex()):
                for about in flying.mission.invocations:
                    if (about.invocation_id.hex(), about.binding.hex()) == (asked.invocation, asked.binding):
                        rules = confirms(flying.policy, about, flying.policy.roles.index(self.role))
                        if asked.rule not in (flying.policy.rules[each].text for each in rules):
                            return "its rule does not concern this step"
                        return draft_about(flying, about, self.role, self._flight)
            if attempt is not None and (failed := attempt()):
                return failed
        return "the step that the flight requests is not in its mission"

    def _replace(self, detail: str) -> None:
        """Put a recorded replacement into force, if it is trusted here."""
        flying, self._flying, self._digest = self._flying, None, ""
        try:
            if flying is not None:
                document = b64decode(detail, validate=True)
                self._flying = with_replacements(flying, [document], self._trusted, time.time_ns() // 1000)
        except (ValueError, Untrusted):
            return  # its questions are shown, but cannot be answered

    # ---------------------------------------------------------------- the log

    def _records(self) -> Iterator[AnyRecord]:
        """The records of the flight's log so far, if it is below the folder of runs."""
        log = log_below(self._request.runs, self._flight)
        if log is None:
            return
        with open_regular(log) as file:
            for line in lines(file):
                record = read(line)
                if isinstance(record, Flaw):
                    return  # it is being written
                yield record

    def _catch_up(self) -> None:
        """Take the records that were written before this connection."""
        for record in self._records():
            if record.seq > self._seq:
                since_us = max(0, time.time_ns() // 1000 - record.utc_us)
                self._utc_us, self._heard = record.utc_us, (record.at_us + since_us, time.monotonic())
                self._follow(record)

    def _read_log(self) -> str:
        """Take the mission in force from the log; return why that is not possible, or an empty text."""
        documents, data, now_us = [], b"", time.time_ns() // 1000
        try:
            for record in self._records():
                if isinstance(record, Genesis):
                    data = b64decode(record.bundle)
                elif isinstance(record, Effect) and record.event == "replacement":
                    documents.append(b64decode(record.detail, validate=True))
            if not data:
                runs = f"no log of the flight is below `{self._request.runs}`: name its folder with `--runs`"
                return f"its mission is not that of the bundle, and {runs}"
            found = open_bundle(data, root=self._trusted, vehicle=None, now_us=now_us)
            if found.policy_digest != self._base.policy_digest:
                return "the mission in its log is under another policy"
            self._flying = with_replacements(found, documents, self._trusted, now_us)
        except (ValueError, Untrusted) as error:
            return f"its mission cannot be verified here: {error}"
        return ""
