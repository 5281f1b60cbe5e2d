"""The import closure: each file once, every fault a finding."""

from collections.abc import Iterable

import pytest

from rtshcua.diagnostics.codes import IMPORT_PATH, NO_SUCH_FILE, NOT_TEXT, TOO_LARGE
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.language.parse import MAX_SIZE


class Files:
    """Files in memory, under the folder `/w`, which no machine has."""

    def __init__(self, **files: str | bytes) -> None:
        self.files = {
            "/w/" + name.replace("__", "/") + ".rts": data if isinstance(data, bytes) else data.encode()
            for name, data in files.items()
        }
        self.reads: list[str] = []

    def read(self, path: str) -> bytes:
        self.reads.append(path)
        if path == "/w/folder.rts":
            raise IsADirectoryError(21, "Is a directory")
        if path not in self.files:
            raise FileNotFoundError(2, "No such file or directory")
        return self.files[path]

    def names(self, path: str) -> Iterable[str]:
        found = [name.rpartition("/")[2] for name in self.files if name.rpartition("/")[0] == path]
        if not found:
            raise FileNotFoundError(2, "No such file or directory")
        return found

    def load(self, *paths: str, library: str | None = "/w/lib") -> Program:
        return load([f"/w/{path}.rts" for path in paths], self.read, library, self.names)


def zone(name: str) -> str:
    return f"zone {name} = circle(1 N, 2 E, 3 m)\n"


def test_closure_in_the_order_in_which_it_is_reached() -> None:
    files = Files(
        a='import "b.rts" import "sub/c.rts"' + zone("a"),
        b='import "lib:d.rts"' + zone("b"),
        sub__c='import "../b.rts" import "./e.rts"' + zone("c"),
        sub__e=zone("e"),
        lib__d='import "lib:sub/../f.rts"' + zone("d"),
        lib__f=zone("f"),
    )
    program = files.load("a")
    assert program.diagnostics == ()
    assert [unit.zones[0].name.text for unit in program.units] == ["a", "b", "c", "d", "e", "f"]
    assert list(program.sources) == files.reads == [unit.file for unit in program.units]
    assert list(program.stable.values()) == ["a.rts", "b.rts", "sub/c.rts", "lib:d.rts", "sub/e.rts", "lib:f.rts"]


def test_a_circle_of_imports_is_harmless() -> None:
    files = Files(a='import "b.rts"', b='import "c.rts" import "b.rts"', c='import "a.rts"')
    program = files.load("a", "a", "c")
    assert program.diagnostics == ()
    assert files.reads == ["/w/a.rts", "/w/c.rts", "/w/b.rts"]


def test_stable_names_do_not_depend_on_the_machine() -> None:
    files = Files(m__a='import "../b.rts"', b="")
    assert list(files.load("m/a").stable.values()) == ["a.rts", "../b.rts"]


def test_findings_and_broken_names_of_all_files() -> None:
    program = Files(a='import "b.rts"\nzone x = ?', b="zone y = ?").load("a")
    assert [found.span.file for found in program.diagnostics if found.span] == ["/w/a.rts", "/w/b.rts"]
    assert program.broken == {"x", "y"}


def test_a_missing_file_is_named_with_where_it_was_looked_for() -> None:
    (found,) = Files(a='import "sub/gotoo.rts"', sub__goto="").load("a").diagnostics
    assert found.code is NO_SUCH_FILE
    assert found.message == "cannot read `sub/gotoo.rts`: there is no such file"
    assert found.help == "looked for it at `/w/sub/gotoo.rts`; did you mean `sub/goto.rts`?"
    assert found.fixes[0].replacement == 'import "sub/goto.rts"'
    assert found.span is not None
    (found,) = Files(a='import "none/x.rts"').load("a").diagnostics
    assert found.help == "looked for it at `/w/none/x.rts`"
    assert found.fixes == ()


def test_a_missing_file_that_was_asked_for_has_no_span() -> None:
    (found,) = Files(mission="").load("misson").diagnostics
    assert (found.code, found.span) == (NO_SUCH_FILE, None)
    assert found.message == "cannot read `/w/misson.rts`: there is no such file"
    assert found.help == "did you mean `/w/mission.rts`?"


def test_a_folder() -> None:
    (found,) = Files(a='import "folder.rts"').load("a").diagnostics
    assert found.message == "cannot read `folder.rts`: is a directory"


def test_without_listing_there_is_no_suggestion() -> None:
    (found,) = load(["/w/x.rts"], Files().read).diagnostics
    assert (found.code, found.help) == (NO_SUCH_FILE, None)


@pytest.mark.parametrize("path", ["", "/etc/passwd", "C:x.rts", "a\\\\b.rts", "~/x.rts", "http://x/y.rts"])
def test_paths_that_mean_nothing_elsewhere(path: str) -> None:
    files = Files(a=f'import "{path}"')
    (found,) = files.load("a").diagnostics
    assert found.code is IMPORT_PATH
    assert files.reads == ["/w/a.rts"]


def test_the_library_must_be_there() -> None:
    (found,) = Files(a='import "lib:x.rts"').load("a", library=None).diagnostics
    assert found.code is IMPORT_PATH


def test_bytes_that_are_no_text() -> None:
    program = Files(a='import "b.rts"' + zone("a"), b="é".encode() + b"zone \xff\xfe").load("a")
    (found,) = program.diagnostics
    assert found.code is NOT_TEXT
    assert found.message == "byte 7 (0xff) is not UTF-8, so the file is not text"
    assert found.span is not None
    assert program.sources["/w/b.rts"].slice(found.span) == "\ufffd"
    assert [unit.file for unit in program.units] == ["/w/a.rts"]


def test_a_huge_file_is_not_parsed() -> None:
    (found,) = Files(a=b" " * (MAX_SIZE + 1)).load("a").diagnostics
    assert (found.code, found.span) == (TOO_LARGE, None)
    assert found.message == "`/w/a.rts` is 9 MiB large; at most 8 MiB are read"


def test_byte_order_mark_and_line_ends() -> None:
    program = Files(a=b"\xef\xbb\xbf" + zone("a").replace("\n", "\r\n").encode() + b"zone b = ?\r\n").load("a")
    (found,) = program.diagnostics
    assert found.span is not None
    assert program.sources["/w/a.rts"].position(found.span.start) == (2, 10)
    assert program.sources["/w/a.rts"].line(2) == "zone b = ?"


def test_nothing_asked_for() -> None:
    assert load([], Files().read) == Program((), {}, (), frozenset(), {})
