"""The one registry of diagnostic codes. A code is never reused and never changes its meaning."""

from dataclasses import dataclass
from enum import Enum


class Severity(Enum):
    """`ERROR` forbids compiling; `WARNING` is a best-effort finding; `NOTE` says that a check could not decide, and
    stays a note when warnings are denied.
    """

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True)
class Code:
    """A kind of finding: `id` is stable, `slug` is for people, `meaning` is one sentence."""

    id: str
    slug: str
    meaning: str
    severity: Severity = Severity.ERROR


REGISTRY: dict[str, Code] = {}


def code_named(name: str) -> Code | None:
    """The code with this id or slug."""
    return REGISTRY.get(name) or next((code for code in REGISTRY.values() if code.slug == name), None)


def can_be_ignored(code: Code) -> bool:
    """Whether `lint` may be told to ignore findings of a code: never errors, nor what is said of ignores themselves."""
    return code.severity is not Severity.ERROR and code not in (UNUSED_IGNORE, IGNORE_WITHOUT_REASON, UNKNOWN_IGNORE)


def _code(id: str, slug: str, meaning: str, severity: Severity = Severity.ERROR) -> Code:
    assert id not in REGISTRY, id
    code = REGISTRY[id] = Code(id, slug, meaning, severity)
    return code


# E01: syntax and files
SYNTAX = _code("E0101", "syntax", "the text is not a declaration of the language")
UNCLOSED = _code("E0102", "unclosed", "a block, a text or a comment is opened and not closed")
NOT_TEXT = _code("E0103", "not-text", "the file is not UTF-8 text")
TOO_LARGE = _code("E0104", "too-large", "the file is larger than the compiler reads")
TOO_DEEP = _code("E0105", "too-deep", "an expression is nested more deeply than the compiler reads")
WRITTEN_TWICE = _code("E0106", "written-twice", "a part of a declaration is written twice")
NOT_WRITTEN = _code("E0107", "not-written", "a declaration lacks a part that it must have")
NO_SUCH_FILE = _code("E0108", "no-such-file", "a file that is asked for or imported cannot be read")
IMPORT_PATH = _code("E0109", "import-path", "an import names its file in a way that means nothing elsewhere")
TOO_MANY_FINDINGS = _code("E0110", "too-many-findings", "a file has more errors than are reported at once")
IMPORT_CYCLE = _code("E0111", "import-cycle", "files import each other in a circle", Severity.WARNING)
NOT_GEOJSON = _code("E0112", "not-geojson", "a file that a zone is read from is not GeoJSON")
GEOJSON_SHAPE = _code("E0113", "geojson-shape", "a GeoJSON file does not hold the one area that is asked for")
GEOJSON_UNREAD = _code("E0115", "geojson-unread", "a GeoJSON area has heights, times or radii that no zone takes over")
NOT_A_SOURCE = _code("E0116", "not-a-source", "a file of another kind stands where a source is asked for")
HIDDEN_CHARACTER = _code("E0114", "hidden-character", "a text holds a character that hides or reorders what is read")

# E02: names
UNKNOWN_NAME = _code("E0201", "unknown-name", "a name is used that nothing declares")
DUPLICATE_NAME = _code("E0202", "duplicate-name", "a name is declared twice")
SHADOWED_NAME = _code("E0203", "shadowed-name", "a parameter or an enumerator has the name of something else")
WRONG_KIND = _code("E0204", "wrong-kind", "a name stands for another kind of thing than is asked")
NO_ENTRY = _code("E0205", "no-entry", "the entry of a zone is used that declares none")
NO_MISSION = _code("E0206", "no-mission", "there is not exactly one mission to compile, and none was named")
NOT_IN_POLICY = _code("E0207", "not-in-policy", "a name is not declared in what the policy's own file imports")
UNKNOWN_ROLE = _code("E0208", "unknown-role", "a rule names a role that nothing declares")

