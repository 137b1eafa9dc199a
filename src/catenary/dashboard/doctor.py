"""Examination of this machine by `catenary doctor`, in a process of its own."""

from __future__ import annotations

import asyncio
import sys

import msgspec

from catenary.errors import CatenaryError

SECONDS = 60.0  # limit


async def run_doctor() -> object:
    """Return the result of `catenary doctor --json`.

    Raises:
        CatenaryError: the examination failed or took too long.
    """
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "catenary.cli", "doctor", "--json"),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    try:
        output, errors = await asyncio.wait_for(process.communicate(), SECONDS)
    except TimeoutError as error:
        raise CatenaryError(f"the examination took more than {SECONDS:g} s") from error
    finally:
        if process.returncode is None:
            process.kill()
    try:
        return msgspec.json.decode(output)
    except msgspec.MsgspecError as error:
        raise CatenaryError(f"the examination failed: {errors.decode(errors='replace')}") from error
