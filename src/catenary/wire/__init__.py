"""Conversion between bytes and frozen values, one file per chapter of the standard.

Decoders raise `DecodeError` and no other error.
"""
