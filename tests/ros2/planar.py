"""MJCF of an arm of two axes in a plane."""

PLANAR = """
<mujoco>
  <worldbody>
    <body>
      <joint name="a" axis="0 0 1"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.02" mass="1"/>
      <body pos="0.4 0 0">
        <joint name="b" axis="0 0 1"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="1"/>
        <site name="tip" pos="0.3 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
