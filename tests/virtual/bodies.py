"""Model with a free base and sensors: a box on the floor, with a lid on a hinge."""

BOX = """
<mujoco model="box">
  <worldbody>
    <geom type="plane" size="3 3 .1"/>
    <body name="trunk" pos="0 0 {height}">
      <freejoint name="base"/>
      <geom type="box" size=".1 .1 .1" mass="10"/>
      <site name="imu"/>
      <body name="lid" pos="0 0 .1">
        <joint name="hinge" axis="0 0 1"/>
        <geom type="box" size=".05 .05 .01" pos="0 0 .02" mass="1"/>
      </body>
    </body>
  </worldbody>
  <sensor>
    <framequat name="orientation" objtype="site" objname="imu"/>
    <gyro name="gyro" site="imu"/>
    <accelerometer name="acceleration" site="imu"/>
    <jointpos name="angle" joint="hinge"/>
  </sensor>
  <keyframe>
    <key name="turned" time="7" qpos="0 0 .3 .7071067811865476 0 0 .7071067811865476 .5"/>
  </keyframe>
</mujoco>
"""
MASS = 11.0  # kg
ON_THE_FLOOR = BOX.format(height=0.1)
