"""Next steps after `catenary check --against line/`."""

from __future__ import annotations

import argparse

import pytest

from catenary.bus.clone_device import IN_INIT, NOT_WRITTEN
from catenary.cli.check_advice import next_steps
from catenary.line.change import Change, ChangedDevice, Comparison, Part, Severity, Uncompared
from catenary.line.compare import IN_REGISTER

DEVICE = ChangedDevice("drive", 2, 2)
ARGUMENTS = argparse.Namespace(file="eth0", target=None, against="line/", pre_op=False)


def steps(part: Part = Part.ALIAS, what: str = "", unread: str = "") -> list[str]:
    """Return the next steps for one change, and one part that could not be read."""
    change = Change(DEVICE, part, what, "3", "5", Severity.EFFECT)
    uncompared = (Uncompared(DEVICE, "objects", unread, expected=True),) if unread else ()
    return list(next_steps(Comparison((change,), uncompared, 1), ARGUMENTS))


def test_the_clone_is_replaced_if_everything_was_read() -> None:
    assert steps()[-1].endswith("catenary clone eth0 -o line/ --fresh --pre-op")


@pytest.mark.parametrize("reason", [IN_INIT, NOT_WRITTEN.format(state="OP")])
def test_a_complete_clone_is_not_replaced_by_one_with_missing_parts(reason: str) -> None:
    found = steps(unread=reason)
    assert found[-1].endswith("catenary clone eth0 -o line/ --pre-op")
    assert any("add --pre-op" in each for each in found) is (reason == IN_INIT)


def test_only_an_alias_in_the_eeprom_can_be_written() -> None:
    assert steps()[0] == "write the earlier value: catenary alias eth0 2 3"
    assert not any("catenary alias" in each for each in steps(what=IN_REGISTER))
