"""The IgH EtherCAT master, a kernel module, in place of a link: `MainDevice("igh:0")`."""

from catenary.igh.library import Library
from catenary.igh.main_device import MainDevice
from catenary.igh.master import Master, Reservation
from catenary.igh.sub_device import SubDevice

__all__ = ["Library", "MainDevice", "Master", "Reservation", "SubDevice"]
