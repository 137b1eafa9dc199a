"""The binary interface of libethercat: structures, constants and calls for `ctypes`.

Source: the headers of 1.5.2, 1.5.3, 1.6-alpha, 1.6.0, 1.6.1 and 1.6.4. tests/igh/abi.json has the
sizes and offsets measured from each, and the tests compare them. All releases have the same
structures. They differ in the set of calls and in the return type of 25 calls. Before 1.6.0, these
calls return nothing; since then, 0 or -errno. The version magic cannot distinguish the two:
1.6-alpha has the magic of 1.6 and returns nothing.
"""

from __future__ import annotations

import ctypes as c
from types import MappingProxyType
from typing import Final

SYNC_MANAGERS_MAX = 16
PORTS = 4
LIST_END = 0xFF  # index of the record that ends a list of SyncManagers

DIRECTION_OUTPUT, DIRECTION_INPUT = 1, 2
WATCHDOG_DEFAULT, WATCHDOG_ENABLE, WATCHDOG_DISABLE = 0, 1, 2
COUNTER_ZERO, COUNTER_INCOMPLETE, COUNTER_COMPLETE = 0, 1, 2
REQUEST_UNUSED, REQUEST_BUSY, REQUEST_SUCCESS, REQUEST_ERROR = 0, 1, 2, 3

MAGICS = (0x0105, 0x0106)  # 1.5.x, 1.6.x
RETURNS_SINCE = "ecrt_slave_config_state_timeout"  # a call added with the return values, in 1.6.0


class MasterState(c.Structure):
    """`ec_master_state_t` and `ec_master_link_state_t`, which have the same layout."""

    _fields_ = (
        ("slaves_responding", c.c_uint32),
        ("al_states", c.c_uint32, 4),  # OR of the AL states of all slaves
        ("link_up", c.c_uint32, 1),
    )


class ConfigState(c.Structure):
    """`ec_slave_config_state_t`."""

    _fields_ = (
        ("online", c.c_uint32, 1),
        ("operational", c.c_uint32, 1),  # in OP, by this configuration
        ("al_state", c.c_uint32, 4),
    )


class MasterInfo(c.Structure):
    """`ec_master_info_t`."""

    _fields_ = (
        ("slave_count", c.c_uint32),
        ("link_up", c.c_uint8, 1),
        ("scan_busy", c.c_uint8),
        ("app_time", c.c_uint64),
    )


class PortLink(c.Structure):
    """`ec_slave_port_link_t`."""

    _fields_ = (
        ("link_up", c.c_uint8),
        ("loop_closed", c.c_uint8),
        ("signal_detected", c.c_uint8),
    )


class Port(c.Structure):
    """An element of `ports` of `ec_slave_info_t`."""

    _fields_ = (
        ("desc", c.c_uint32),
        ("link", PortLink),
        ("receive_time", c.c_uint32),
        ("next_slave", c.c_uint16),
        ("delay_to_next_dc", c.c_uint32),
    )


class SlaveInfo(c.Structure):
    """`ec_slave_info_t`."""

    _fields_ = (
        ("position", c.c_uint16),
        ("vendor_id", c.c_uint32),
        ("product_code", c.c_uint32),
        ("revision_number", c.c_uint32),
        ("serial_number", c.c_uint32),
        ("alias", c.c_uint16),
        ("current_on_ebus", c.c_int16),
        ("ports", Port * PORTS),
        ("al_state", c.c_uint8),
        ("error_flag", c.c_uint8),
        ("sync_count", c.c_uint8),
        ("sdo_count", c.c_uint16),
        ("name", c.c_char * 64),
    )


class DomainState(c.Structure):
    """`ec_domain_state_t`."""

    _fields_ = (
        ("working_counter", c.c_uint32),
        ("wc_state", c.c_uint32),
        ("redundancy_active", c.c_uint32),
    )


class PdoEntryInfo(c.Structure):
    """`ec_pdo_entry_info_t`."""

    _fields_ = (("index", c.c_uint16), ("subindex", c.c_uint8), ("bit_length", c.c_uint8))


class PdoInfo(c.Structure):
    """`ec_pdo_info_t`."""

    _fields_ = (
        ("index", c.c_uint16),
        ("n_entries", c.c_uint32),
        ("entries", c.POINTER(PdoEntryInfo)),
    )