# E03: types, units and datum
UNKNOWN_UNIT = _code("E0301", "unknown-unit", "a number has a unit that the language does not know")
NOT_EXACT = _code("E0302", "not-exact", "a number is finer than the whole units in which its quantity is kept")
OUT_OF_BOUNDS = _code("E0303", "out-of-bounds", "a number is larger than its quantity can be")
DATUM_NOT_ALLOWED = _code("E0304", "datum-not-allowed", "a datum stands after something that is not a length")
DIMENSION_MISMATCH = _code("E0310", "dimension-mismatch", "a number has another dimension than is asked")
DATUM_MISMATCH = _code("E0311", "datum-mismatch", "an altitude is measured from another datum than is asked")
WRONG_TYPE = _code("E0312", "wrong-type", "a value is of another type than is asked")
UNKNOWN_MEMBER = _code("E0313", "unknown-member", "a name is not a value of the enumeration that is asked")
NOT_COMPARABLE = _code("E0314", "not-comparable", "two values cannot be compared in this way")
BAD_ARITHMETIC = _code(
    "E0315", "bad-arithmetic", "values are computed with that are no numbers, or whose product has no unit"
)
EMPTY_RANGE = _code("E0316", "empty-range", "a range's first end is above its second")
BAD_SUBJECT = _code("E0317", "bad-subject", "something is asked to be inside a zone that cannot be")
NOT_CONSTANT = _code("E0318", "not-constant", "a value is not known before the flight where it must be")
NOT_POSITIVE = _code("E0319", "not-positive", "a quantity is zero or negative where it must be above zero")
TIMED_ARGUMENT = _code("E0320", "timed-argument", "what is observed over time reads an argument, or the phase")
WINDOW_LENGTH = _code("E0321", "window-length", "a temporal window is longer than what is kept on board")
BAD_DIVISION = _code("E0322", "bad-division", "a value is divided by zero, or by what is not known at compile time")
PHASE_NAME = _code("E0323", "phase-name", "the mission's phase is compared with something that names no phase")

TURNED_KNOWN = _code("E0324", "turned-known", "`is known` stands under `not` or an edge, and is never false")
BEYOND_RANGE = _code("E0325", "beyond-range", "a value is asked or given of a signal that it never has")

# E04: signals and the dialect
UNKNOWN_MESSAGE = _code("E0401", "unknown-message", "the dialect has no such message")
UNKNOWN_FIELD = _code("E0402", "unknown-field", "the message has no such field")
FIELD_UNIT = _code("E0403", "field-unit", "the field's unit does not measure the signal's dimension")
FIELD_DATUM = _code("E0404", "field-datum", "the datum of the field's altitude is unknown, or differs between sources")
ENUM_VALUE = _code("E0405", "enum-value", "an enumerator's value is not one of the dialect's enumeration")
FIELD_COUNT = _code("E0406", "field-count", "a signal of this type is read from another number of fields")
FIELD_TYPE = _code("E0407", "field-type", "the field is an array or text, and a signal is one number")
UNKNOWN_AT = _code("E0408", "unknown-at", "what means `not known` is no value that the field can have")
SIGNAL_TYPE = _code("E0409", "signal-type", "a signal has a type that no signal can have")
WELL_KNOWN_SIGNAL = _code(
    "E0410", "well-known-signal", "a signal that every flight needs is missing or has the wrong type"
)
UNKNOWN_ENUM = _code("E0411", "unknown-enum", "the dialect has no such enumeration")
FIELD_ENUM = _code("E0412", "field-enum", "the field's values are those of another enumeration")
NOT_FITTED = _code("E0413", "not-fitted", "a condition reads a signal of a sensor that the vehicle is without")
NEEDED_SIGNAL = _code(
    "E0414", "needed-signal", "a vehicle is said to be without a signal that no flight can do without"
)
UNSELECTED = _code(
    "E0415", "unselected", "a signal does not say which of several sensors it is read from, or says it twice"
)

