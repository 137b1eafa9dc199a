"""The programs of examples/humanoid import each other, as scripts of one folder do."""

from __future__ import annotations

import sys
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[3] / "examples" / "humanoid"
if str(FOLDER) not in sys.path:
    sys.path.append(str(FOLDER))
