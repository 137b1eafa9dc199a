"""Entry point of the `catenary` command: imports all commands where Ctrl-C is handled already."""

INTERRUPTED = 130  # 128 + SIGINT


def main() -> int:
    """Run the command of the process's arguments and return the exit status."""
    try:
        from catenary.cli.main import main as run

        return run()
    except KeyboardInterrupt:
        return INTERRUPTED