# E05: zones and geometry
BAD_POLYGON = _code("E0501", "bad-polygon", "the corners do not make a simple polygon with an area")
BAD_COORDINATES = _code("E0502", "bad-coordinates", "coordinates are not on the globe, or too near to a pole")
FLOOR_ABOVE_CEILING = _code("E0503", "floor-above-ceiling", "a zone's floor is not below its ceiling")
ENTRY_OUTSIDE = _code("E0504", "entry-outside", "a zone's entry does not lie inside of it")
ZONE_VANISHES = _code("E0505", "zone-vanishes", "a zone is so narrow that nothing is left of it when it shrinks")
ZONE_SHAPE = _code(
    "E0506", "zone-shape", "the outline of a zone cannot be had in whole millimetres, or not within reach"
)
TOO_FAR = _code("E0507", "too-far", "a place is further from the vehicle's home than the local plane reaches")
PATH_OUTSIDE = _code("E0508", "path-outside", "the planned path leaves the policy's airspace")
AREA_TOO_SMALL = _code("E0509", "area-too-small", "an area is too small to be covered by a survey path")
ZONE_CYCLE = _code("E0510", "zone-cycle", "a zone is made of itself")
NO_ELEVATION = _code("E0511", "no-elevation", "an altitude above sea is used, and the vehicle's elevation is not known")
EMPTY_ZONE = _code("E0512", "empty-zone", "nothing is left of a zone")
BAD_PERIOD = _code("E0513", "bad-period", "the times between which a zone is active are none")
RETURN_OUTSIDE = _code("E0514", "return-outside", "the way home from a step leaves the policy's airspace")
LOITER_OUTSIDE = _code(
    "E0515", "loiter-outside", "where a link of a step's chain flies or waits is outside of the airspace"
)
BAD_CORRIDOR = _code("E0516", "bad-corridor", "the places and the width do not make a corridor")
NO_CLOCK = _code("E0517", "no-clock", "a local time is read, and the vehicle does not say how far that is from UTC")
UNKNOWN_TIME_ZONE = _code("E0518", "unknown-time-zone", "a clock names a time zone that there is not")

# E06: skills, arguments, fallback chains
UNKNOWN_ARGUMENT = _code("E0601", "unknown-argument", "an argument has the name of no parameter")
DUPLICATE_ARGUMENT = _code("E0602", "duplicate-argument", "an argument is given twice")
MISSING_ARGUMENT = _code("E0603", "missing-argument", "a parameter without a default is given no argument")
TOO_MANY_ARGUMENTS = _code("E0604", "too-many-arguments", "an argument without a name has no parameter to go to")
ARGUMENT_RANGE = _code("E0605", "argument-range", "an argument or a default is outside of its parameter's range")
INCOMPLETE_CONTRACT = _code("E0606", "incomplete-contract", "a skill's contract lacks a field that it must have")
BAD_PARAMETER = _code("E0607", "bad-parameter", "a parameter's type does not exist, or its range does not belong to it")
BAD_MOTION = _code("E0608", "bad-motion", "a motion names something that is no parameter of the type it needs")
UNKNOWN_CLASS = _code("E0609", "unknown-class", "there is no such timing class")
UNKNOWN_RECORD = _code("E0610", "unknown-record", "there is no such kind of evidence")
ENDLESS_LINK = _code("E0611", "endless-link", "a link that is not the last neither has a limit nor ends by itself")
NEEDY_LAST_LINK = _code("E0612", "needy-last-link", "the last link of a chain needs something that may be missing")
CHAIN_CYCLE = _code("E0613", "chain-cycle", "a skill is a link of its own fallback chain")
BEYOND_VEHICLE = _code("E0614", "beyond-vehicle", "a step asks for more than the vehicle can do")
COVERING_LINK = _code("E0615", "covering-link", "a link of a chain would fly a survey")
NEVER_HOLDS = _code("E0616", "never-holds", "a clause of a step's contract cannot hold with these arguments")
NOT_TIGHTER = _code("E0617", "not-tighter", "a step's override is looser than its skill's contract")
INFEASIBLE_LAST_LINK = _code(
    "E0618", "infeasible-last-link", "the last link of a chain cannot do its work in the state in which it is needed"
)
NOT_CHAINED = _code("E0619", "not-chained", "a step needs what no step before it brings about")
SHORT_OF_ENERGY = _code("E0620", "short-of-energy", "the mission may reach a step without the energy that it needs")
NOT_LANDED = _code("E0621", "not-landed", "a mission ends in the air", Severity.WARNING)
NOT_OBSERVED = _code("E0622", "not-observed", "a step's override reads what its policy does not")

