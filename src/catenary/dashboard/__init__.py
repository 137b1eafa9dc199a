"""Operator's page: an HTTP server for browsers, which attaches to the share of a running loop.

`catenary dashboard` is its command. The server reads cycles and events from the share. It requests
everything else from the program of the loop through `catenary.remote`. It never uses the bus.
"""

from __future__ import annotations
