"""The slaves of a program as one process-data request."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from catenary.bus import MainDevice, SubDevice
from catenary.plan.request import DeviceRequest, ImageLayout, RequestTables, Views
from catenary.pyigh.slaves import SlaveBase, columns_of, pdos_of


class ProcessDataRequest:
    """One process-data request for all slaves. Implements `plan.request.ProcessDataRequest`."""

    def __init__(self, main: MainDevice, slaves: Sequence[SlaveBase]) -> None:
        self.main = main
        self._slaves = slaves
        self.tables_made = RequestTables()
        self.layout: ImageLayout | None = None
        self.views: Views | None = None

    @property
    def subs(self) -> Sequence[SubDevice]:
        return [self.main.subs[slave.position] for slave in self._slaves]

    def pdos(self, period_ns: int) -> Mapping[int, DeviceRequest]:
        return pdos_of(self._slaves)

    def tables(self, layout: ImageLayout) -> RequestTables:
        self.layout = layout
        self.tables_made = columns_of(self._slaves, layout)
        return self.tables_made

    def bind(self, views: Views) -> None:
        self.views = views