# E07: policies and authority
POLICY_VERSION = _code("E0701", "policy-version", "a mission names another version of its policy than is declared")
NOT_PERMITTED = _code("E0702", "not-permitted", "no rule of the policy permits a step to this role and source")
OUT_OF_SCOPE = _code("E0703", "out-of-scope", "a step's arguments are outside of what the policy permits")
FORBIDDEN = _code("E0704", "forbidden", "a rule of the policy forbids a step")
LINK_NOT_PERMITTED = _code(
    "E0705", "link-not-permitted", "a link of a chain is not permitted whenever it may be needed"
)
SOURCE_CLASS = _code("E0706", "source-class", "a source may not ask for skills of this timing class")
CONFIRM_WITHOUT_WITHIN = _code("E0707", "confirm-without-within", "a confirm rule does not say how long it waits")
NO_CONTINGENCY = _code("E0708", "no-contingency", "a policy has no contingency chain")
UNKNOWN_SOURCE = _code("E0709", "unknown-source", "there is no such source of decisions")
RULE_ARGUMENT = _code("E0710", "rule-argument", "a rule reads an argument that not all of its skills have")
NO_PROPOSER = _code("E0711", "no-proposer", "a mission does not say who proposes it for which role")
EMPTY_MISSION = _code("E0712", "empty-mission", "a mission has no step")
DELEGATION_CYCLE = _code("E0713", "delegation-cycle", "a role delegates to itself, or roles do in a circle")
NOTHING_DELEGATED = _code("E0714", "nothing-delegated", "a role delegates what it is not permitted itself")
EMPTY_DELEGATION = _code(
    "E0715", "empty-delegation", "a delegation's condition can never hold together with what it delegates"
)
VERSION_NOT_RAISED = _code("E0716", "version-not-raised", "a policy differs from an earlier one of the same version")
NO_RESOLVER = _code("E0717", "no-resolver", "a step may be deferred, and nothing can resolve that in time")
NOT_ALWAYS_PERMITTED = _code("E0718", "not-always-permitted", "a step may come at a time at which it is not permitted")
DEGRADED = _code("E0719", "degraded", "a rule of the policy flies something else in place of a step")
DEAD_RULE = _code("E0720", "dead-rule", "a rule can never match", Severity.WARNING)
SHADOWED_RULE = _code(
    "E0721", "shadowed-rule", "a rule never decides, for another always outweighs it", Severity.WARNING
)
REDUNDANT_RULE = _code("E0722", "redundant-rule", "a rule says nothing that others do not say", Severity.WARNING)
CONFLICTING_RULES = _code(
    "E0723", "conflicting-rules", "two rules of the same weight ask for different things at once", Severity.WARNING
)

