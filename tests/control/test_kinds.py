"""The number that identifies a block, so that no step accepts the rows of another block."""

from importlib import import_module

from catenary.control.compiles import MODULES

NAMES = ("KIND", "RESIDUAL", "THRESHOLD", "FEED_FORWARD", "FRICTION")


def test_each_block_has_a_number_of_its_own() -> None:
    modules = [import_module(f"catenary.control.{name}") for name in MODULES]
    kinds = {
        f"{module.__name__}.{name}": value
        for module in modules
        for name, value in vars(module).items()
        if name in NAMES and isinstance(value, float)
    }
    assert len(kinds) > 15
    assert len(set(kinds.values())) == len(kinds), kinds
