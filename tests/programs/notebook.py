# %% connect
import catenary as cat

main = cat.MainDevice("eth0").open()
arm = cat.Drives(main.scan().drives, counts_per_turn=2**20, velocity_limit=2.0)
loop = cat.Loop(arm, period=1e-3, log_axes=True).open()
loop.run_in_background()  # a Python thread iterates; this cell returns

# %% one consistent set of targets
with loop.update():
    arm.target.position[:] = [0.05, 0.0, 0.05]

# %% the latest values
print(arm.actual.position)

# %% a move
loop.wait(arm.move_to(0.0, velocity=0.3))
plot = loop.log.to_pandas().filter(like="shoulder").plot()

# %% the end
loop.close()  # also at interpreter exit
main.close()
