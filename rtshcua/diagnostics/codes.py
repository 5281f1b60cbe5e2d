"""The registry of diagnostic codes. A code is never reused and never changes its meaning."""

from dataclasses import dataclass
from enum import Enum


class Severity(Enum):
    """How serious a finding is. `ERROR` stops compilation. `WARNING` is best effort. `NOTE` reports an inconclusive
    check, and stays a note when warnings are treated as errors.
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
    """Return the code with this id or slug, or None."""
    return REGISTRY.get(name) or next((code for code in REGISTRY.values() if code.slug == name), None)


def can_be_ignored(code: Code) -> bool:
    """Whether an `ignore` may suppress a code: errors and findings about `ignore` itself cannot be ignored."""
    return code.severity is not Severity.ERROR and code not in (UNUSED_IGNORE, IGNORE_WITHOUT_REASON, UNKNOWN_IGNORE)


def _code(id: str, slug: str, meaning: str, severity: Severity = Severity.ERROR) -> Code:
    assert id not in REGISTRY, id
    code = REGISTRY[id] = Code(id, slug, meaning, severity)
    return code


# E01: syntax and files
SYNTAX = _code("E0101", "syntax", "syntax error")
UNCLOSED = _code("E0102", "unclosed", "a block, string or comment is not closed")
NOT_TEXT = _code("E0103", "not-text", "the file is not UTF-8 text")
TOO_LARGE = _code("E0104", "too-large", "the file exceeds the size limit")
TOO_DEEP = _code("E0105", "too-deep", "an expression exceeds the nesting limit")
WRITTEN_TWICE = _code("E0106", "written-twice", "a clause of a declaration is repeated")
NOT_WRITTEN = _code("E0107", "not-written", "a declaration lacks a required clause")
NO_SUCH_FILE = _code("E0108", "no-such-file", "an input or imported file cannot be read")
IMPORT_PATH = _code("E0109", "import-path", "an import path is not portable")
TOO_MANY_FINDINGS = _code("E0110", "too-many-findings", "too many errors in a file: the rest is not reported")
IMPORT_CYCLE = _code("E0111", "import-cycle", "import cycle", Severity.WARNING)
NOT_GEOJSON = _code("E0112", "not-geojson", "a zone's file is not GeoJSON")
GEOJSON_SHAPE = _code("E0113", "geojson-shape", "a GeoJSON file does not hold exactly one matching area")
GEOJSON_UNREAD = _code("E0115", "geojson-unread", "a GeoJSON area has heights, times or radii, which a zone ignores")
NOT_A_SOURCE = _code("E0116", "not-a-source", "the input is not a source file")
HIDDEN_CHARACTER = _code("E0114", "hidden-character", "a string holds an invisible or reordering character")

# E02: names
UNKNOWN_NAME = _code("E0201", "unknown-name", "undeclared name")
DUPLICATE_NAME = _code("E0202", "duplicate-name", "duplicate declaration")
SHADOWED_NAME = _code("E0203", "shadowed-name", "a parameter or enumerator shadows another name")
WRONG_KIND = _code("E0204", "wrong-kind", "a name refers to the wrong kind of declaration")
NO_ENTRY = _code("E0205", "no-entry", "the zone has no `entry`")
NO_MISSION = _code("E0206", "no-mission", "no single mission to compile, and none was named")
NOT_IN_POLICY = _code("E0207", "not-in-policy", "a name is not visible from the policy's own file")
UNKNOWN_ROLE = _code("E0208", "unknown-role", "a rule names an undeclared role")

# E03: types, units and datum
UNKNOWN_UNIT = _code("E0301", "unknown-unit", "unknown unit")
NOT_EXACT = _code("E0302", "not-exact", "a number is finer than the resolution of its quantity")
OUT_OF_BOUNDS = _code("E0303", "out-of-bounds", "a number exceeds the range of its quantity")
DATUM_NOT_ALLOWED = _code("E0304", "datum-not-allowed", "a datum follows a value that is not a length")
DIMENSION_MISMATCH = _code("E0310", "dimension-mismatch", "dimension mismatch")
DATUM_MISMATCH = _code("E0311", "datum-mismatch", "altitude datum mismatch")
WRONG_TYPE = _code("E0312", "wrong-type", "type mismatch")
UNKNOWN_MEMBER = _code("E0313", "unknown-member", "a name is not a member of the expected enumeration")
NOT_COMPARABLE = _code("E0314", "not-comparable", "two values cannot be compared with this operator")
BAD_ARITHMETIC = _code("E0315", "bad-arithmetic", "an operand is not numeric, or the product has no supported unit")
EMPTY_RANGE = _code("E0316", "empty-range", "the lower end of a range is above its upper end")
BAD_SUBJECT = _code("E0317", "bad-subject", "the subject of `inside` has no position")
NOT_CONSTANT = _code("E0318", "not-constant", "a value must be constant")
NOT_POSITIVE = _code("E0319", "not-positive", "a quantity must be above zero")
TIMED_ARGUMENT = _code("E0320", "timed-argument", "a temporal condition reads an argument or the phase")
WINDOW_LENGTH = _code("E0321", "window-length", "a temporal window exceeds the history kept on board")
BAD_DIVISION = _code("E0322", "bad-division", "division by zero, or by a value unknown at compile time")
PHASE_NAME = _code("E0323", "phase-name", "`phase` is compared with a value that is not a phase")

TURNED_KNOWN = _code("E0324", "turned-known", "`is known` cannot be negated: it is never false")
BEYOND_RANGE = _code("E0325", "beyond-range", "a value is outside the range of its signal")

# E04: signals and the dialect
UNKNOWN_MESSAGE = _code("E0401", "unknown-message", "unknown MAVLink message")
UNKNOWN_FIELD = _code("E0402", "unknown-field", "unknown field of the MAVLink message")
FIELD_UNIT = _code("E0403", "field-unit", "the field's unit does not match the dimension of the signal or the argument")
FIELD_DATUM = _code("E0404", "field-datum", "the datum of the field's altitude is unknown, or differs between sources")
ENUM_VALUE = _code("E0405", "enum-value", "an enumerator's value is not in the dialect's enumeration")
FIELD_COUNT = _code("E0406", "field-count", "wrong number of fields for a signal or an argument of this type")
FIELD_TYPE = _code("E0407", "field-type", "the field is an array, text, or not the number that is needed")
UNKNOWN_AT = _code("E0408", "unknown-at", "the value for `unknown` or `where` is outside the field's range")
SIGNAL_TYPE = _code("E0409", "signal-type", "invalid signal type")
WELL_KNOWN_SIGNAL = _code("E0410", "well-known-signal", "a required signal is missing or has the wrong type")
UNKNOWN_ENUM = _code("E0411", "unknown-enum", "unknown MAVLink enumeration")
FIELD_ENUM = _code("E0412", "field-enum", "the field belongs to another enumeration")
NOT_FITTED = _code("E0413", "not-fitted", "a condition reads a signal that the vehicle lacks")
NEEDED_SIGNAL = _code("E0414", "needed-signal", "a required signal is declared absent")
UNSELECTED = _code("E0415", "unselected", "the sensor instance of a signal is missing or repeated")
UNKNOWN_COMMAND = _code("E0416", "unknown-command", "unknown MAVLink command")
UNKNOWN_MODE = _code("E0417", "unknown-mode", "unknown autopilot, or a flight mode that it does not have")
ACCEPTED_TWICE = _code("E0418", "accepted-twice", "a MAVLink command, message or mode stands for two skills")
OTHER_MOTION = _code("E0419", "other-motion", "a skill accepts what means another motion", Severity.WARNING)
NEVER_EMITTED = _code("E0430", "never-emitted", "a skill emits a command that no skill may emit")
EMISSION_FORM = _code("E0431", "emission-form", "the addressee, the time or the success of a command does not fit it")
EMITTED_NUMBER = _code("E0432", "emitted-number", "a number cannot be sent precisely as a parameter of a command")
SERVO_NOT_FREE = _code("E0433", "servo-not-free", "a skill sets a servo output that the vehicle does not declare free")

# E05: zones and geometry
BAD_POLYGON = _code("E0501", "bad-polygon", "the corners do not form a simple polygon")
BAD_COORDINATES = _code("E0502", "bad-coordinates", "coordinates are out of range, or too close to a pole")
FLOOR_ABOVE_CEILING = _code("E0503", "floor-above-ceiling", "a zone's floor is not below its ceiling")
ENTRY_OUTSIDE = _code("E0504", "entry-outside", "a zone's entry is outside the zone")
ZONE_VANISHES = _code("E0505", "zone-vanishes", "nothing remains of a zone after shrinking")
ZONE_SHAPE = _code("E0506", "zone-shape", "the outline of a zone cannot be computed within the local plane")
TOO_FAR = _code("E0507", "too-far", "a place is too far from home for the local plane")
PATH_OUTSIDE = _code("E0508", "path-outside", "the planned path leaves the policy's airspace")
AREA_TOO_SMALL = _code("E0509", "area-too-small", "an area is too small for a survey path")
ZONE_CYCLE = _code("E0510", "zone-cycle", "a zone is defined by itself")
NO_ELEVATION = _code("E0511", "no-elevation", "an AMSL altitude needs the vehicle's elevation")
EMPTY_ZONE = _code("E0512", "empty-zone", "a zone is empty")
BAD_PERIOD = _code("E0513", "bad-period", "the active period of a zone is empty")
RETURN_OUTSIDE = _code("E0514", "return-outside", "the return path of a step leaves the policy's airspace")
LOITER_OUTSIDE = _code("E0515", "loiter-outside", "a fallback of a step flies or waits outside the airspace")
BAD_CORRIDOR = _code("E0516", "bad-corridor", "invalid corridor")
NO_CLOCK = _code("E0517", "no-clock", "a local time needs the vehicle's time zone")
UNKNOWN_TIME_ZONE = _code("E0518", "unknown-time-zone", "unknown time zone")
BAD_LEVELS = _code("E0519", "bad-levels", "the heights of a survey path are in the wrong order or too close")

# E06: skills, arguments, fallback chains
UNKNOWN_ARGUMENT = _code("E0601", "unknown-argument", "unknown argument")
DUPLICATE_ARGUMENT = _code("E0602", "duplicate-argument", "duplicate argument")
MISSING_ARGUMENT = _code("E0603", "missing-argument", "a required argument is missing")
TOO_MANY_ARGUMENTS = _code("E0604", "too-many-arguments", "too many positional arguments")
ARGUMENT_RANGE = _code("E0605", "argument-range", "an argument or default is outside its parameter's range")
INCOMPLETE_CONTRACT = _code("E0606", "incomplete-contract", "a skill's contract lacks a required field")
BAD_PARAMETER = _code("E0607", "bad-parameter", "a parameter's type is unknown, or its range does not fit the type")
BAD_MOTION = _code("E0608", "bad-motion", "a motion does not name a parameter of the required type")
UNKNOWN_CLASS = _code("E0609", "unknown-class", "unknown timing class")
UNKNOWN_RECORD = _code("E0610", "unknown-record", "unknown kind of evidence")
ENDLESS_LINK = _code("E0611", "endless-link", "a fallback before the last has no time limit and does not end by itself")
NEEDY_LAST_LINK = _code(
    "E0612", "needy-last-link", "the last fallback of a chain requires a signal that may be unknown"
)
CHAIN_CYCLE = _code("E0613", "chain-cycle", "a skill is in its own fallback chain")
BEYOND_VEHICLE = _code("E0614", "beyond-vehicle", "a step exceeds the vehicle's limits")
COVERING_LINK = _code("E0615", "covering-link", "a fallback flies a survey")
NEVER_HOLDS = _code("E0616", "never-holds", "a clause of a step's contract cannot hold with these arguments")
NOT_TIGHTER = _code("E0617", "not-tighter", "a step's override is looser than its skill's contract")
INFEASIBLE_LAST_LINK = _code(
    "E0618", "infeasible-last-link", "the last fallback cannot fly in the state that triggers it"
)
NOT_CHAINED = _code("E0619", "not-chained", "a step's precondition is not established by the steps before it")
SHORT_OF_ENERGY = _code("E0620", "short-of-energy", "the charge may not suffice for a step")
NOT_LANDED = _code("E0621", "not-landed", "the mission ends in the air", Severity.WARNING)
NOT_OBSERVED = _code("E0622", "not-observed", "a step's override reads a signal that the policy does not read")

# E07: policies and authority
POLICY_VERSION = _code("E0701", "policy-version", "the mission names another version of its policy")
NOT_PERMITTED = _code("E0702", "not-permitted", "no rule of the policy permits a step to this role and source")
OUT_OF_SCOPE = _code("E0703", "out-of-scope", "a step's arguments are outside the permitted range")
FORBIDDEN = _code("E0704", "forbidden", "a rule of the policy forbids a step")
LINK_NOT_PERMITTED = _code("E0705", "link-not-permitted", "a fallback is not always permitted when it may be needed")
SOURCE_CLASS = _code("E0706", "source-class", "a source may not request skills of this timing class")
CONFIRM_WITHOUT_WITHIN = _code("E0707", "confirm-without-within", "a `confirm` rule lacks `within`")
NO_CONTINGENCY = _code("E0708", "no-contingency", "a policy has no contingency chain")
UNKNOWN_SOURCE = _code("E0709", "unknown-source", "unknown source of decisions")
RULE_ARGUMENT = _code("E0710", "rule-argument", "a rule reads an argument that some of its skills lack")
NO_PROPOSER = _code("E0711", "no-proposer", "a mission lacks `proposed by`")
EMPTY_MISSION = _code("E0712", "empty-mission", "a mission has no step")
DELEGATION_CYCLE = _code("E0713", "delegation-cycle", "delegation cycle")
NOTHING_DELEGATED = _code("E0714", "nothing-delegated", "a role delegates an authority that it does not have")
EMPTY_DELEGATION = _code("E0715", "empty-delegation", "a delegation can never apply")
VERSION_NOT_RAISED = _code("E0716", "version-not-raised", "a policy changed without a new version number")
NO_RESOLVER = _code("E0717", "no-resolver", "a step may be deferred with nothing to resolve it in time")
NOT_ALWAYS_PERMITTED = _code(
    "E0718", "not-always-permitted", "a step is not permitted at every time at which it may start"
)
DEGRADED = _code("E0719", "degraded", "a rule of the policy replaces a step")
DEAD_RULE = _code("E0720", "dead-rule", "a rule can never match", Severity.WARNING)
SHADOWED_RULE = _code("E0721", "shadowed-rule", "a rule is always overridden", Severity.WARNING)
REDUNDANT_RULE = _code("E0722", "redundant-rule", "a rule is redundant", Severity.WARNING)
CONFLICTING_RULES = _code("E0723", "conflicting-rules", "two rules of the same precedence conflict", Severity.WARNING)

# E08: timing
VALIDITY_TOO_SHORT = _code("E0801", "validity-too-short", "a step may start after its validity ends")
UNKNOWN_PHASE = _code("E0802", "unknown-phase", "a skill is valid only in phases that the mission lacks")
STEP_OUTSIDE_PHASES = _code("E0803", "step-outside-phases", "a step is in a phase in which its skill is not valid")
PLAN_TOO_LONG = _code("E0804", "plan-too-long", "a planned path takes longer than its skill's maximum duration")
ENDLESS_STEP = _code("E0805", "endless-step", "a step neither ends by itself nor has a maximum duration")
INCOHERENT_TIMING = _code("E0806", "incoherent-timing", "the times of a contract are inconsistent")
CLASS_TIMING = _code("E0807", "class-timing", "a contract's times do not fit its timing class")
SLOW_REACTION = _code(
    "E0808", "slow-reaction", "detecting a violation and falling back may exceed the contract's bound"
)
MISSION_TIME = _code("E0809", "mission-time", "a mission may exceed its declared duration")
MISSION_STEPS = _code("E0810", "mission-steps", "a mission has more steps than declared, or than fit on board")
MISSION_ENERGY = _code("E0811", "mission-energy", "a mission may exceed its declared energy")
OVER_CHARGE = _code("E0812", "over-charge", "a mission may need more energy than a full charge")
RETURN_ENERGY = _code("E0815", "return-energy", "a return may exceed its skill's declared energy", Severity.WARNING)
STEP_ENERGY = _code("E0814", "step-energy", "a step may exceed its skill's declared energy")

# E09: mission specifications (structured input from an agent)
NOT_JSON = _code("E0901", "not-json", "the specification is not JSON")
SPECIFICATION_SHAPE = _code("E0902", "specification-shape", "the specification does not follow its schema")
DUPLICATE_KEY = _code("E0903", "duplicate-key", "an object repeats a key")
SPECIFICATION_SIZE = _code("E0904", "specification-size", "the specification exceeds the size or nesting limit")
CLAIMED_AUTHORITY = _code(
    "E0905", "claimed-authority", "a mission claims another source, role or policy than it is compiled for"
)
POLICY_NOT_NAMED = _code("E0906", "policy-not-named", "only the specification itself names its policy")

# E10: onboard limits
TOO_MANY = _code("E1001", "too-many", "a count exceeds what fits on board")
CONDITION_SIZE = _code("E1002", "condition-size", "a condition exceeds the instruction or stack limit on board")
NUMBER_SIZE = _code("E1003", "number-size", "a number exceeds the range of the onboard arithmetic")
REFUSED_ON_BOARD = _code("E1004", "refused-on-board", "the compiled result would be refused on board")

# E11: combined conditions
CONTRADICTION = _code("E1101", "contradiction", "conditions contradict each other")
ALWAYS_HOLDS = _code("E1102", "always-holds", "a condition is always true", Severity.WARNING)
UNDECIDED = _code("E1103", "undecided", "a check was inconclusive", Severity.NOTE)

# E12: observability and evidence
UNOBSERVABLE = _code("E1201", "unobservable", "a signal does not arrive often enough to be monitored")
INSUFFICIENT_EVIDENCE = _code(
    "E1202", "insufficient-evidence", "the evidence does not suffice to derive a decision again"
)
UNWATCHED = _code("E1203", "unwatched", "a maintained condition reads nothing that changes in flight", Severity.WARNING)
FLEETING_EVIDENCE = _code("E1204", "fleeting-evidence", "`buffered` evidence is only allowed for reflex skills")
TWO_DURABILITIES = _code("E1205", "two-durabilities", "a contract requires evidence of more than one durability")

# E13: lint
UNUSED = _code("E1301", "unused", "unused declaration", Severity.WARNING)
NAMING = _code("E1302", "naming", "a name violates the naming convention", Severity.WARNING)
BROAD_AUTHORITY = _code("E1303", "broad-authority", "a rule permits unusually much", Severity.WARNING)
REPEATED_NUMBER = _code("E1304", "repeated-number", "a number is repeated for the same quantity", Severity.WARNING)
UNUSED_IMPORT = _code("E1305", "unused-import", "unused import", Severity.WARNING)
GATES_NOTHING = _code("E1306", "gates-nothing", "a policy permits every request", Severity.WARNING)
IDLE_AIRSPACE = _code(
    "E1307",
    "idle-airspace",
    "an airspace zone has no effect",
    Severity.WARNING,
)
UNBOUNDED_PLACE = _code("E1308", "unbounded-place", "a permit does not bound where a skill flies", Severity.WARNING)
UNUSED_IGNORE = _code("E1309", "unused-ignore", "unused `ignore`", Severity.WARNING)
IGNORE_WITHOUT_REASON = _code("E1310", "ignore-without-reason", "an `ignore` lacks a reason", Severity.WARNING)
UNKNOWN_IGNORE = _code(
    "E1311", "unknown-ignore", "an `ignore` names an unknown code, or one that cannot be ignored", Severity.WARNING
)
KEPT_FROM_LANDING = _code(
    "E1312", "kept-from-landing", "a `degrade` turns a request to land into a flight", Severity.WARNING
)
NEVER_TAKES_OFF = _code(
    "E1313",
    "never-takes-off",
    "a condition before takeoff needs a signal known only in flight",
    Severity.WARNING,
)
UNTAKEN_PICTURES = _code("E1314", "untaken-pictures", "a skill states pictures that nobody takes", Severity.WARNING)

# E14: tests and nominals
NO_NOMINAL = _code("E1401", "no-nominal", "a test has no nominal, or does not say which")
INCOMPLETE_TEST = _code("E1402", "incomplete-test", "a test or its nominal is incomplete")
UNKNOWN_REASON = _code("E1403", "unknown-reason", "unknown reason")
NEVER_DECIDED = _code("E1404", "never-decided", "the expected outcome is impossible")
ROW_CELLS = _code("E1405", "row-cells", "a row's cells do not match the table's columns")
GIVEN_TWICE = _code("E1406", "given-twice", "a test repeats a signal, condition or argument")
SAME_TEST = _code("E1407", "same-test", "duplicate test name")
NOT_GIVEN = _code("E1408", "not-given", "a test does not give a signal that its request needs", Severity.WARNING)
WITHOUT_EFFECT = _code(
    "E1409", "without-effect", "a test gives a value that its policy does not read", Severity.WARNING
)
UNKNOWN_CLAUSE = _code("E1410", "unknown-clause", "a test quotes an unknown clause")
NOT_MET = _code("E1411", "not-met", "the decision differs from the expected one")

# E15: formatting
NOT_FORMATTED = _code("E1501", "not-formatted", "a source is not formatted", Severity.WARNING)
UNSAFE_FORMAT = _code("E1502", "unsafe-format", "formatting would change the meaning of a source")

# E16: scenarios
UNKNOWN_FAULT = _code("E1601", "unknown-fault", "unknown fault")
UNKNOWN_ENDING = _code("E1602", "unknown-ending", "unknown way to end")
UNKNOWN_AUTOPILOT = _code("E1603", "unknown-autopilot", "unknown simulated autopilot")
SAME_SCENARIO = _code("E1604", "same-scenario", "duplicate scenario name")
NO_SUCH_STEP = _code("E1605", "no-such-step", "a fault waits for a step that the mission lacks")
BAD_TRIGGER = _code("E1606", "bad-trigger", "a fault's trigger is a temporal condition or a phase")
UNREAD_TRIGGER = _code("E1607", "unread-trigger", "a fault's trigger reads a signal that the policy does not read")
BAD_START = _code("E1608", "bad-start", "invalid start of a scenario")
FLIGHT_FAILED = _code("E1610", "flight-failed", "a scenario's flight failed, or differs from what was expected")
NO_SUCH_ROLE = _code("E1609", "no-such-role", "an answer is given for a role that the policy does not declare")

# E17: cameras and pictures
UNKNOWN_CAMERA = _code("E1701", "unknown-camera", "a skill takes pictures with a camera that the vehicle lacks")
COARSE_PICTURES = _code("E1702", "coarse-pictures", "a pixel may show more than a skill's `resolution`")
SMALL_OVERLAP = _code("E1703", "small-overlap", "pictures may overlap less than a skill demands")
HASTY_PICTURES = _code("E1704", "hasty-pictures", "pictures are due faster than the camera can take them")
BLURRED_PICTURES = _code("E1705", "blurred-pictures", "pictures may smear more than a skill permits")
BAD_PICTURES = _code("E1706", "bad-pictures", "a skill demands pictures that its motion cannot take")
PATTERN_AREA = _code("E1707", "pattern-area", "an area lacks the line or the structure that a survey pattern needs")
RARE_PICTURES = _code("E1708", "rare-pictures", "a skill takes pictures more rarely than its `pictures` state")
