"""Safety connections of virtual devices, modelled after FSoE but simplified: no conformity."""

from catenary.virtual.fsoe.endpoint import SafetyState
from catenary.virtual.fsoe.main_instance import MainInstance
from catenary.virtual.fsoe.sub_instance import SubInstance

__all__ = ["MainInstance", "SafetyState", "SubInstance"]
