"""The IgH EtherCAT master, a kernel module, as a target: `MainDevice("igh:0")`."""

from catenary.igh.kernel_master import KernelMaster
from catenary.igh.library import Library
from catenary.igh.master import Master
from catenary.igh.reservation import Reservation
from catenary.igh.sub_device import SubDevice

__all__ = ["KernelMaster", "Library", "Master", "Reservation", "SubDevice"]
