"""Conversion between bytes and frozen values, one module per chapter of the standard.

Decoders raise only `DecodeError`.
"""
