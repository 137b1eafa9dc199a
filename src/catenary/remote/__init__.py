"""Requests to the program that owns a share: devices, objects, diagnosis, timing and laws.

with cat.connect("arm") as arm:
    print(arm.sdo_read(2, 0x6064).text)

The client imports neither `loop` nor `bus`. `catenary.remote.share` has the service.
"""

from catenary.remote.async_client import AsyncClient, connect_async
from catenary.remote.client import Client, connect

__all__ = ["AsyncClient", "Client", "connect", "connect_async"]
