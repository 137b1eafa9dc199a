# %% connect
import time

import catenary as cat

main = cat.MainDevice("eth0").open()
belt = cat.Drives(main.scan().drives, mode="csv", counts_per_turn=2**20, velocity_limit=2.0)
loop = cat.Loop(belt, period=1e-3).open()
loop.run_in_background()

# %% drive for a while
while belt.actual.position[0] < 0.5:
    with loop.update():  # counts for 0.2 s
        belt.target.velocity[:] = 1.0
    time.sleep(0.05)

# %% a program that is stuck does not keep the belt moving
while belt.actual.velocity[0] > 0.01:
    time.sleep(0.05)
print(belt.actual.position, belt.enabled)

# %% the end
main.close()  # closes the loop, too