# E08: timing
VALIDITY_TOO_SHORT = _code("E0801", "validity-too-short", "a step may come later than its validity lasts")
UNKNOWN_PHASE = _code("E0802", "unknown-phase", "a skill is valid only in phases that the mission does not have")
STEP_OUTSIDE_PHASES = _code("E0803", "step-outside-phases", "a step stands in a phase in which its skill is not valid")
PLAN_TOO_LONG = _code("E0804", "plan-too-long", "a planned path takes longer than its skill lasts at most")
ENDLESS_STEP = _code("E0805", "endless-step", "a step of a mission neither ends by itself nor has a longest duration")
INCOHERENT_TIMING = _code("E0806", "incoherent-timing", "the times of a contract contradict each other")
CLASS_TIMING = _code("E0807", "class-timing", "a contract's times do not fit its timing class")
SLOW_REACTION = _code(
    "E0808", "slow-reaction", "noticing a breach and falling back may take longer than the contract allows"
)
MISSION_TIME = _code("E0809", "mission-time", "a mission may last longer than it says")
MISSION_STEPS = _code("E0810", "mission-steps", "a mission has more steps than it says, or than fit on board")
MISSION_ENERGY = _code("E0811", "mission-energy", "a mission may need more energy than it says")
OVER_CHARGE = _code("E0812", "over-charge", "a mission may need more energy than a full charge")
RETURN_ENERGY = _code(
    "E0815", "return-energy", "a return may take more of the charge than its skill says", Severity.WARNING
)
STEP_ENERGY = _code("E0814", "step-energy", "a step may take more of the charge than its skill says")

# E09: mission specifications (structured input of an agent)
NOT_JSON = _code("E0901", "not-json", "the specification is not JSON")
SPECIFICATION_SHAPE = _code("E0902", "specification-shape", "the specification does not follow its schema")
DUPLICATE_KEY = _code("E0903", "duplicate-key", "an object has the same key twice")
SPECIFICATION_SIZE = _code(
    "E0904", "specification-size", "the specification is larger or deeper than the compiler reads"
)
CLAIMED_AUTHORITY = _code(
    "E0905", "claimed-authority", "a mission claims another source, role or policy than it is compiled for"
)
POLICY_NOT_NAMED = _code("E0906", "policy-not-named", "nobody but a specification says which policy it flies under")

# E10: limits of what fits on board
TOO_MANY = _code("E1001", "too-many", "there are more of these than fit on board")
CONDITION_SIZE = _code(
    "E1002", "condition-size", "a condition needs more instructions or a deeper stack than fit on board"
)
NUMBER_SIZE = _code("E1003", "number-size", "a number is larger than what is kept or computed on board")
REFUSED_ON_BOARD = _code("E1004", "refused-on-board", "what the sources mean would be refused on board")

# E11: what conditions mean together
CONTRADICTION = _code("E1101", "contradiction", "conditions that must hold together never can")
ALWAYS_HOLDS = _code("E1102", "always-holds", "a condition cannot fail, so it says nothing", Severity.WARNING)
UNDECIDED = _code("E1103", "undecided", "a check could not decide, and says nothing either way", Severity.NOTE)

# E12: what can be observed and recorded
UNOBSERVABLE = _code("E1201", "unobservable", "a signal does not arrive often enough for what watches it")
INSUFFICIENT_EVIDENCE = _code(
    "E1202", "insufficient-evidence", "what is recorded does not suffice to derive a decision again"
)
UNWATCHED = _code("E1203", "unwatched", "what must stay true reads nothing that can change in flight", Severity.WARNING)
FLEETING_EVIDENCE = _code(
    "E1204", "fleeting-evidence", "a record that a crash may take along is kept of what is no reflex"
)
TWO_DURABILITIES = _code("E1205", "two-durabilities", "a contract asks for records of more than one durability")

