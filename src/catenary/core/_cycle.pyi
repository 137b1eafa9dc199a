"""One cycle in its three orders; used by the compiled modules only."""
