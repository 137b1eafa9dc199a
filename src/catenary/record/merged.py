"""Metadata of a merged recording: the layout of each share, and the end of each recording."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from catenary.errors import RecordingError
from catenary.record.channels import FORMAT, SECOND_NS, ros_name
from catenary.record.layout import Layout
from catenary.record.mcap_records import END_RECORD

MERGED_RECORD = "catenary.merged"  # metadata of a merged file; the keys are names of shares


class MergedShare(msgspec.Struct, frozen=True):
    """A share of a merged recording.

    Args:
        file: name of the file that was merged.
        offset: time that was added to its times [s].
        layout: layout of its cycles.
        format: version of its channels.
    """

    file: str
    offset: float
    layout: Layout
    format: str = FORMAT

    @property
    def merged_layout(self) -> Layout:
        """Layout with the difference from UTC after the merge."""
        offset_ns = self.layout.utc_offset_ns + round(self.offset * SECOND_NS)
        return msgspec.structs.replace(self.layout, utc_offset_ns=offset_ns)


def end_record(name: str) -> str:
    """Return the name of the metadata with the end of a share's recording."""
    return f"{END_RECORD}/{name}"


def select(shares: Mapping[str, str], share: str | None, file: str) -> tuple[str, MergedShare]:
    """Return the name and the description of a share.

    Args:
        shares: content of MERGED_RECORD.
        share: name of the share; None if it was not given.
        file: name of the file, for errors.

    Raises:
        RecordingError: No share was given, or the file does not contain it.
    """
    name = "" if share is None else ros_name(share)
    if name in shares:
        return name, msgspec.json.decode(shares[name], type=MergedShare)
    what = "contains" if share is None else f"has no share {share!r}, but"
    names = list(shares)
    raise RecordingError(
        f"{file} {what} several shares: {', '.join(names)}",
        hint=f'select one: record.read(file, share="{names[0]}"), '
        f"or catenary plot FILE --share {names[0]}",
    )
