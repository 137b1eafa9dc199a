"""Quirks of real mailboxes and object dictionaries: behaviour that differs from ETG.1000.6.

In TOML a quirk is a field of a table: `mailbox_quirks = { counter = "echoed" }`.
"""

from __future__ import annotations

from typing import Literal

import msgspec


class MailboxQuirks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Differences of a device's mailbox from the standard. The default has none."""

    # Mailbox counter in the messages of the device. "echoed": the counter of the request, because
    # the device writes the answer into the buffer of the request (leducp/KickCAT,
    # lib/src/CoE/mailbox/response.cc, reply). "stuck": always 1. "zero": always 0
    # (ethercrab-rs/ethercrab#236).
    counter: Literal["standard", "echoed", "stuck", "zero"] = "standard"

    # True: the length of an SDO information error does not include the abort code (leducp/KickCAT,
    # lib/src/CoE/mailbox/response.cc, SDOInformationMessage::abort).
    uncounted_aborts: bool = False

    # Fragments of the object list. "missing": the last fragment is silently missing, because the
    # number of fragments is computed without the headers (leducp/KickCAT,
    # lib/src/CoE/mailbox/response.cc, fillList). "promised": the last fragment is announced but
    # never sent. IgH then gives up after one second (fsm_coe.c, EC_FSM_COE_DICT_TIMEOUT).
    object_list: Literal["complete", "missing", "promised"] = "complete"

    # Objects whose descriptions are too short to be valid. IgH (fsm_coe.c, dict_desc_response) then
    # abandons the whole dictionary with "Invalid data size".
    malformed_descriptions: tuple[int, ...] = ()

    # Objects whose descriptions are never sent. No such device has been reported.
    missing_descriptions: tuple[int, ...] = ()

    # Answer to every CoE request. "unsupported": mailbox error 2, as if the SII listed CoE by
    # mistake. "short": a mailbox error without its code. No device with "short" has been reported.
    error_reply: Literal["none", "unsupported", "short"] = "none"

    # True: each segment of an upload contains one byte. No such device has been reported.
    drip: bool = False

    # Prefix of every name and text in the dictionary, to test how a terminal displays it.
    text_prefix: str = ""


NO_MAILBOX_QUIRKS = MailboxQuirks()
