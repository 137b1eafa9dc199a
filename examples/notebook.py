"""A notebook session as a script in cells. The loop runs in the background between the cells.

Open it in an editor that knows `# %%` cells, or run it: `python notebook.py eth0`, or `virtual`.
"""

# %% Connect. The last line returns at once. A Python thread then iterates the loop.
import sys

import catenary as cat

main = cat.MainDevice(sys.argv[1] if len(sys.argv) > 1 else "virtual")
main.open()
arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)  # [rad/s]
loop = cat.Loop(arm, period=1e-3).open()
loop.run_in_background()

# %% Write a consistent set of targets. They are committed together when the block ends.
with loop.update():
    arm.target.position[:] = [0.05, 0.0, 0.05]

# %% Read the latest values at any time.
print("position [rad]:", arm.actual.position)

# %% Use moves for longer distances. If you interrupt this cell, the move and the loop continue.
move = arm.move_to(0.3, velocity=0.5)
loop.wait(move, timeout=10.0)
print("reached [rad]:", arm.actual.position)

# %% Read and write objects while the loop runs.
print("device name:", arm.subs[0].sdo.read(0x1008, 0).decode())

# %% An error stops the axes and closes the loop; the next call raises it.
print("error:", loop.error)

# %% Close. The same happens at the end of a program.
loop.wait(arm.move_to(0.0, velocity=0.5))
loop.close()
main.close()
print(loop.timing)
