"""`python -m catenary.cli`, the same as `catenary`."""

import sys

from catenary.cli.console import main

sys.exit(main())
