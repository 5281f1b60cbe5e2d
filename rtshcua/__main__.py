"""`python -m rtshcua`: the command, as `rtshcua` is."""

import sys

from rtshcua.front.cli.entry_point import main

if __name__ == "__main__":
    sys.exit(main())
