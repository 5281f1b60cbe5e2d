"""The agent socket: access, messages in both directions, and clients that must not delay a flight."""

import json
import os
import socket
import stat
import threading
from base64 import b64encode
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import count, repeat
from pathlib import Path

import pytest

from rtshcua.adapters import agent_socket
from rtshcua.adapters.agent_socket import (
    CLIENT_BYTES,
    CLIENT_LINES,
    GAP_US,
    LIGHT_GAP_US,
    LONGEST,
    MOST_FRAME,
    MOST_OF_A_PEER,
    MOST_READERS,
    MOST_WAITING,
    REQUESTS,
    AgentSocket,
    ClientLine,
    FlightFollower,
    FlightReply,
    FrameRequest,
    Peer,
    SocketTaken,
    flight_at,
    hand_in,
    peer_of,
)
from rtshcua.onboard.ports import Presented

HELLO = b'{"type":"hello"}\n'


@pytest.fixture
def folder() -> Iterator[Path]:
    """A short path, because the path of a socket has at most 107 bytes."""
    import tempfile

    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        yield Path(name)


@pytest.fixture
def agents(folder: Path) -> Iterator[AgentSocket]:
    found = AgentSocket(folder / "s", lambda: HELLO)
    yield found
    found.close()


def reader(agents: AgentSocket) -> socket.socket:
    link = socket.socket(socket.AF_UNIX)
    link.connect(str(agents.path))
    link.settimeout(5)
    return link


def heard(link: socket.socket) -> list[bytes]:
    """The lines received so far, all complete."""
    data = link.recv(1 << 20)
    assert data.endswith(b"\n")
    return data.splitlines()


def handed(document: bytes, number: int = 0) -> bytes:
    return json.dumps({"id": number, "document": b64encode(document).decode()}).encode() + b"\n"


def test_its_owner_alone_may_use_it(agents: AgentSocket) -> None:
    mode = agents.path.stat().st_mode
    assert stat.S_ISSOCK(mode)
    assert stat.S_IMODE(mode) == 0o600


def test_a_reader_is_greeted_and_told_every_line_from_then_on(agents: AgentSocket) -> None:
    agents.tell(b"before\n")
    with reader(agents) as link:
        assert agents.poll(1) is None
        agents.tell(b"one\n")
        agents.tell(b"two\n")
        assert heard(link) == [HELLO.strip(), b"one", b"two"]


def test_a_document_comes_in_and_its_sender_alone_gets_the_answer(agents: AgentSocket) -> None:
    with reader(agents) as one, reader(agents) as other:
        one.sendall(handed(b"paper", 7))
        event = agents.poll(5)
        assert isinstance(event, Presented)
        assert (event.at_us, event.document) == (5, b"paper")
        agents.answer(event.sender, "accepted", "well")
        agents.answer(event.sender, "accepted", "twice")
        assert [json.loads(line) for line in heard(one)] == [
            json.loads(HELLO), {"type": "answer", "id": 7, "slug": "accepted", "text": "well"}
        ]  # fmt: skip
        assert heard(other) == [HELLO.strip()]


