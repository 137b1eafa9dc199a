"""Golden bytes by OMG DDS-XTypes 1.3 §7.4.3; test_file.py compares with other decoders."""

import numpy as np
import pytest

from catenary.record.cdr import CdrLayout


def test_primitives_are_aligned_after_the_encapsulation() -> None:
    layout = CdrLayout()
    layout.field("small", "|u1")
    layout.field("wide", "<f8")
    layout.field("short", "<u2")
    layout.field("word", "<u4")
    message = layout.make()
    columns = {"small": np.array([1]), "wide": np.array([1.0]), "short": np.array([2])}
    assert message.encode(columns, 1) == bytes.fromhex(
        "00010000"  # CDR, little endian
        "01 00000000000000"  # seven bytes of padding: the double starts at 8
        "000000000000f03f"
        "0200 0000"
        "00000000"
    )


def test_the_length_of_a_string_includes_the_final_zero() -> None:
    layout = CdrLayout()
    layout.text("arm")
    layout.text("")
    assert layout.make().constant[4:] == bytes.fromhex("04000000 61726d00 01000000 00")


def test_a_sequence_has_its_length_and_an_array_has_none() -> None:
    layout = CdrLayout()
    layout.sequence("sequence", "<i2", 2)
    layout.field("array", "|i1", (2,))
    message = layout.make()
    columns = {"sequence": np.array([[3, 4]]), "array": np.array([[-1, 5]])}
    assert message.encode(columns, 1)[4:] == bytes.fromhex("02000000 0300 0400 ff 05")


def test_an_empty_sequence_is_only_its_length() -> None:
    layout = CdrLayout()
    layout.sequence("none", "<f8", 0)
    layout.field("next", "<u4")
    assert len(layout.make().constant) == 4 + 4 + 4


def test_a_sequence_of_strings() -> None:
    layout = CdrLayout()
    layout.texts(["a", "bcde"])
    golden = "02000000 02000000 6100 0000 05000000 6263646500"
    assert layout.make().constant[4:] == bytes.fromhex(golden)


@pytest.mark.parametrize("count", [0, 1, 7])
def test_many_messages_are_encoded_together_and_decoded_again(count: int) -> None:
    layout = CdrLayout()
    layout.field("number", "<u4")
    layout.text("x")
    layout.sequence("values", "<f8", 3)
    message = layout.make()
    columns = {"number": np.arange(count), "values": np.arange(3.0 * count).reshape(count, 3)}
    data = message.encode(columns, count)
    back = message.decode(data)
    assert len(data) == count * len(message.constant)
    assert (back["number"] == columns["number"]).all()
    assert (back["values"] == columns["values"]).all()
