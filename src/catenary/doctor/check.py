"""Check: one question about this machine, its verdict, and what to type."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

from catenary.doctor.change import Change

Status: TypeAlias = Literal["PASS", "WARN", "FAIL", "SKIP"]


@dataclass(frozen=True, slots=True)
class Check:
    """PASS: as it should be. WARN: cycles may come late. FAIL: they will, or nothing runs at all.
    SKIP: it cannot be known here, and `found` says why.

    id: its heading in docs/doctor.md. advice: what to type; empty where nothing is to be done.
    changes: what `--apply` would do about it; all of them can be undone.
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