def test_documents_are_taken_in_turn_and_rate_limited(agents: AgentSocket) -> None:
    with reader(agents) as one, reader(agents) as other:
        one.sendall(b"".join(handed(b"%d" % number) for number in range(3)))
        other.sendall(handed(b"x"))
        taken = [agents.poll(at_us) for at_us in range(0, 6 * GAP_US, GAP_US // 2)]
        assert [event and event.document for event in taken[:8]] == [b"0", None, b"x", None, b"1", None, b"2", None]
        assert not any(taken[8:])


def test_a_line_may_come_in_pieces(agents: AgentSocket) -> None:
    with reader(agents) as link:
        line = handed(b"paper")
        link.sendall(line[:10])
        assert agents.poll(0) is None
        link.sendall(line[10:])
        event = agents.poll(0)
        assert event is not None
        assert event.document == b"paper"


@pytest.mark.parametrize("line", [b"\n", b"{}\n", b"hello\n", b'{"document":"!!"}\n', b'{"document":"aGk=","x":1}\n',
                                  b'{"document":7}\n', b"\xff\xfe\n", b"[" * 5000 + b"\n"])  # fmt: skip
def test_malformed_line_is_answered_and_changes_nothing(agents: AgentSocket, line: bytes) -> None:
    with reader(agents) as link:
        link.sendall(line)
        assert agents.poll(0) is None
        assert json.loads(heard(link)[-1])["slug"] == "malformed"
        assert len(agents.readers) == 1


@pytest.mark.parametrize(
    ("line", "number"),
    [
        (b'{"id":7,"document":"!!"}\n', 7),
        (b'{"id":7,"document":7}\n', 7),
        (b'{"id":7,"document":"aGk=","x":1}\n', 7),
        (b'{"id":7}\n', 7),
        (b'{"id":"7","document":"aGk="}\n', 0),
        (b'{"id":7,\n', 0),
    ],
)
def test_malformed_line_is_answered_with_its_id(agents: AgentSocket, line: bytes, number: int) -> None:
    with reader(agents) as link:
        link.sendall(line)
        assert agents.poll(0) is None
        assert json.loads(heard(link)[-1])["id"] == number


def test_a_line_without_an_end_is_not_kept_for_ever(agents: AgentSocket) -> None:
    with reader(agents) as link:
        link.setblocking(False)
        most = 0
        for _ in range(200):
            try:
                link.send(b"x" * (1 << 16))
            except BlockingIOError:
                pass
            except OSError:
                break
            agents.poll(0)
            most += 1 << 16
            if not agents.readers:
                break
        assert len(agents.readers) == 0
        assert most <= LONGEST + (1 << 18)


def test_stalled_reader_is_dropped_without_affecting_others(agents: AgentSocket) -> None:
    line = b"y" * 4095 + b"\n"
    with reader(agents) as slow, reader(agents) as good:
        agents.poll(0)
        assert len(agents.readers) == 2
        told = 0
        while len(agents.readers) == 2 and told < 4 * MOST_WAITING:
            agents.tell(line)
            told += len(line)
            good.recv(1 << 20)
        assert len(agents.readers) == 1
        assert told < 2 * MOST_WAITING
        agents.tell(b"on\n")
        assert good.recv(100) == b"on\n"
        assert slow.fileno() >= 0


def test_disconnected_reader_and_its_pending_answer_are_dropped(agents: AgentSocket) -> None:
    link = reader(agents)
    link.sendall(handed(b"paper"))
    event = agents.poll(0)
    assert event is not None
    link.close()
    agents.poll(GAP_US)
    agents.answer(event.sender, "accepted", "nobody hears it")
    assert len(agents.readers) == 0


@pytest.fixture
def strangers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make each connection appear to come from another process."""
    processes = count(1)
    monkeypatch.setattr(agent_socket, "peer_of", lambda _: Peer(next(processes), os.geteuid()))


@pytest.mark.usefixtures("strangers")
def test_no_more_readers_than_that(agents: AgentSocket) -> None:
    links = []
    for _ in range(MOST_READERS + 2):
        links.append(reader(agents))
        agents.poll(0)
    assert len(agents.readers) == MOST_READERS
    for link in links:
        link.close()


def test_connections_of_one_process_are_limited(agents: AgentSocket) -> None:
    links = []
    for number in range(MOST_OF_A_PEER + 2):
        links.append(reader(agents))
        agents.poll(number * GAP_US)
    assert len(agents.readers) == MOST_OF_A_PEER
    assert {each.peer for each in agents.readers} == {Peer(os.getpid(), os.geteuid())}
    assert agents.users == {os.geteuid()}
    for each in links[:2]:
        heard(each)
        assert each.recv(1) == b"", "those that were quiet for longest made place"
    for link in links:
        link.close()


@pytest.mark.parametrize("alike", [False, True])
def test_reader_with_pending_document_keeps_its_place(
    agents: AgentSocket, monkeypatch: pytest.MonkeyPatch, alike: bool
) -> None:
    """A document that waits for its turn is not dropped for a later client."""
    processes = repeat(7) if alike else count(1)
    monkeypatch.setattr(agent_socket, "peer_of", lambda _: Peer(next(processes), None))
    most = MOST_OF_A_PEER if alike else MOST_READERS
    links = [reader(agents) for _ in range(most)]
    for number, link in enumerate(links):
        link.sendall(handed(b"%d" % number, number) * 2)
    welcomed = [agents.poll(at_us) for at_us in range(most)]
    assert welcomed[0] is not None, "one has been looked at, and the second waits in its buffer"
    assert len(agents.readers) == most
    with reader(agents) as late:
        agents.poll(most)
        heard_last = late.recv(1)
        assert heard_last == b"", "there was no place: it may come again"
    taken = [agents.poll(at_us) for at_us in range(GAP_US, 2 * most * GAP_US, GAP_US)]
    assert all(taken)
    with reader(agents) as late:
        agents.poll(100 * most * GAP_US)
        assert heard(late) == [HELLO.strip()]
    assert agents.users == set()
    for link in links:
        link.close()


def test_the_operators_socket_takes_nobody_but_its_owner(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    operators = AgentSocket(folder / "o", lambda: HELLO, own=True)
    for user, welcome in ((os.geteuid(), True), (0, True), (os.geteuid() + 1, False), (None, True)):
        monkeypatch.setattr(agent_socket, "peer_of", lambda _, user=user: Peer(1, user))
        with reader(operators) as link:
            operators.poll(0)
            assert (link.recv(1) != b"") == welcome
    operators.close()


def test_a_group_may_open_the_agents_socket(folder: Path) -> None:
    agents = AgentSocket(folder / "g", lambda: HELLO, group=os.getegid())
    found = agents.path.stat()
    assert (stat.S_IMODE(found.st_mode), found.st_gid) == (0o660, os.getegid())
    agents.close()


def test_peer_is_unknown_without_peer_credentials(monkeypatch: pytest.MonkeyPatch) -> None:
    one, other = socket.socketpair()
    with one, other:
        assert peer_of(one) == Peer(os.getpid(), os.geteuid())
        monkeypatch.delattr(socket, "SO_PEERCRED")
        assert peer_of(one) == Peer(0, None)
    monkeypatch.setattr(socket, "SO_PEERCRED", 17, raising=False)
    assert peer_of(one) == Peer(0, None), "it is closed"


def test_a_client_that_finds_no_place_tries_again(folder: Path) -> None:
    """First the queue is full, then the connection is closed, then there is room."""
    path = folder / "s"
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen(0)
        waiting = [socket.socket(socket.AF_UNIX) for _ in range(2)]
        for each in waiting:
            each.setblocking(False)
            each.connect_ex(str(path))
        found: list[object] = []
        client = threading.Thread(target=lambda: found.append(hand_in(path, b"paper")))
        client.start()
        for _ in range(3):
            listener.accept()[0].close()
        link, _ = listener.accept()
        with link:
            assert link.recv(1_000)
            link.sendall(b'{"type":"answer","id":1,"slug":"accepted","text":"at last"}\n')
            client.join()
        for each in waiting:
            each.close()
    assert found == [FlightReply("accepted", "at last")]
    with pytest.raises(ConnectionRefusedError):
        hand_in(path, b"paper", patience_s=5)


def test_a_path_that_is_listened_at_is_not_taken_away(agents: AgentSocket) -> None:
    with pytest.raises(SocketTaken):
        AgentSocket(agents.path, lambda: HELLO)
    with reader(agents):
        agents.poll(0)
        assert len(agents.readers) == 1


def test_a_socket_that_a_crash_left_is_replaced_and_a_file_never_is(folder: Path) -> None:
    left = socket.socket(socket.AF_UNIX)
    left.bind(str(folder / "left"))
    left.close()
    again = AgentSocket(folder / "left", lambda: HELLO)
    again.close()
    again.close()
    assert not (folder / "left").exists()
    (folder / "file").write_text("mine")
    with pytest.raises(SocketTaken):
        AgentSocket(folder / "file", lambda: HELLO)
    assert (folder / "file").read_text() == "mine"


def test_foreign_file_at_socket_path_is_kept(folder: Path) -> None:
    path = folder / "socket"
    ours = AgentSocket(path, lambda: HELLO)
    path.unlink()
    theirs = AgentSocket(path, lambda: HELLO)
    ours.close()
    with reader(theirs):
        theirs.poll(0)
        assert len(theirs.readers) == 1
    theirs.close()
    assert not path.exists()


def test_a_path_that_no_socket_can_have(folder: Path) -> None:
    with pytest.raises(OSError, match="at most 107 bytes"):
        AgentSocket(folder / ("x" * 107), lambda: HELLO)


def test_a_client_hands_in_and_waits_for_its_answer(agents: AgentSocket) -> None:
    said: list[object] = []
    client = threading.Thread(target=lambda: said.append(hand_in(agents.path, b"paper")))
    client.start()
    while client.is_alive():
        agents.tell(b'{"type":"effect","seq":1}\n')
        event = agents.poll(0)
        if event is not None:
            agents.answer(event.sender, "expired", event.document.decode())
        client.join(0.001)
    assert said == [("expired", "paper")]


@pytest.mark.parametrize(
    ("says", "found"),
    [
        (b"\xff\xfeno JSON\n", "its reply is malformed"),
        (b"[" * 100_000 + b"\n", "its reply is malformed"),
        (b'{"type":"hello","x":' + b"[" * 100_000 + b"\n", "its reply is malformed"),
        (b'{"type":5}\n', "its reply is malformed"),
        (b'{"type":"hello","flight":"abcd"}\n', "sent no flight id"),
        (b'{"type":"hello","flight":"' + b"zz" * 16 + b'"}\n', "sent no flight id"),
        (b"x" * 400_000, "its line is too long"),
    ],
)
def test_client_refuses_other_program(folder: Path, monkeypatch: pytest.MonkeyPatch, says: bytes, found: str) -> None:
    """Another program may listen at the path, so a recall there must be reported as failed."""
    monkeypatch.setattr(agent_socket, "LONGEST_TOLD", 200_000)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(folder / "s"))
        listener.listen()

        def serve() -> None:
            link, _ = listener.accept()
            with link, suppress(OSError):
                link.sendall(says)
                link.recv(1)

        thread = threading.Thread(target=serve)
        thread.start()
        with pytest.raises(ConnectionError, match=found):
            flight_at(folder / "s")
        thread.join(10)


@contextmanager
def listener(folder: Path, *says: bytes, every_s: float = 0.0) -> Iterator[Path]:
    """A listener that sends these texts in turn until the client disconnects."""
    over = threading.Event()

    def serve() -> None:
        link, _ = door.accept()
        with link, suppress(OSError):
            for each in says:
                link.sendall(each)
                if over.wait(every_s):
                    return
            link.recv(1)

    with socket.socket(socket.AF_UNIX) as door:
        door.bind(str(folder / "l"))
        door.listen()
        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield folder / "l"
        finally:
            over.set()
            thread.join(10)


def test_follower_waits_a_limited_time_for_identity(folder: Path) -> None:
    """This includes a listener that keeps sending."""
    with listener(folder, *[b" "] * 1_000, every_s=0.01) as path, pytest.raises(TimeoutError):
        FlightFollower(path, patience_s=0.1)


@pytest.mark.parametrize(
    ("says", "found"),
    [
        ((b'{"a":1}\n' * 8_000,) * 50, "did not send the identity line first"),
        (
            (b'{"type":"effect"}\n{"type":"hello","flight":"' + b"ab" * 16 + b'"}\n',),
            "did not send the identity line first",
        ),
        ((b" " * 65_536,) * 50, "its line is too long"),
        ((b'{"type":"hello"}\n',), "sent no flight id"),
    ],
    ids=["a flood", "a late hello", "no end", "no id"],
)
def test_follower_refuses_other_program(folder: Path, says: tuple[bytes, ...], found: str) -> None:
    with listener(folder, *says) as path, pytest.raises(ConnectionError, match=found):
        FlightFollower(path)


def test_follower_reassembles_lines_split_across_reads(folder: Path) -> None:
    hello = b'{"type":"hello","flight":"' + b"ab" * 16 + b'"}\n'
    long = b'{"type":"mission","x":"' + b"x" * 300_000 + b'"}\n'
    answer = b'{"type":"answer","id":1,"slug":"accepted","text":"well"}\n'
    heard: list[bytes | FlightReply] = []
    says = (hello[:9], hello[9:] + long[:1000], long[1000:], answer + answer[:9])
    with listener(folder, *says, every_s=0.01) as path, FlightFollower(path) as follower:
        assert follower.flight == b"\xab" * 16
        while len(heard) < 3:
            heard += follower.receive() or []
    assert heard == [hello, long, FlightReply("accepted", "well")]


def test_client_without_a_flight_fails(folder: Path) -> None:
    with pytest.raises(OSError, match="No such file") as raised:
        hand_in(folder / "nothing", b"paper")
    assert raised.value.filename == str(folder / "nothing")


def test_a_client_of_a_flight_that_ends(agents: AgentSocket) -> None:
    said: list[BaseException] = []

    def client() -> None:
        try:
            hand_in(agents.path, b"paper")
        except OSError as error:
            said.append(error)

    thread = threading.Thread(target=client)
    thread.start()
    while not agents.poll(0):
        pass
    agents.close()
    thread.join(10)
    assert isinstance(said[0], ConnectionError)


def test_a_socket_in_no_folder_is_named(folder: Path) -> None:
    with pytest.raises(FileNotFoundError) as refused:
        AgentSocket(folder / "none" / "x", lambda: HELLO)
    assert refused.value.filename == str(folder / "none" / "x")
    (folder / "file").write_text("no socket")
    for path in (folder, folder / "file"):
        with pytest.raises(OSError, match="no flight has an agent socket there"):
            flight_at(path)
    with pytest.raises(OSError, match="too long for a socket"):
        hand_in(folder / ("x" * 120), b"")


# ---------------------------------------------------------------- lines of a gateway


def line_of(**parts: object) -> bytes:
    return json.dumps(parts).encode() + b"\n"


def test_lines_about_clients_and_requests_come_in_beside_documents(agents: AgentSocket) -> None:
    with reader(agents) as link:
        link.sendall(line_of(id=3, client='{"refused":"FTP"}') + line_of(id=4, request=b64encode(b"frame").decode()))
        link.sendall(handed(b"paper", 5))
        found = [agents.poll(1), agents.poll(1), agents.poll(1 + LIGHT_GAP_US), agents.poll(1 + 2 * LIGHT_GAP_US)]
        said, early, asked, document = found
        assert early is None
        assert isinstance(said, ClientLine)
        assert (said.at_us, said.text) == (1, '{"refused":"FTP"}')
        assert isinstance(asked, FrameRequest)
        assert asked.frame == b"frame"
        assert isinstance(document, Presented)
        assert len({said.sender, asked.sender, document.sender}) == 3
        agents.answer(asked.sender, "accepted", "sent")
        assert json.loads(heard(link)[-1])["id"] == 4


@pytest.mark.parametrize("parts", [
    {"client": "no JSON"}, {"client": "[1]"}, {"client": json.dumps({"a": "x" * CLIENT_BYTES})},
    {"client": json.dumps({"a": "é" * (CLIENT_BYTES // 2)}, ensure_ascii=False)}, {"client": "[" * 100},
    {"client": "{}", "document": "aGk="}, {"client": "{}", "request": "aGk="}, {"request": "aGk=", "document": "aGk="},
    {"request": "!!"}, {"request": b64encode(bytes(MOST_FRAME + 1)).decode()}, {"request": "a" * 5_000},
    {"client": 7}, {"request": None}, {"client": ""},
])  # fmt: skip
def test_malformed_line_of_a_gateway_is_answered_with_its_number(agents: AgentSocket, parts: dict[str, object]) -> None:
    with reader(agents) as link:
        link.sendall(line_of(id=9, **parts))
        assert agents.poll(0) is None
        answer = json.loads(heard(link)[-1])
        assert (answer["id"], answer["slug"]) == (9, "malformed")


@pytest.mark.parametrize(("parts", "kind"), [({"client": "{}"}, CLIENT_LINES), ({"request": "aGk="}, REQUESTS)])
def test_lines_of_a_gateway_are_limited_by_user_and_answered_busy(
    agents: AgentSocket, parts: dict[str, str], kind: tuple[int, int]
) -> None:
    each_us, at_once = kind
    start_us = 10_000_000
    with reader(agents) as link:
        link.sendall(line_of(id=1, **parts) * (at_once + 30))
        taken = [agents.poll(start_us + number * LIGHT_GAP_US) for number in range(at_once + 30)]
        more = (at_once + 30) * LIGHT_GAP_US // each_us
        assert [each is not None for each in taken[:at_once]] == [True] * at_once
        assert sum(each is not None for each in taken) <= at_once + more
        assert json.loads(heard(link)[-1])["slug"] == "busy"
        later_us = start_us + 3_600_000_000
        link.sendall(line_of(**parts) * (at_once + 5))
        taken = [agents.poll(later_us + number * LIGHT_GAP_US) for number in range(at_once + 5)]
        assert None not in taken[:at_once], "the whole share again, and no more"
        assert None in taken
