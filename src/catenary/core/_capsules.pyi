"""Tables that come in capsules; private to the core."""
