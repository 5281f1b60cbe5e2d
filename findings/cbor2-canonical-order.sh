#!/bin/sh
# cbor2 6.2.1: `dumps(..., canonical=True)` sorts the keys of a map by length first (RFC 7049, section 3.9).
# Expected: the deterministic encoding of RFC 8949, section 4.2.1, which sorts the encoded keys octet by octet.
# It matters for keys as COSE has them: 100 is 18 64 and -1 is 20, so RFC 8949 puts 100 first, and cbor2 -1. Whoever signs
# such a map and whoever verifies it octet for octet must mean the same of the two.
# Seen: a3 0a 03, 20 01, 18 64 02  (10, -1, 100)
. "$(dirname "$0")/run.inc"
packages cbor2==6.2.1
python - <<'END'
import cbor2

seen = cbor2.dumps({-1: 1, 100: 2, 10: 3}, canonical=True)
print("cbor2 6.2.1, canonical=True:", seen.hex(" "))
assert seen == bytes.fromhex("a30a032001186402"), "it has changed"
keys = [cbor2.dumps(key) for key in (10, 100, -1)]
assert keys == sorted(keys), "RFC 8949, section 4.2.1: 10, 100, -1"
END
