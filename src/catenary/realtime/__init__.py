"""The operating system: private networks, real-time scheduling, children. Imports no NumPy.

`private_network` runs a program in a network namespace of its own, `scheduling` asks for
real-time scheduling and says what was obtained, `child` starts programs that end with us.
"""
