"""Conditions as postfix code: three integers for each instruction (`op`, `a`, `b`), evaluated on one small stack.

Numbers and truth values never mix on the stack: the compiler ensures it, and `load` checks it again. A C evaluator
needs a fixed stack of `MAX_STACK` cells and no allocation.
"""

from enum import IntEnum

from rtshcua.model.flat.struct import Flat

MAX_STACK = 16
MAX_INSTRUCTIONS = 128


class Op(IntEnum):
    """Instructions. `num` pushes or pops a number, `truth` a truth value; unused operands are 0."""

    CONST = 1  # push num a
    SIGNAL = 2  # push num of state slot a
    ARGUMENT = 3  # push num of argument cell a
    ADD = 5  # num num -> num
    SUB = 6  # num num -> num
    SCALE = 7  # num -> num * a
    LT = 16  # num num -> truth
    LE = 17
    GT = 18
    GE = 19
    EQ = 20
    NE = 21
    SIGNAL_IN = 24  # enumerated slot a is a member of set b of the policy
    ARGUMENT_IN = 25  # enumerated or zone-valued argument cell a is a member of set b
    KNOWN = 26  # state slot a has a value: true, else unknown
    POSITION_IN = 28  # the vehicle (position and height) is inside zone a
    POSITION_IN_ARGUMENT = 29  # ... inside the zone that table b gives for the zone in argument cell a
    ARGUMENT_POINT_IN = 30  # the point in argument cells a, a + 1 (x, y in mm) is inside zone b, at any height
    TIME_IN = 32  # the local time of day is in a .. b us since midnight; a > b wraps over midnight
    WEEK_IN = 33  # the local time of the week is in one of the windows of set a, as `Zone.weekly` has them
    PHASE_IN = 34  # the invocation's mission phase is one of set b (indexes into the policy's `phases`)
    MONITOR = 36  # push truth of temporal monitor a, as the state has it
    AND = 40  # truth truth -> truth, Kleene
    OR = 41
    NOT = 42  # truth -> truth


class Clause(Flat, frozen=True):
    """A condition with its text and source position, so that a refusal can be explained without the sources.

    `source` indexes the policy's table of file names, continued by the mission's for a step's own clauses;
    `start`, `end` are character offsets.
    """

    text: str
    source: int
    start: int
    end: int
    code: tuple[int, ...]
