"""Run the humanoid in virtual time until it is killed: `python operated.py NAME FOLDER`."""

import math
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
sys.path += [str(ROOT), str(ROOT / "examples" / "humanoid")]


def main(name: str, folder: str) -> None:
    from program import run
    from run import Setup
    from scenarios import Scenario

    scenario = Scenario("operate", "", math.inf)
    run(Setup(scenario, Path(folder), name=name, period=1e-3))


if __name__ == "__main__":  # the tasks' processes import this file
    main(*sys.argv[1:])
