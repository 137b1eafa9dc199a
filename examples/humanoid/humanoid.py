"""A humanoid with 33 axes on two networks, under torque control at 4 kHz: `make humanoid`.

    python humanoid.py                     the main scenarios, in virtual time
    python humanoid.py push push-pd        chosen scenarios
    python humanoid.py --realtime stand    on the machine's clock
    python humanoid.py --page              the same endlessly, with the operator's page

Read the files in this order: program.py (loop and tasks), robot.py (body of the loop), laws.py,
tasks.py, balance.py.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

FOLDER = Path(__file__).parent
sys.path.append(str(FOLDER.parents[1]))  # the repository has `benchmarks`


def positive(text: str) -> float:
    value = float(text)
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def file(text: str) -> Path:
    if not Path(text).is_file():
        raise argparse.ArgumentTypeError(f"the file {text} does not exist")
    return Path(text)


def main() -> None:
    # The process of each task imports this file, and needs no law, scenario or plot.
    from dashboard import operate
    from program import run
    from report import report
    from run import Setup
    from scenarios import BY_NAME, MAIN

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenarios", nargs="*", metavar="SCENARIO", help=", ".join(BY_NAME))
    parser.add_argument("--realtime", action="store_true", help="on the machine's clock")
    parser.add_argument("--hertz", type=positive, default=4000.0, help="rate of the loop")
    parser.add_argument(
        "--silence", type=positive, default=0.01, help="age at which a command ends [s]"
    )
    parser.add_argument("--headless", action="store_true", help="write no plots")
    parser.add_argument("--model", type=file, default=FOLDER / "humanoid.xml", help="MJCF file")
    parser.add_argument("--policy", type=file, metavar="ONNX", help="balance by a policy")
    parser.add_argument(
        "--ros2", action="store_true", help="the hands follow geometry_msgs/PoseStamped"
    )
    parser.add_argument("--page", action="store_true", help="serve the operator's page")
    parser.add_argument("--port", type=int, default=8710, help="port of the page")
    parser.add_argument("--seconds", type=positive, default=math.inf, help="duration with the page")
    parser.add_argument("--name", default="humanoid", help="prefix of its shares")
    parser.add_argument("--out", type=Path, default=Path("out/humanoid"), help="output folder")
    a = parser.parse_args()
    if a.page:
        if a.scenarios or a.realtime or a.policy:
            parser.error("--page runs no scenario; omit SCENARIO, --realtime and --policy")
        a.out.mkdir(parents=True, exist_ok=True)
        operate(a.out, a.model, a.name, a.seconds, a.port, ros2=a.ros2)
        return
    names = a.scenarios or MAIN
    if unknown := [name for name in names if name not in BY_NAME]:
        parser.error(f"unknown scenarios {', '.join(unknown)}; known: {', '.join(BY_NAME)}")
    outcomes = []
    for name in names:
        folder = a.out / name
        folder.mkdir(parents=True, exist_ok=True)
        print(f"{name}: {BY_NAME[name].text}", flush=True)
        options = {"virtual": not a.realtime, "period": 1 / a.hertz}
        options |= {"silence": a.silence, "policy": a.policy, "ros2": a.ros2}
        setup = Setup(BY_NAME[name], folder, a.model, a.name, **options)
        outcomes.append(run(setup))
    report(a.out, outcomes, plots=not a.headless)


if __name__ == "__main__":
    from catenary.errors import CatenaryError

    try:
        main()
    except (CatenaryError, OSError, ValueError) as error:
        sys.exit(f"humanoid.py: {error}")
    except KeyboardInterrupt:
        sys.exit(130)  # 128 + SIGINT
