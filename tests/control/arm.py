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

URDF = """<?xml version="1.0"?>
<robot name="two">
  <link name="base"/>
  <link name="upper">
    <visual><geometry><mesh filename="package://two/meshes/upper.stl"/></geometry></visual>
    <collision><geometry><mesh filename="package://two/meshes/upper.stl"/></geometry></collision>
    <inertial><origin xyz="0 0 -0.3"/><mass value="3"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <link name="lower">
    <inertial><origin xyz="0 0 -0.2"/><mass value="1"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="100" velocity="3"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="upper"/><child link="lower"/><origin xyz="0 0 -0.6"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="50" velocity="3"/>
  </joint>
</robot>
"""

SEVEN = """
<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="base" pos="0.5 -0.2 0.3" quat="0.8 0.1 -0.3 0.5">
      <freejoint name="float"/>
      <geom type="sphere" size="0.1" mass="5"/>
      <body name="torso" pos="0 0 0.2" euler="0.1 0.2 0.3">
        <joint name="waist" axis="0 0 1" ref="0.4"/>
        <geom type="sphere" size="0.1" mass="5"/>
        <body name="upper" pos="0.1 0.2 0" quat="1 0.2 0 0.4">
          <joint name="pitch" axis="0 1 0" pos="0 0 0.02" armature="0.1"/>
          <joint name="roll" axis="1 0.3 0" pos="0.01 0 0" armature="0.1"/>
          <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.04" mass="2"/>
          <body name="rail" pos="0.3 0 0.05">
            <joint name="slide" type="slide" axis="0.2 0 1" ref="0.1" armature="0.5"/>
            <geom type="sphere" size="0.04" mass="1"/>
            <body name="bracket" pos="0 0.1 0" euler="0 0.5 0">
              <geom type="sphere" size="0.03" mass="0.2"/>
              <body name="lower" pos="0.1 0 0">
                <joint name="elbow" axis="0 1 0" armature="0.1"/>
                <joint name="forearm" axis="1 0 0" armature="0.05"/>
                <geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.03" mass="1"/>
                <body name="hand" pos="0.25 0 0" quat="0.5 0.5 -0.5 0.5">
                  <joint name="wrist" axis="0 0.6 0.8" armature="0.02"/>
                  <geom type="sphere" size="0.03" mass="0.3"/>
                  <site name="grip" pos="0.05 0.01 -0.02" euler="0.3 0 0.9"/>
                </body>
              </body>
            </body>
          </body>
        </body>
      </body>
      <body name="head" pos="0 0 0.6">
        <joint name="neck" axis="0 0 1" armature="0.02"/>
        <geom type="sphere" size="0.08" mass="1"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
