"""Entry point of the `catenary` command, which handles Ctrl-C even during the imports."""

import sys

INTERRUPTED = 130  # 128 + SIGINT


def main() -> int:
    """Run the command in the arguments of this process. Return the exit status."""
    try:
        from catenary.cli.main import main as run

        return run()
    except KeyboardInterrupt as interrupt:
        for note in getattr(interrupt, "__notes__", ()):  # what could not be restored
            print(f"catenary: {note}", file=sys.stderr)
        return INTERRUPTED
