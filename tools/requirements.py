"""Prints the requirements of `build`, or of an extra, as pyproject.toml lists them."""

import sys
import tomllib
from pathlib import Path

project = tomllib.loads(Path("pyproject.toml").read_text())
kind = sys.argv[1]
if kind == "build":
    # scikit-build-core asks for the last two itself, but not without build isolation
    print(*project["build-system"]["requires"], "cmake", "ninja", sep="\n")
else:
    print(*project["project"]["optional-dependencies"][kind], sep="\n")
