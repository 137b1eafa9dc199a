"""Share that also serves requests: the public `catenary.Share`."""

from __future__ import annotations

from catenary import share


class Share(share.Share):
    """Owner of a name under which other processes find a loop, and ask for its devices."""
