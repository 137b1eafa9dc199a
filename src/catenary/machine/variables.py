"""Variables of the process image of an ENI, by their names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import get_close_matches

from catenary.drive.process_data import ProcessData
from catenary.esi.eni import Variable
from catenary.machine.by_name import MissingName


class Variables(Mapping[str, float]):
    """Values of the variables of an ENI by their full names, such as "Box 1.Inputs.Status word".

        machine.variables["Box 1.Outputs.Control word"] = 0x06
        status = machine.variables["Box 1.Inputs.Status word"]

    While a loop is open, an assignment writes an output for the next cycle. A value is that of the
    last cycle. Iteration yields the names. A machine file has no variables.
    """

    def __init__(
        self,
        values: Mapping[str, tuple[ProcessData, str]],
        table: Mapping[str, Variable],
        left_out: Mapping[str, str],
    ) -> None:
        """Initialise the mapping.

        Args:
            values: process data and the name in it, by full name.
            table: name, data type and place of each variable, by full name.
            left_out: reasons why variables are not exchanged, by full name.
        """
        self._values = dict(values)
        self._table = dict(table)
        self._left_out = dict(left_out)

    @property
    def left_out(self) -> Mapping[str, str]:
        """Variables of the file that are not exchanged, with the reason."""
        return self._left_out

    def describe(self, name: str) -> Variable:
        """Return direction, data type, bit length and bit offset of a variable, with its line.

        The bit offset counts in the image of the ENI.

        Raises:
            KeyError: The name is unknown.
        """
        self._find(name)
        return self._table[name]

    def __getitem__(self, name: str) -> float | int:
        """Return the value of a variable.

        Raises:
            KeyError: The name is unknown, or the variable is not exchanged.
            RuntimeError: No loop has been opened yet.
        """
        data, channel = self._find(name)
        return data[channel]

    def __setitem__(self, name: str, value: float | int) -> None:
        """Write an output.

        Raises:
            KeyError: The name is unknown, or the variable is not exchanged.
            TypeError: The variable is an input, or needs an integer.
            ValueError: The value is out of the range of the type.
            RuntimeError: No loop has been opened yet.
        """
        data, channel = self._find(name)
        data[channel] = value

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return f"<{len(self)} variables>"

    def _find(self, name: str) -> tuple[ProcessData, str]:
        found = self._values.get(name)
        if found is not None:
            return found
        if name in self._left_out:
            raise MissingName(f'variable "{name}" is not exchanged: {self._left_out[name]}')
        near = get_close_matches(name, self._values, n=1)
        guess = f'; did you mean "{near[0]}"?' if near else "; list(machine.variables) has them all"
        raise MissingName(f'there is no variable "{name}"{guess}')
