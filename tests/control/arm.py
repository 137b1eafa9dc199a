"""An arm for tests: a pendulum, and three joints of a model of ours, as MJCF."""

PENDULUM = """
<mujoco>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body>
      <joint name="hinge" axis="0 1 0" armature="0.05" damping="0.3"/>
      <inertial pos="0 0 -0.5" mass="2.0" diaginertia="0.01 0.01 0.01"/>
    </body>
  </worldbody>
</mujoco>
"""

THREE = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body>
      <joint name="turn" axis="0 0 1" armature="0.2"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.05" mass="4"/>
      <body pos="0 0 0.3">
        <joint name="shoulder" axis="0 1 0" armature="0.2" range="-2 2"/>
        <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.05" mass="3"/>
        <body pos="0.4 0 0">
          <joint name="elbow" axis="0 1 0" armature="0.1"/>
          <geom type="capsule" fromto="0 0 0 0.3 0.05 0" size="0.04" mass="2"/>
        </body>
      </body>
    </body>
    <body pos="1 0 0">
      <freejoint name="ball"/>
      <geom type="sphere" size="0.1" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""
