"""Bytes ↔ frozen values, one file per chapter of the standard. Decoders raise `DecodeError`."""
