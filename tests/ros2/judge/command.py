"""The command `catenary` in an environment with rclpy, which has no Catenary.

The first argument is the loader of an editable installation for the same Python: it finds the
sources and the compiled modules. The other arguments are those of the command.
"""

import sys
from importlib.util import module_from_spec, spec_from_file_location

spec = spec_from_file_location("_editable_skbc_catenary", sys.argv.pop(1))
assert spec is not None
assert spec.loader is not None
loader = module_from_spec(spec)
sys.modules[spec.name] = loader
spec.loader.exec_module(loader)

from catenary.cli.console import main  # noqa: E402

sys.exit(main())
