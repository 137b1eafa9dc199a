"""Quirks: behaviour of real mailboxes and object dictionaries that differs from ETG.1000.6.

In TOML a quirk is a field of a table: `mailbox_quirks = { counter = "echoed" }`.
"""

from __future__ import annotations

from typing import Literal

import msgspec


class MailboxQuirks(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Differences of one device's mailbox from the standard. Without arguments: none."""

    # Mailbox counter of what the device sends. "echoed": that of the request, because the answer is
    # written into the request's buffer (leducp/KickCAT, lib/src/CoE/mailbox/response.cc, reply).
    # "stuck": always 1. "zero": always 0 (ethercrab-rs/ethercrab#236).
    counter: Literal["standard", "echoed", "stuck", "zero"] = "standard"

    # The abort code of SDO information follows the message and is not counted in its length:
    # leducp/KickCAT, lib/src/CoE/mailbox/response.cc, SDOInformationMessage::abort.
    uncounted_aborts: bool = False

    # The list of objects ends before its last fragment. "missing": nothing shows it, because the
    # number of fragments is computed without the headers (leducp/KickCAT,
    # lib/src/CoE/mailbox/response.cc, fillList). "promised": the fragment is announced and never
    # sent; IgH gives up after a second then (fsm_coe.c, EC_FSM_COE_DICT_TIMEOUT).
    object_list: Literal["complete", "missing", "promised"] = "complete"

    # Objects in the list with a description that is too short to be one. IgH (fsm_coe.c,
    # dict_desc_response) ends the whole dictionary with "Invalid data size" there.
    malformed_descriptions: tuple[int, ...] = ()

    # Objects with a description that is never sent. No report is known.
    missing_descriptions: tuple[int, ...] = ()

    # Answer to every request. "unsupported": mailbox error 2, as if the SII had CoE by mistake.
    # "short": a mailbox error without its code. No report is known of "short".
    error_reply: Literal["none", "unsupported", "short"] = "none"

    # Each segment of an upload carries one byte. No report is known.
    drip: bool = False

    # Put before every name and text that the dictionary sends, to show what a terminal makes of it.
    text_prefix: str = ""


NO_MAILBOX_QUIRKS = MailboxQuirks()
