"""A notebook session, as a script in cells: the loop runs in the background between them.

Open it in an editor that knows `# %%` cells, or run it: `python notebook.py eth0`, or `virtual`.
"""

# %% Connect. The last line returns at once: from now on a Python thread iterates the loop.
import sys

import catenary as cat

main = cat.MainDevice(sys.argv[1] if len(sys.argv) > 1 else "virtual")
main.open()
arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)  # [rad/s]
loop = cat.Loop(arm, period=1e-3).open()
loop.run_in_background()

# %% One consistent set of targets: it is committed when the block ends, or not at all.
with loop.update():
    arm.target.position[:] = [0.05, 0.0, 0.05]

# %% The latest values, at any time.
print("position [rad]:", arm.actual.position)

# %% Longer ways are moves. Interrupt this cell, and the move goes on: the loop does not stop.
move = arm.move_to(0.3, velocity=0.5)
loop.wait(move, timeout=10.0)
print("there [rad]:", arm.actual.position)

# %% Objects are read and written while the loop runs.
print("device name:", arm.subs[0].sdo.read(0x1008, 0).decode())

# %% An error stops the axes and closes the loop; the next call raises it.
print("error:", loop.error)

# %% The end. A program that ends does the same by itself.
loop.wait(arm.move_to(0.0, velocity=0.5))
loop.close()
main.close()
print(loop.timing)
