"""The soak: random faults in virtual time against a running loop, and what must hold meanwhile.

cell: the machine. faults: incidents drawn by chance. effects: what each does to whom. injected:
what was on when. witness: the invariants. objects: what is read meanwhile. minute: the application.
run: all minutes, and what is printed.
"""
