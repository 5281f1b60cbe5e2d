"""Imports and zone files are read once, and every fault of a file is a finding."""

from collections.abc import Iterable

from rtshcua.diagnostics.codes import IMPORT_CYCLE, IMPORT_PATH, NO_SUCH_FILE, NOT_TEXT, TOO_LARGE, Severity
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.file_findings import MAX_SIZE
from rtshcua.ground.language.load import Program, load
from virtual.rows import rows


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


def test_imports_are_loaded_in_order_of_reach() -> None:
    files = Files(
        a='import "b.rts" import "sub/c.rts"' + zone("a"),
        b='import "lib:d.rts"' + zone("b"),
        sub__c='import "../b.rts" import "./e.rts"' + zone("c"),
        sub__e=zone("e"),
        lib__d='import "lib:f.rts"' + zone("d"),
        lib__f=zone("f"),
    )
    program = files.load("a")
    assert program.diagnostics == ()
    assert [unit.zones[0].name.text for unit in program.units] == ["a", "b", "c", "d", "e", "f"]
    assert list(program.sources) == files.reads == [unit.file for unit in program.units]
    assert list(program.stable.values()) == ["a.rts", "b.rts", "sub/c.rts", "lib:d.rts", "sub/e.rts", "lib:f.rts"]


def circles(program: Program) -> list[tuple[str, str]]:
    """The file of each import that closes a cycle, and the cycle by the first letters of its files."""
    found = [each for each in program.diagnostics if each.code is IMPORT_CYCLE]
    assert all(each.severity is Severity.WARNING for each in found)
    said = [each.message.removeprefix("import cycle: ").strip("`") for each in found]
    files = [each.span.file if each.span else "" for each in found]
    return [
        (file[3:-4], "".join(name[3:-4] for name in text.split(" -> "))) for file, text in zip(files, said, strict=True)
    ]


def test_files_of_an_import_cycle_are_read_once() -> None:
    files = Files(a='import "b.rts"', b='import "c.rts" import "b.rts"', c='import "a.rts"')
    program = files.load("a", "a", "c")
    assert files.reads == ["/w/a.rts", "/w/c.rts", "/w/b.rts"]
    assert circles(program) == [("c", "abca"), ("b", "bb")]


@rows(
    ("files", "expected"),
    [
        ({"a": "b", "b": ""}, []),
        ({"a": "bc", "b": "d", "c": "d", "d": ""}, []),
        ({"a": "a"}, [("a", "aa")]),
        ({"a": "b", "b": "a"}, [("b", "aba")]),
        ({"a": "b", "b": "c", "c": "db", "d": "b"}, [("d", "bcdb"), ("c", "bcb")]),
        ({"a": "bcd", "b": "a", "c": "a", "d": "d"}, [("b", "aba"), ("c", "aca"), ("d", "dd")]),
        ({"a": "cb", "b": "c", "c": "b"}, [("b", "cbc")]),
        ({"a": "b"}, []),
    ],
)
def test_import_cycles_are_reported(files: dict[str, str], expected: list[tuple[str, str]]) -> None:
    sources = {name: "".join(f'import "{other}.rts"\n' for other in others) for name, others in files.items()}
    assert circles(Files(**sources).load("a")) == expected


def test_import_cycle_names_all_its_files() -> None:
    (found,) = Files(a='import "b.rts"', b='\nimport "a.rts"').load("a").diagnostics
    assert found.message == "import cycle: `/w/a.rts -> /w/b.rts -> /w/a.rts`"
    assert (found.span, [label.span for label in found.labels]) == (Span("/w/b.rts", 1, 15), [Span("/w/a.rts", 0, 14)])


def test_long_import_cycle_is_abbreviated() -> None:
    names = [f"f{number}" for number in range(300)]
    sources = {name: f'import "{after}.rts"' for name, after in zip(names, [*names[1:], "f0"], strict=True)}
    (found,) = Files(**sources).load("f0").diagnostics
    shown = found.message.split(" -> ")
    assert shown[5:8] == ["/w/f5.rts", "(289 more)", "/w/f295.rts"]
    assert (len(shown), len(found.labels)) == (13, 12)


