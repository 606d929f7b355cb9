"""The numbering of the effects on which compiled functions switch, because they cannot hold Python objects.

A compiled function takes an effect as a row: its code here and its `Effect.row` of numbers.
"""

from __future__ import annotations

N_NUMBERS = 8  # numbers in a row; the last one of a user-defined effect selects its function
N_SHAPE = 3  # shape numbers of a static term

# static terms f(x, dx) of a law; those up to POSITION_FRICTION hold the sign of dx
VISCOUS = 0
COULOMB = 1
ASYMMETRIC_COULOMB = 2
ASYMMETRIC_VISCOUS = 3
STRIBECK_EXP = 4
POSITION_FRICTION = 5
TANH = 6
TANH_DIFFERENCE = 7
STRIBECK_TANH = 8
QUADRATIC_DRAG = 9
POWER = 10
HINGE = 11
CONSTANT = 12
NATURAL_SPLINE = 13
SPEED_HINGE = 14

# basis functions of a learned curve
LEARNED_POSITION = 90
LEARNED_SPEED = 91
LEARNED_FRICTION = 92
LEARNED_DAMPING = 93
LEARNED_VELOCITY = 94
LEARNED_DRIVE = 95

# torques that are not static terms
LOAD_FRICTION = 100
FRICTION_DRIFT = 101
INPUT_OFFSET = 102
TORQUE_RIPPLE = 103
COGGING = 104
DEAD_ZONE = 105
SATURATION = 106
CHANGE_INERTIA = 107
CHANGE_VISCOUS = 108
CHANGE_COULOMB = 109
CHANGE_GAIN = 110

# torques on the load's side of a transmission
GRAVITY_IMBALANCE = 120
CABLE_SPRING = 121
HARDENING_SPRING = 122
END_STOP = 123
DISTURBANCE_TONE = 124
END_STOP_UPPER = 125
END_STOP_LOWER = 126
LOAD_VISCOUS = 127

# torques with a memory of the path
DAHL = 130
LUGRE = 131
MAXWELL_SLIP = 132
BOUC_WEN = 133

# the drive's timing and the transmission
INPUT_DELAY = 140
ACTUATOR_LAG = 141
BACKLASH = 142
FLEXIBLE_COUPLING = 143

# how dry friction reverses
EARLY_REVERSAL = 144

# the sensor
OUTPUT_OFFSET = 150
OUTPUT_DRIFT = 151
SENSOR_RECTIFICATION = 152
ENCODER_ECCENTRICITY = 153
QUANTIZATION = 154

# ports that only a chain of blocks has
PLAY_U = 160
RESONANCE_Y = 161
TONE_U = 162
SATURATION_X = 163
DEAD_ZONE_X = 164
SPRING_U = 165

# user-defined effects, by port
USER_TORQUE = 200
USER_OUTPUT = 201
