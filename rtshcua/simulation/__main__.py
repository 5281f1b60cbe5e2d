"""`python -m rtshcua.simulation`: the simulated vehicle as a process."""

import sys

from rtshcua.simulation.process import main

sys.exit(main())
