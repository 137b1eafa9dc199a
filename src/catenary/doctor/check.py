"""Check: the verdict on one property of this machine, and the commands that improve it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from catenary.doctor.change import Change

Status: TypeAlias = Literal["PASS", "WARN", "FAIL", "SKIP"]


@dataclass(frozen=True, slots=True)
class Check:
    """Result of one check.

    PASS: good. WARN: cycles may be late. FAIL: cycles will be late, or the loop cannot run.
    SKIP: unknown on this machine; `found` has the reason.

    id: heading in docs/how_to/doctor.md. found: the result.
    advice: commands to type; may be empty. changes: reversible changes that `--apply` makes.
    """

    id: str
    status: Status
    found: str
    advice: str = ""
    changes: tuple[Change, ...] = ()


def passed(id: str, found: str, advice: str = "", changes: tuple[Change, ...] = ()) -> Check:
    return Check(id, "PASS", found, advice, changes)


def warned(id: str, found: str, advice: str, changes: tuple[Change, ...] = ()) -> Check:
    return Check(id, "WARN", found, advice, changes)


def failed(id: str, found: str, advice: str, changes: tuple[Change, ...] = ()) -> Check:
    return Check(id, "FAIL", found, advice, changes)


def skipped(id: str, why: str, advice: str = "") -> Check:
    return Check(id, "SKIP", why, advice)
