"""Quirks: behaviour of real mailboxes and object dictionaries that differs from ETG.1000.6.

In TOML a quirk is a field of a table: `mailbox_quirks = { counter = "echoed" }`.
"""

from __future__ import annotations

from typing import Literal

import msgspec


class MailboxQuirks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Differences of one device's mailbox from the standard. The default has none."""

    # Mailbox counter in the device's messages. "echoed": that of the request, because the answer is
    # written into the request's buffer (leducp/KickCAT, lib/src/CoE/mailbox/response.cc, reply).
    # "stuck": always 1. "zero": always 0 (ethercrab-rs/ethercrab#236).
    counter: Literal["standard", "echoed", "stuck", "zero"] = "standard"

    # The length of an SDO information error does not include its abort code:
    # leducp/KickCAT, lib/src/CoE/mailbox/response.cc, SDOInformationMessage::abort.
    uncounted_aborts: bool = False

    # The list of objects ends before its last fragment. "missing": without any indication, because
    # the number of fragments is computed without the headers (leducp/KickCAT,
    # lib/src/CoE/mailbox/response.cc, fillList). "promised": the fragment is announced but never
    # sent; IgH then gives up after one second (fsm_coe.c, EC_FSM_COE_DICT_TIMEOUT).
    object_list: Literal["complete", "missing", "promised"] = "complete"

    # Objects in the list with a description that is too short to be valid. IgH (fsm_coe.c,
    # dict_desc_response) then ends the whole dictionary with "Invalid data size".
    malformed_descriptions: tuple[int, ...] = ()

    # Objects with a description that is never sent. No report is known.
    missing_descriptions: tuple[int, ...] = ()

    # Answer to every request. "unsupported": mailbox error 2, as if the SII listed CoE by mistake.
    # "short": a mailbox error without its code; no report of "short" is known.
    error_reply: Literal["none", "unsupported", "short"] = "none"

    # Each segment of an upload contains one byte. No report is known.
    drip: bool = False

    # Prefix of every name and text in the dictionary, to test how a terminal displays it.
    text_prefix: str = ""


NO_MAILBOX_QUIRKS = MailboxQuirks()
