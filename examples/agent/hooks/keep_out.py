"""A hook before other tools of a host: refuses calls that name a place which is none of the model's business.

Arguments: the places. It reads the call on its standard input (JSON), and ends with 2 to have it refused, which its
standard error explains to the model. It keeps an honest model on the path of the tools. It is no boundary: that is the
vehicle's, which takes nothing without a signature that its trust root allows.
"""

import json
import sys

REASON = "`{}` belongs to the vehicle's runtime: use the tools of the server `rtshcua`, or ask the user"


def main() -> int:
    """Refuse the call or not."""
    try:
        asked = json.dumps(json.load(sys.stdin).get("tool_input", {}), ensure_ascii=False)
    except (ValueError, AttributeError):
        return 0  # no call that it knows: what a host does with it is the host's
    for place in sys.argv[1:]:
        if place in asked:
            sys.stderr.write(REASON.format(place) + "\n")
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