SQUARE = b'{"type": "Polygon", "coordinates": []}'


def test_zone_files_are_loaded() -> None:
    files = Files(
        a='import "sub/b.rts" zone p from "p.geojson" zone q from "sub/../p.geojson" feature "f"',
        sub__b='zone r from "../p.geojson" zone s from "lib:zones/s.geojson"',
    )
    files.files |= {"/w/p.geojson": SQUARE, "/w/lib/zones/s.geojson": b"\xef\xbb\xbfany text"}
    program = files.load("a")
    assert program.diagnostics == ()
    assert program.data == {"/w/p.geojson": SQUARE, "/w/lib/zones/s.geojson": b"\xef\xbb\xbfany text"}
    assert program.data_names == {
        ("/w/a.rts", "p.geojson"): "/w/p.geojson",
        ("/w/a.rts", "sub/../p.geojson"): "/w/p.geojson",
        ("/w/sub/b.rts", "../p.geojson"): "/w/p.geojson",
        ("/w/sub/b.rts", "lib:zones/s.geojson"): "/w/lib/zones/s.geojson",
    }
    assert program.stable == {
        "/w/a.rts": "a.rts",
        "/w/sub/b.rts": "sub/b.rts",
        "/w/p.geojson": "p.geojson",
        "/w/lib/zones/s.geojson": "lib:zones/s.geojson",
    }
    assert list(program.sources) == ["/w/a.rts", "/w/sub/b.rts"]
    assert files.reads.count("/w/p.geojson") == 1


def test_missing_zone_file_is_reported() -> None:
    files = Files(a='zone z from "brigde.geojson" feature "x \\"y\\"" zone y from "brigde.geojson"')
    files.files["/w/bridge.geojson"] = SQUARE
    program = files.load("a")
    (found,) = program.diagnostics
    assert found.code is NO_SUCH_FILE
    assert found.message == "cannot read `brigde.geojson`: no such file"
    assert found.help == "the file was expected at `/w/brigde.geojson`; did you mean `bridge.geojson`?"
    assert found.fixes[0].replacement == 'from "bridge.geojson" feature "x \\"y\\""'
    assert found.span is not None
    assert program.sources["/w/a.rts"].slice(found.span) == 'from "brigde.geojson" feature "x \\"y\\""'
    assert (program.data, program.data_names) == ({}, {})
    assert [zone.name.text for zone in program.units[0].zones] == ["z", "y"]
    (found,) = Files(a='zone z from "bridge.geojson"').load("a").diagnostics
    assert found.fixes == ()


@rows("path", ["", "/etc/passwd", "C:x.geojson", "a\\\\b.geojson", "~/x", "http://x/y.geojson"])
def test_zone_path_that_is_not_portable_is_refused(path: str) -> None:
    files = Files(a=f'zone z from "{path}"')
    (found,) = files.load("a").diagnostics
    assert found.code is IMPORT_PATH
    assert found.help == "write a path such as `bridge.geojson` or `lib:bridge.geojson`"
    assert files.reads == ["/w/a.rts"]


def test_zone_file_that_is_binary_or_huge_is_refused() -> None:
    files = Files(a='zone y from "y.geojson"\nzone z from "z.geojson" zone l from "lib:l"')
    files.files |= {"/w/y.geojson": b"{\xff}", "/w/z.geojson": b" " * (MAX_SIZE + 1)}
    program = files.load("a", library=None)
    assert [(found.code, found.span) for found in program.diagnostics] == [
        (NOT_TEXT, Span("/w/a.rts", 7, 23)),
        (TOO_LARGE, Span("/w/a.rts", 31, 47)),
        (IMPORT_PATH, Span("/w/a.rts", 55, 67)),
    ]
    assert program.diagnostics[0].message == "byte 1 (0xff) of `/w/y.geojson` is not UTF-8"
    assert (program.data, program.data_names) == ({}, {})


