"""`python -m catenary.cli`, the same as `catenary`."""

import sys

from catenary.cli import main

sys.exit(main())
