"""The limits of a bundle. A C evaluator sizes its tables by them; the compiler reports a violation, `prepare` refuses
it.

Values and times stay within `MAX_VALUE`, which every JSON reader holds exactly. Computed values stay within
`MAX_MAGNITUDE`, hence within a signed 64-bit integer.
"""

MAX_VALUE = (1 << 53) - 1
MAX_MAGNITUDE = 1 << 62
MAX_SPEED = 1 << 20  # mm/s, about 1,000 m/s
MAX_DURATION = 1 << 42  # us, about 50 days
FULL = 10_000  # 1/10000: a full charge
DAY = 86_400_000_000  # us
WEEK = 7 * DAY

MAX_OFFSETS = 256  # of the local time, in one policy
MAX_SLOTS = 72  # with which no request is larger than 1 KiB
MAX_SILENCE = 3_600_000_000  # us: the longest silence of the vehicle that a policy may set before it acts
MAX_STALE = (1 << 32) - 2  # us, about 71 minutes: the ages of a request saturate just above
MAX_ROLES = 64
MAX_ZONES = 4_096  # declared and derived
MAX_TOTAL_VERTICES = 1 << 16
MAX_TABLES = 256
MAX_SETS = 4_096
MAX_MEMBERS = 4_096
MAX_CONTRACTS = 256
MAX_PARAMETERS = 32
MAX_CELLS = 64
MAX_CLAUSES = 64  # of one kind in one contract
MAX_TEXT = 400  # characters in the text of a clause, which is for a person; longer texts are cut
MAX_LINKS = 8
MAX_RULES = 16_384
MAX_RULE_KEYS = 1 << 18  # entries of the rule index: skills times roles, summed over all rules
MAX_INVOCATIONS = 16_384
MAX_PHASES = 64
MAX_PATH = 8_192  # points
#: edges of zones that the legs of a mission's paths are compared with, plus one for each leg and zone: a request
#: waits for those of its step, and the boundary must answer within a second in flight
MAX_COMPARED = 1 << 23
MAX_EMISSIONS = 8  # commands to payload, in one contract
MAX_PAYLOAD_WAIT = 60_000_000  # us: the longest wait for the effect of a command to payload
MIN_EMISSION_INTERVAL = 100_000  # us: between two commands to payload of one kind
MAX_DIVISOR = 1 << 30  # of an argument, for a parameter of a command to payload
MAX_SERVOS = 32
MAX_MONITORS = 32
MAX_WINDOW = 600_000_000  # us: how far back a temporal monitor looks
MAX_GAP = 1_000_000  # us: after a longer interval between two observations, the truth in between is unknown
MAX_PHASE_NAMES = 64
MAX_KEYS = 512  # in a trust root
MAX_REVOKED = 4_096  # keys that a trust root revokes
MAX_ANSWERS = 4_096  # approvals and refusals of people that one flight keeps
MAX_DISPATCHED = 65_536  # permits that one session dispatches
