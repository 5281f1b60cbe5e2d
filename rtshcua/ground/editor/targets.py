"""What a name in a source means, so that two places that mean the same can be told."""

from enum import Enum
from typing import NamedTuple

from rtshcua.diagnostics.span import Span


class Sort(Enum):
    """The kinds of names; the value is the word for a person."""

    DECLARED = "declaration"
    PARAMETER = "parameter"
    MEMBER = "value of an enumeration"
    CHOICE = "choice"
    PHASE = "phase"
    ROLE = "role"
    SOURCE = "source of decisions"
    PROPOSER = "proposer"
    CLASS = "timing class"
    RECORD = "kind of evidence"
    TYPE = "type"
    MESSAGE = "message of the dialect"
    FIELD = "field of the dialect"
    DIALECT_ENUM = "enumeration of the dialect"
    REASON = "reason"
    FAULT = "fault"
    WORD = "word of the language"
    IMPORT = "import"


class Target(NamedTuple):
    """What is meant: `owner` is the skill, template, mission or enumeration that a parameter or a member belongs to; of
    a choice it is the skill and the parameter, of an import the importing file.
    """

    sort: Sort
    name: str
    owner: str = ""


class Occurrence(NamedTuple):
    """A place that means `target`; `declares` where it is the one that gives the name."""

    span: Span
    target: Target
    declares: bool = False