class SyncInfo(c.Structure):
    """`ec_sync_info_t`."""

    _fields_ = (
        ("index", c.c_uint8),
        ("dir", c.c_uint32),
        ("n_pdos", c.c_uint32),
        ("pdos", c.POINTER(PdoInfo)),
        ("watchdog_mode", c.c_uint32),
    )


TYPES: Final = MappingProxyType(
    {
        "v": None,
        "p": c.c_void_p,
        "u8": c.c_uint8,
        "u16": c.c_uint16,
        "u32": c.c_uint32,
        "u64": c.c_uint64,
        "s32": c.c_int32,
    }
)

# Types of each call, return type first. "r": nothing before 1.6.0, then 0 or -errno.
CALLS: Final = MappingProxyType(
    {
        "ecrt_version_magic": "u32",
        "ecrt_request_master": "p u32",
        "ecrt_release_master": "v p",
        "ecrt_master_create_domain": "p p",
        "ecrt_master_slave_config": "p p u16 u16 u32 u32",
        "ecrt_master_select_reference_clock": "s32 p p",
        "ecrt_master": "s32 p p",
        "ecrt_master_get_slave": "s32 p u16 p",
        "ecrt_master_get_sync_manager": "s32 p u16 u8 p",
        "ecrt_master_get_pdo": "s32 p u16 u8 u16 p",
        "ecrt_master_get_pdo_entry": "s32 p u16 u8 u16 u16 p",
        "ecrt_master_sdo_download": "s32 p u16 u16 u8 p u64 p",
        "ecrt_master_sdo_download_complete": "s32 p u16 u16 p u64 p",
        "ecrt_master_sdo_upload": "s32 p u16 u16 u8 p u64 p p",
        "ecrt_master_activate": "s32 p",
        "ecrt_master_deactivate": "r p",
        "ecrt_master_set_send_interval": "s32 p u64",
        "ecrt_master_send": "r p",
        "ecrt_master_receive": "r p",
        "ecrt_master_state": "r p p",
        "ecrt_master_link_state": "s32 p u32 p",
        "ecrt_master_application_time": "r p u64",
        "ecrt_master_sync_reference_clock": "r p",
        "ecrt_master_sync_reference_clock_to": "r p u64",
        "ecrt_master_sync_slave_clocks": "r p",
        "ecrt_master_reference_clock_time": "s32 p p",
        "ecrt_master_sync_monitor_queue": "r p",
        "ecrt_master_sync_monitor_process": "u32 p",
        "ecrt_slave_config_sync_manager": "s32 p u8 u32 u32",
        "ecrt_slave_config_watchdog": "r p u16 u16",
        "ecrt_slave_config_pdos": "s32 p u32 p",
        "ecrt_slave_config_reg_pdo_entry_pos": "s32 p u8 u32 u32 p p",
        "ecrt_slave_config_dc": "r p u16 u32 s32 u32 s32",
        "ecrt_slave_config_sdo": "s32 p u16 u8 p u64",
        "ecrt_slave_config_emerg_size": "s32 p u64",
        "ecrt_slave_config_emerg_pop": "s32 p p",
        "ecrt_slave_config_create_sdo_request": "p p u16 u8 u64",
        "ecrt_slave_config_create_reg_request": "p p u64",
        "ecrt_slave_config_state": "r p p",
        "ecrt_domain_data": "p p",
        "ecrt_domain_size": "u64 p",
        "ecrt_domain_process": "r p",
        "ecrt_domain_queue": "r p",
        "ecrt_domain_state": "r p p",
        "ecrt_sdo_request_index": "r p u16 u8",
        "ecrt_sdo_request_timeout": "r p u32",
        "ecrt_sdo_request_data": "p p",
        "ecrt_sdo_request_data_size": "u64 p",
        "ecrt_sdo_request_state": "u32 p",
        "ecrt_sdo_request_read": "r p",
        "ecrt_reg_request_data": "p p",
        "ecrt_reg_request_state": "u32 p",
        "ecrt_reg_request_write": "r p u16 u64",
        "ecrt_reg_request_read": "r p u16 u64",
    }
)
NOT_IN_ALL: Final = frozenset({"ecrt_master_sync_reference_clock_to"})  # since 1.5.3
