"""Search for registers by name and by address."""

from __future__ import annotations

import pytest

from catenary.wire import register
from catenary.wire.register_names import at_address, by_name


@pytest.mark.parametrize("name", ["AL_STATUS", "al status", "al-status", "AlStatus"])
def test_any_spelling_of_a_name_is_found(name: str) -> None:
    assert by_name(name) == register.AL_STATUS


def test_indexed_registers_have_names() -> None:
    assert by_name("fmmu3") == register.fmmu(3)
    assert by_name("SyncManager 15") == register.sync_manager(15)
    assert by_name("lost link counter port 2") == register.lost_link_counter(2)


def test_every_register_of_the_map_is_found_by_its_constant() -> None:
    constants = {k: v for k, v in vars(register).items() if isinstance(v, register.Register)}
    assert len(constants) > 90
    assert all(by_name(name) == value for name, value in constants.items())


def test_an_error_lists_similar_names() -> None:
    with pytest.raises(ValueError, match="unknown register 'alstatis'; similar names: AL status"):
        by_name("alstatis")
    with pytest.raises(ValueError, match=r"unknown register 'qqqqqqq'$"):
        by_name("qqqqqqq")


def test_an_address_without_a_size_gives_the_number() -> None:
    assert at_address(0x0000) == register.TYPE
    assert at_address(0x0900) == register.RECEIVE_TIME_LATCH
    assert at_address(0x0131) is None


def test_an_address_and_a_size_give_the_register_of_that_size() -> None:
    assert at_address(0x0000, 10) == register.INFORMATION
    assert at_address(0x0900, 56) == register.CLOCK_BLOCK
    assert at_address(0x0130, 4) is None
