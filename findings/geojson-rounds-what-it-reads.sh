#!/bin/sh
# geojson 3.3.0: `loads` rounds the coordinates of a file to 6 decimals, heights too, without being asked.
# Expected: to round when a geometry is made, if at all, and to keep what a file says: a file that is read and written again is
# another one. A place of MAVLink has 7 decimals of a degree (GLOBAL_POSITION_INT); of the 7th, up to 6 cm are lost.
# `precision` is an argument of each geometry, and the module's DEFAULT_PRECISION is the only way to reach it through `loads`.
# Seen: read 8.545594, 47.397742, 488.123457; with DEFAULT_PRECISION = 7: 8.5455942, 47.3977418, 488.1234567
. "$(dirname "$0")/run.inc"
packages geojson==3.3.0
python - <<'END'
import geojson
import geojson.geometry

text = '{"type": "Point", "coordinates": [8.5455942, 47.3977418, 488.1234567]}'
default = geojson.loads(text)["coordinates"]
geojson.geometry.DEFAULT_PRECISION = 7
finer = geojson.loads(text)["coordinates"]
print(f"geojson 3.3.0: read {default}; with DEFAULT_PRECISION = 7: {finer}")
assert default == [8.545594, 47.397742, 488.123457], "it has changed"
assert finer == [8.5455942, 47.3977418, 488.1234567], "it has changed"
END