def test_stable_names_are_the_same_on_every_machine() -> None:
    files = Files(m__a='import "../b.rts"', b="")
    assert list(files.load("m/a").stable.values()) == ["a.rts", "../b.rts"]


def test_findings_and_broken_names_of_all_files() -> None:
    program = Files(a='import "b.rts"\nzone x = ?', b="zone y = ?").load("a")
    assert [found.span.file for found in program.diagnostics if found.span] == ["/w/a.rts", "/w/b.rts"]
    assert program.broken == {"x", "y"}


def test_missing_file_is_reported_with_its_expected_path() -> None:
    (found,) = Files(a='import "sub/gotoo.rts"', sub__goto="").load("a").diagnostics
    assert found.code is NO_SUCH_FILE
    assert found.message == "cannot read `sub/gotoo.rts`: no such file"
    assert found.help == "the file was expected at `/w/sub/gotoo.rts`; did you mean `sub/goto.rts`?"
    assert found.fixes[0].replacement == 'import "sub/goto.rts"'
    assert found.span is not None
    (found,) = Files(a='import "none/x.rts"').load("a").diagnostics
    assert found.help == "the file was expected at `/w/none/x.rts`"
    assert found.fixes == ()


def test_missing_input_file_has_no_span() -> None:
    (found,) = Files(mission="").load("misson").diagnostics
    assert (found.code, found.span) == (NO_SUCH_FILE, None)
    assert found.message == "cannot read `/w/misson.rts`: no such file"
    assert found.help == "did you mean `/w/mission.rts`?"


def test_folder_as_a_source_is_refused() -> None:
    (found,) = Files(a='import "folder.rts"').load("a").diagnostics
    assert found.message == "cannot read `folder.rts`: is a directory"


def test_without_listing_there_is_no_suggestion() -> None:
    (found,) = load(["/w/x.rts"], Files().read).diagnostics
    assert (found.code, found.help) == (NO_SUCH_FILE, None)


@rows("path", ["", "/etc/passwd", "C:x.rts", "a\\\\b.rts", "~/x.rts", "http://x/y.rts"])
def test_import_path_that_is_not_portable_is_refused(path: str) -> None:
    files = Files(a=f'import "{path}"')
    (found,) = files.load("a").diagnostics
    assert found.code is IMPORT_PATH
    assert files.reads == ["/w/a.rts"]


def test_missing_library_is_reported() -> None:
    (found,) = Files(a='import "lib:x.rts"').load("a", library=None).diagnostics
    assert found.code is IMPORT_PATH


def test_invalid_utf8_is_reported() -> None:
    program = Files(a='import "b.rts"' + zone("a"), b="é".encode() + b"zone \xff\xfe").load("a")
    (found,) = program.diagnostics
    assert found.code is NOT_TEXT
    assert found.message == "byte 7 (0xff) is not UTF-8"
    assert found.span is not None
    assert program.sources["/w/b.rts"].slice(found.span) == "\ufffd"
    assert [unit.file for unit in program.units] == ["/w/a.rts"]


def test_huge_file_is_not_parsed() -> None:
    (found,) = Files(a=b" " * (MAX_SIZE + 1)).load("a").diagnostics
    assert (found.code, found.span) == (TOO_LARGE, None)
    assert found.message == "`/w/a.rts` is 9 MiB; the limit is 8 MiB"


def test_byte_order_mark_and_line_ends_are_accepted() -> None:
    program = Files(a=b"\xef\xbb\xbf" + zone("a").replace("\n", "\r\n").encode() + b"zone b = ?\r\n").load("a")
    (found,) = program.diagnostics
    assert found.span is not None
    assert program.sources["/w/a.rts"].position(found.span.start) == (2, 10)
    assert program.sources["/w/a.rts"].line(2) == "zone b = ?"


def test_no_paths_give_an_empty_program() -> None:
    assert load([], Files().read) == Program((), {}, (), frozenset(), {}, {}, {})
