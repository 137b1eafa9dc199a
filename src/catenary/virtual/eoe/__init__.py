"""Ethernet port of virtual devices (EoE, ETG.1000.6 §5.7), with a small IP stack and web pages."""
