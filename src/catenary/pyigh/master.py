"""MasterBase: the published functions, over libethercat or over Catenary's own MainDevice."""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self

from catenary import bus, igh
from catenary.errors import ConfigurationError
from catenary.link import LinkSource
from catenary.pyigh.kernel import KernelSteps
from catenary.pyigh.own import OwnSteps
from catenary.pyigh.request import ProcessDataRequest
from catenary.pyigh.slaves import SlaveBase
from catenary.target import MainDevice


class SlaveInfo(NamedTuple):
    """Result of `ecat_get_slave_info`."""

    position: int
    name: str
    vendor: int
    product: int
    revision: int
    serial: int
    alias: int
    al_state: int


class MasterStatus(NamedTuple):
    """Result of `ecat_master_status`; `al_states` is the OR of all AL states."""

    slaves_responding: int
    al_states: int
    link_up: bool


class SlaveState(NamedTuple):
    """Result of `ecat_slave_config_state`."""

    online: bool
    operational: bool
    al_state: int


class Steps(Protocol):
    """The steps of a cycle, implemented over libethercat and over a `Loop`."""

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
    """Master for a program that calls each step of the cycle itself.

    Use it as a context manager, or call `close`. Without libethercat, `ecat_master_receive` runs a
    whole cycle of a `Loop`: it sends the outputs, waits and reads the inputs.

    Args:
        target: A target as for `MainDevice`, or a MainDevice.
        period: The period of the program's cycle [s].
    """

    def __init__(
        self, target: str | LinkSource | bus.MainDevice = "igh:0", period: float = 1e-3
    ) -> None:
        self._mine = not isinstance(target, bus.MainDevice)
        self.main = target if isinstance(target, bus.MainDevice) else MainDevice(target)
        self.period = period
        self.slaves: list[SlaveBase] = []
        self._request = ProcessDataRequest(self.main, self.slaves)
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
        """End the operation. Close the MainDevice if this object created it."""
        steps, self._steps = self._steps, None
        try:
            if steps is not None:
                steps.close()
        finally:
            if self._mine:
                self.main.close()

    # Before operation

    def ecat_init_slave(self, slave: SlaveBase) -> None:
        """Add a slave to the program.

        Raises:
            ConfigurationError: No device, or another device, is at the position of the slave.
        """
        self._before_operation()
        if not 0 <= slave.position < len(self.main.subs):
            raise ConfigurationError(
                f"there is no slave {slave.position}: the master has {len(self.main.subs)} slaves",
                hint="correct the position, or scan again",
            )
        slave.adopt(self.main.subs[slave.position].description)
        self.slaves.append(slave)

    def ecat_activate_domain(self) -> None:
        """Confirm that all slaves have been added.

        Raises:
            ConfigurationError: No slave has been added.
        """
        self._before_operation()
        if not self.slaves:
            raise ConfigurationError(
                "no slave has been added", hint="call ecat_init_slave(...) first"
            )
        self._planned = True

    def ecat_activate_master(self) -> None:
        """Configure and activate the master. The program must then call the steps of the cycle.

        Raises:
            RuntimeError: `ecat_activate_domain` has not been called.
        """
        self._before_operation()
        if not self._planned:
            raise RuntimeError("the domain is not active: call ecat_activate_domain() first")
        master = self.main.master
        if isinstance(master, igh.KernelMaster):
            self._steps = KernelSteps(self.main, master, self._request, self.slaves, self.period)
        else:
            self._steps = OwnSteps(self._request, self.slaves, self.period)

    # A cycle, in this order

    def ecat_master_receive(self) -> None:
        """Receive the frames that have returned."""
        self._active.receive()

    def ecat_domain_process(self) -> bool:
        """Read the inputs from the received frames. Return True if all slaves have answered."""
        return self._active.process()

    def ecat_domain_queue(self) -> None:
        """Queue the outputs for the next frames."""
        self._active.queue()

    def ecat_write_apptime(self, time_ns: int) -> None:
        """Set the application time for distributed clocks [ns].

        Without libethercat, this has no effect: the loop uses its own time.
        """
        self._active.write_time(time_ns)

    def ecat_master_send(self) -> None:
        """Send the queued frames."""
        self._active.send()

    def wait(self) -> None:
        """Wait until the next cycle start."""
        self._active.wait()

    # Information

    def ecat_get_slave_info(self, position: int) -> SlaveInfo:
        """Return the information of a slave from the last scan."""
        sub = self.main.subs[position]
        return SlaveInfo(position, sub.name, *sub.identity, sub.alias, int(sub.state or 0))

    def ecat_master_status(self) -> MasterStatus:
        """Return the number of answering slaves, their states and the link state."""
        return MasterStatus(*self._active.status())

    def ecat_slave_config_state(self, slave: SlaveBase) -> SlaveState:
        """Return whether a slave is online and operational, and its AL state."""
        return SlaveState(*self._active.state(slave.position))

    @property
    def _active(self) -> Steps:
        if self._steps is None:
            raise RuntimeError("the master is not active: call ecat_activate_master() first")
        return self._steps

    def _before_operation(self) -> None:
        if self._steps is not None:
            raise ConfigurationError(
                "the master is active and can no longer be configured",
                hint="close it and create a new one",
            )
