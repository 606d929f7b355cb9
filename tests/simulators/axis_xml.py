"""One hinge with a motor and viscous friction, as MJCF."""

XML = """<mujoco><compiler angle="radian"/><option timestep="0.001" integrator="implicitfast" gravity="0 0 0"/>
<worldbody><body><joint name="axis" type="hinge" axis="0 -1 0" damping="0.1" {joint}/>
<inertial pos="0 0 0" mass="1" diaginertia="0.05 0.05 0.05"/></body></worldbody>
<actuator><general name="motor" joint="axis" gainprm="1"/></actuator></mujoco>"""
