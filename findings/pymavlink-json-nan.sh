#!/bin/sh
# pymavlink 2.4.50: `to_json` of a message with a field that is not known (NaN) is no JSON.
# Expected: null, or an error. Autopilots send NaN where they know nothing, as MAVLink asks of them: PX4's ALTITUDE has
# NaN for the height over terrain without a range finder. RFC 8259, section 6, has no NaN, and a strict parser refuses the text.
# Seen: "altitude_terrain": NaN
. "$(dirname "$0")/run.inc"
packages pymavlink==2.4.50
python - <<'END'
import json
from math import nan

from pymavlink.dialects.v20 import common

text = common.MAVLink_altitude_message(0, 1.0, 2.0, 3.0, 4.0, nan, nan).to_json()
print("pymavlink 2.4.50:", text)
assert '"altitude_terrain": NaN' in text, "it has changed"


def refuse(word: str) -> None:
    raise ValueError(word)


try:
    json.loads(text, parse_constant=refuse)
except ValueError as error:
    print("a strict parser refuses it:", error)
else:
    raise AssertionError("it has changed")
END
