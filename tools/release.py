"""Check a release and write its files: `make release`, or `python -m tools.release [OPTION ...]`.

Nothing is uploaded, and no tag is made. All steps run, also after one that failed. `--quick` runs
the checks that need no build: version, tree, examples and results. A complete run removes the files
of an earlier one first. Steps that find something to improve, but not to refuse, report it after
"note".
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeAlias

from tools import release_builds, release_checks
from tools.release_step import ROOT, Failure, Release

Step: TypeAlias = Callable[[Release], str]

CHECKS: dict[str, Step] = {
    "tree": release_checks.check_tree,
    "version": release_checks.check_version,
    "changelog": release_checks.check_changelog,
    "results": release_checks.check_results,
    "examples": release_checks.check_examples,
}
BUILDS: dict[str, Step] = {
    "tests": release_builds.run_tests,
    "lint": release_builds.run_lint,
    "docs": release_builds.build_docs,
    "sdist": release_builds.build_sdist,
    "wheels": release_builds.build_wheels,
    "pythons": release_builds.test_pythons,
    "sums": release_builds.write_sums,
}


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tools.release",
        description="Check a release and write its files. Nothing is uploaded.",
        epilog=f"steps: {', '.join([*CHECKS, *BUILDS])}",
    )
    parser.add_argument(
        "--quick",
        action="store_true",
        help="only the checks; a changed tree and unreleased changes are notes",
    )
    parser.add_argument(
        "--only", action="append", choices=[*CHECKS, *BUILDS], metavar="STEP", help="run this step"
    )
    parser.add_argument(
        "--out", type=Path, default=ROOT / "out" / "release", help="folder (out/release)"
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the steps. Return 0, or 1 if a step failed."""
    options = make_parser().parse_args(arguments)
    release = Release(ROOT, options.out.resolve(), quick=options.quick)
    steps = CHECKS if options.quick else CHECKS | BUILDS
    if options.only:
        steps = {name: step for name, step in (CHECKS | BUILDS).items() if name in options.only}
    elif not options.quick:
        release_builds.remove_files(release)
    failed = [name for name, step in steps.items() if not run_step(name, step, release)]
    if failed:
        print(f"\nnot ready for a release: {', '.join(failed)}", file=sys.stderr)
        return 1
    print(f"\n{len(steps)} steps passed; nothing was uploaded")
    return 0


def run_step(name: str, step: Step, release: Release) -> bool:
    """Run a step and print its result. Return True if it passed."""
    start = time.monotonic()
    try:
        status, text = "ok", step(release)
    except Failure as failure:
        status, text = "FAIL", str(failure)
    print(f"{status:<5} {name:<10} {time.monotonic() - start:7.1f} s  {text}", flush=True)
    return status == "ok"


if __name__ == "__main__":
    sys.exit(main())
