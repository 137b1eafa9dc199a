"""`cat_link` of native/link.h for links in Python, to test compiled code on other links."""

from __future__ import annotations

import ctypes

SEND = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_uint8), ctypes.c_uint32
)
RECEIVE = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.POINTER(ctypes.c_uint8))
)
NOW = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p)
WAIT_UNTIL = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int64, ctypes.c_int)
SPEND = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_int64)

VIRTUAL_TIME, SHARED_TIME, SPENDS, POLLS, FORETELLS = 1, 2, 4, 8, 16


class Table(ctypes.Structure):
    """Fields of `cat_link`, in order."""

    _fields_ = (
        ("version", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("self", ctypes.c_void_p),
        ("send", SEND),
        ("receive", RECEIVE),
        ("now", NOW),
        ("wait_until", WAIT_UNTIL),
        ("spend", SPEND),
        ("due", NOW),
        ("fd", ctypes.c_int),
    )


def table_in(capsule: object) -> Table:
    """Return the table of a compiled link. The caller keeps its capsule."""
    pointer = ctypes.pythonapi.PyCapsule_GetPointer
    pointer.restype = ctypes.c_void_p
    pointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    return Table.from_address(pointer(capsule, b"catenary.link"))


def capsule_of(structure: ctypes.Structure, name: bytes) -> object:
    """Return a capsule for a structure. The caller keeps the structure and `name` alive."""
    new = ctypes.pythonapi.PyCapsule_New
    new.restype = ctypes.py_object
    new.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p]
    return new(ctypes.addressof(structure), name, None)
