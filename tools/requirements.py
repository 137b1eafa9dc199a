"""Print the requirements of `build` or of an extra, from pyproject.toml."""

import sys
import tomllib
from pathlib import Path

project = tomllib.loads(Path("pyproject.toml").read_text())
kind = sys.argv[1]
if kind == "build":
    # scikit-build-core requests the last two itself, but only with build isolation.
    print(*project["build-system"]["requires"], "cmake", "ninja", sep="\n")
else:
    print(*project["project"]["optional-dependencies"][kind], sep="\n")