# E13: habits, which `lint` looks for
UNUSED = _code("E1301", "unused", "something is declared and never used", Severity.WARNING)
NAMING = _code("E1302", "naming", "a name is not written as names are", Severity.WARNING)
BROAD_AUTHORITY = _code(
    "E1303", "broad-authority", "a rule permits more than anyone is likely to mean", Severity.WARNING
)
REPEATED_NUMBER = _code(
    "E1304", "repeated-number", "the same number stands for the same thing in several places", Severity.WARNING
)
UNUSED_IMPORT = _code("E1305", "unused-import", "a file is imported and nothing of it is used", Severity.WARNING)
GATES_NOTHING = _code(
    "E1306", "gates-nothing", "a policy refuses nothing that its skills can be asked for", Severity.WARNING
)
IDLE_AIRSPACE = _code(
    "E1307",
    "idle-airspace",
    "a zone of the airspace makes no difference wherever the vehicle can come",
    Severity.WARNING,
)
UNBOUNDED_PLACE = _code(
    "E1308", "unbounded-place", "a permit lets a skill fly to any place that it is asked to", Severity.WARNING
)
UNUSED_IGNORE = _code("E1309", "unused-ignore", "an ignore ignores nothing", Severity.WARNING)
IGNORE_WITHOUT_REASON = _code("E1310", "ignore-without-reason", "an ignore does not say why", Severity.WARNING)
UNKNOWN_IGNORE = _code(
    "E1311", "unknown-ignore", "an ignore names what is no code, or what cannot be ignored", Severity.WARNING
)
KEPT_FROM_LANDING = _code(
    "E1312", "kept-from-landing", "a `degrade` turns a request to land into a flight", Severity.WARNING
)
NEVER_TAKES_OFF = _code(
    "E1313",
    "never-takes-off",
    "a rule or contract waits on the ground for what is known only in flight",
    Severity.WARNING,
)

# E14: tests and where they start from
NO_NOMINAL = _code("E1401", "no-nominal", "a test starts from no nominal, or does not say from which")
INCOMPLETE_TEST = _code("E1402", "incomplete-test", "a test or its nominal does not say enough to decide")
UNKNOWN_REASON = _code("E1403", "unknown-reason", "no decision has a reason of that name")
NEVER_DECIDED = _code("E1404", "never-decided", "a test expects what is never decided")
ROW_CELLS = _code("E1405", "row-cells", "a row of a table has more or fewer cells than the table has columns")
GIVEN_TWICE = _code("E1406", "given-twice", "a test gives the same signal, condition or argument twice")
SAME_TEST = _code("E1407", "same-test", "two tests of a file are called the same")
NOT_GIVEN = _code("E1408", "not-given", "a test asks for what reads a signal that it does not give", Severity.WARNING)
WITHOUT_EFFECT = _code("E1409", "without-effect", "a test gives what its policy does not read", Severity.WARNING)
UNKNOWN_CLAUSE = _code("E1410", "unknown-clause", "a test quotes a clause that nothing decides by")
NOT_MET = _code("E1411", "not-met", "the decision is not the one that a test expects")

# E15: how sources are laid out
NOT_FORMATTED = _code("E1501", "not-formatted", "a source is not laid out in the one style", Severity.WARNING)
UNSAFE_FORMAT = _code("E1502", "unsafe-format", "laying a source out anew would change what it says")

# E16: scenarios
UNKNOWN_FAULT = _code("E1601", "unknown-fault", "nothing that can go wrong has that name")
UNKNOWN_ENDING = _code("E1602", "unknown-ending", "no run ends in that way")
UNKNOWN_AUTOPILOT = _code("E1603", "unknown-autopilot", "there is no simulated autopilot of that kind")
SAME_SCENARIO = _code("E1604", "same-scenario", "two scenarios of a file are called the same")
NO_SUCH_STEP = _code("E1605", "no-such-step", "a fault waits for a step that the mission does not have")
BAD_TRIGGER = _code("E1606", "bad-trigger", "a fault waits for a condition over time, or for a phase")
UNREAD_TRIGGER = _code("E1607", "unread-trigger", "a fault waits for what the mission's policy does not read")
BAD_START = _code("E1608", "bad-start", "a scenario starts with what no flight starts with")
FLIGHT_FAILED = _code("E1610", "flight-failed", "a flight of a scenario fails, or is not what was expected")
NO_SUCH_ROLE = _code("E1609", "no-such-role", "somebody answers for a role that the mission's policy does not know")
