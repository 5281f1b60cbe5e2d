"""Generates `dialect.json` from pymavlink: `python -m rtshcua.codec.build_dialect`.

A test compares the shipped table with a newly generated one, so that a new pymavlink cannot change the dialect
unnoticed.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from pymavlink.dialects.v20 import ardupilotmega

from rtshcua.mavlink.dialect import TABLE

COMMAND = "python -m rtshcua.codec.build_dialect"


def build_table() -> dict[str, dict[str, Any]]:
    """The table, by introspection of the generated module; of commands, whose units it lacks, from the XML beside it.

    `messages`: name -> [number, {field: [type, array length, unit, enumeration]}]; `enums`: name -> {entry:
    value}; `commands`: name -> {parameter with a meaning: [label, unit, enumeration]}.
    """
    messages = {kind.msgname: [number, _fields(kind)] for number, kind in sorted(ardupilotmega.mavlink_map.items())}
    enums = {
        name: {entry.name: value for value, entry in sorted(entries.items()) if not _is_end(name, entry.name)}
        for name, entries in sorted(ardupilotmega.enums.items())
    }
    names = enums["MAV_CMD"]
    parameters = dict(_commands(Path(ardupilotmega.__file__).with_suffix(".xml")))
    commands = {name: found for name in names if (found := parameters.get(name)) is not None}
    return {"messages": messages, "enums": enums, "commands": commands}


def _commands(dialect: Path) -> Iterator[tuple[str, dict[str, list[Any]]]]:
    """The parameters of each command of a dialect in XML, and of those that it includes."""
    tree = ElementTree.parse(dialect)
    for included in tree.iter("include"):
        yield from _commands(dialect.with_name((included.text or "").strip()))
    for entry in tree.iterfind("./enums/enum[@name='MAV_CMD']/entry"):
        yield (
            entry.attrib["name"],
            {
                f"param{each.attrib['index']}": [each.attrib["label"], _unit_of(each.attrib), each.get("enum")]
                for each in entry.iterfind("param")
                if each.get("label")
            },
        )


def _unit_of(parameter: dict[str, str]) -> str:
    """The unit of a command's parameter. Of a place only the label shows it: `Latitude`, `Latitude/X`."""
    of_place = {"Latitude": "deg", "Longitude": "deg", "Altitude": "m"}
    return parameter.get("units") or of_place.get(parameter["label"].partition("/")[0], "")


def _fields(kind: Any) -> dict[str, list[Any]]:
    # Types are in the order of the XML, array lengths in the order of the wire.
    lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
    return {
        name: [type_, lengths[name], kind.fieldunits_by_name.get(name, ""), kind.fieldenums_by_name.get(name)]
        for name, type_ in zip(kind.fieldnames, kind.fieldtypes, strict=True)
    }


def _is_end(enum: str, entry: str) -> bool:
    """Whether the entry is the end mark that the generator appends to each enumeration."""
    return entry == f"{enum}_ENUM_END"


def render(table: dict[str, dict[str, Any]]) -> str:
    """The table as JSON with one message or enumeration on each line, for readable diffs."""
    sections = []
    for section, rows in table.items():
        lines = ",\n".join(f"{json.dumps(name)}:{json.dumps(row, separators=(',', ':'))}" for name, row in rows.items())
        sections.append(f"{json.dumps(section)}:{{\n{lines}\n}}")
    return "{" + ",\n".join(sections) + "}\n"


if __name__ == "__main__":
    TABLE.write_text(render(build_table()), encoding="utf-8")
