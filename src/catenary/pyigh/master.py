"""MasterBase: the published functions, over libethercat or over a MainDevice of our own."""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self

from catenary import bus, igh
from catenary.errors import ConfigurationError
from catenary.link import LinkSource
from catenary.pyigh.kernel import KernelSteps
from catenary.pyigh.own import OwnSteps
from catenary.pyigh.request import Wish
from catenary.pyigh.slaves import SlaveBase
from catenary.target import MainDevice


class SlaveInfo(NamedTuple):
    """What `ecat_get_slave_info` tells."""

    position: int
    name: str
    vendor: int
    product: int
    revision: int
    serial: int
    alias: int
    al_state: int


class MasterStatus(NamedTuple):
    """What `ecat_master_status` tells; `al_states` is the OR of all AL states."""

    slaves_responding: int
    al_states: int
    link_up: bool


class SlaveState(NamedTuple):
    """What `ecat_slave_config_state` tells."""

    online: bool
    operational: bool
    al_state: int


class Steps(Protocol):
    """The steps of a cycle, and who does them."""

    def receive(self) -> None: ...
    def process(self) -> bool: ...
    def queue(self) -> None: ...
    def write_time(self, time_ns: int) -> None: ...
    def send(self) -> None: ...
    def wait(self) -> None: ...
    def status(self) -> tuple[int, int, bool]: ...
    def state(self, position: int) -> tuple[bool, bool, int]: ...
    def close(self) -> None: ...


class MasterBase:
    """Owns a master that a program drives call by call. A context manager; `close` otherwise.

    `target`: as for `MainDevice`, or an open one. `period` [s] of the program's cycle.
    """

    def __init__(
        self, target: str | LinkSource | bus.MainDevice = "igh:0", period: float = 1e-3
    ) -> None:
        self._mine = not isinstance(target, bus.MainDevice)
        self.main = target if isinstance(target, bus.MainDevice) else MainDevice(target)
        self.period = period
        self.slaves: list[SlaveBase] = []
        self._wish = Wish(self.main, self.slaves)
        self._planned = False
        self._steps: Steps | None = None
        try:
            self.main.open()
            if not self.main.subs:
                self.main.scan()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends operation and gives the master back."""
        steps, self._steps = self._steps, None
        try:
            if steps is not None:
                steps.close()
        finally:
            if self._mine:
                self.main.close()

    # Before operation

    def ecat_init_slave(self, slave: SlaveBase) -> None:
        """Takes a slave in. ConfigurationError where another one is, or none."""
        self._before_operation()
        if not 0 <= slave.position < len(self.main.subs):
            raise ConfigurationError(
                f"there is no slave {slave.position}, the master has {len(self.main.subs)}",
                hint="correct the position, or scan again",
            )
        slave.adopt(self.main.subs[slave.position].description)
        self.slaves.append(slave)

    def ecat_activate_domain(self) -> None:
        """Says that all slaves have been given."""
        self._before_operation()
        if not self.slaves:
            raise ConfigurationError("no slaves", hint="ecat_init_slave(...) first")
        self._planned = True

    def ecat_activate_master(self) -> None:
        """Configures everything. From here on the program must call the steps of the cycle."""
        self._before_operation()
        if not self._planned:
            raise RuntimeError("ecat_activate_domain() comes first")
        master = self.main.master
        if isinstance(master, igh.KernelMaster):
            self._steps = KernelSteps(self.main, master, self._wish, self.slaves, self.period)
        else:
            self._steps = OwnSteps(self._wish, self.slaves, self.period)

    # A cycle, in this order

    def ecat_master_receive(self) -> None:
        """Takes the frames that have come back."""
        self._active.receive()

    def ecat_domain_process(self) -> bool:
        """Takes the inputs out of them; whether all slaves have answered."""
        return self._active.process()

    def ecat_domain_queue(self) -> None:
        """Puts the outputs into the next frames."""
        self._active.queue()

    def ecat_write_apptime(self, time_ns: int) -> None:
        """The application's time, for distributed clocks. Our own MainDevice tells its own."""
        self._active.write_time(time_ns)

    def ecat_master_send(self) -> None:
        """Sends them."""
        self._active.send()

    def wait(self) -> None:
        """Until the next instant of the period."""
        self._active.wait()

    # Looks

    def ecat_get_slave_info(self, position: int) -> SlaveInfo:
        """A slave, as it was found."""
        sub = self.main.subs[position]
        return SlaveInfo(position, sub.name, *sub.identity, sub.alias, int(sub.state or 0))

    def ecat_master_status(self) -> MasterStatus:
        """How many answer, and from which states."""
        return MasterStatus(*self._active.status())

    def ecat_slave_config_state(self, slave: SlaveBase) -> SlaveState:
        """Whether a slave runs as it was configured."""
        return SlaveState(*self._active.state(slave.position))

    @property
    def _active(self) -> Steps:
        if self._steps is None:
            raise RuntimeError("the master is not active: ecat_activate_master() first")
        return self._steps

    def _before_operation(self) -> None:
        if self._steps is not None:
            raise ConfigurationError(
                "the master is active: nothing can be configured any more",
                hint="close it and begin again",
            )
