"""Catenary: real-time EtherCAT for Python."""
