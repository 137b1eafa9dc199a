"""Parameters of a node of rclpy that another program owns."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter as NodeParameter

from catenary.ros2.interface import Parameter, ParametersCallback


class NodeParameters:
    """Owner of the declared parameters of a node.

    Args:
        node: node of rclpy.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._declared: dict[str, Any] = {}  # ParameterDescriptor by name
        self._change: ParametersCallback | None = None
        node.add_on_set_parameters_callback(self._requested)

    def show(self, found: Mapping[str, Parameter], change: ParametersCallback) -> None:
        """Declare, update and remove parameters; see `Backend.parameters`.

        Args:
            found: all parameters by name.
            change: receives requested values.
        """
        self._change = None  # not a request of another node
        for name in [name for name in self._declared if name not in found]:
            self._remove(name)
        for name, parameter in found.items():
            self._show(name, parameter)
        self._change = change

    def _show(self, name: str, parameter: Parameter) -> None:
        new = descriptor(parameter)
        if name in self._declared and self._declared[name] != new:
            self._remove(name)
        if name not in self._declared:
            self._node.declare_parameter(name, parameter.value, new)
            self._declared[name] = descriptor(parameter)  # rclpy changes the type in its own
        elif self._node.get_parameter(name).value != parameter.value:
            self._node.set_parameters([NodeParameter(name, value=parameter.value)])

    def _remove(self, name: str) -> None:
        self._node.undeclare_parameter(name)
        del self._declared[name]

    def _requested(self, parameters: Sequence[Any]) -> Any:
        """Return the result of a request of this or another node."""
        given = {each.name: each.value for each in parameters if each.name in self._declared}
        reason = self._change(given) if given and self._change is not None else ""
        return SetParametersResult(successful=not reason, reason=reason)


def descriptor(parameter: Parameter) -> Any:
    """Return the description and range of a parameter.

    rclpy does not declare a value outside of its range. Such a value, which the owner of the
    parameter may set, has no range.
    """
    made = ParameterDescriptor(description=parameter.description)
    low = -sys.float_info.max if parameter.minimum is None else parameter.minimum
    high = sys.float_info.max if parameter.maximum is None else parameter.maximum
    limited = parameter.minimum is not None or parameter.maximum is not None
    if limited and low <= parameter.value <= high:
        made.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    return made
