"""AoE as a mailbox protocol of a virtual device."""

from __future__ import annotations

from catenary.virtual.aoe.options import AdsOptions, content_of, group_of
from catenary.virtual.aoe.server import AdsServer
from catenary.virtual.protocols import Surroundings


class Ads(AdsOptions, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """ADS device in a virtual device, for AoE: `Servo(protocols=[Ads(areas={0x4020: 64})])`."""

    @property
    def number(self) -> int:
        """Type of AoE in the mailbox header."""
        return 1

    def start(self, surroundings: Surroundings) -> AdsServer:
        """Make the server. Called at each start of the device."""
        areas = {group_of(group): content_of(each) for group, each in self.areas.items()}
        return AdsServer(self, areas, surroundings)
