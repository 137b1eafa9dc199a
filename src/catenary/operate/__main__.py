"""`python -m catenary.operate TARGET SHARE`: operate a segment until SIGTERM."""

import sys

from catenary.operate.program import main

sys.exit(main(*sys.argv[1:]))
