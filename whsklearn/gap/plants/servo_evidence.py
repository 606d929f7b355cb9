"""Thresholds of the rules that only a servo axis knows (`whsklearn.gap.evidence` holds those of the engine).

Above each stands what it guards against and how it was found.  "blind" is `python -m benchmarks.blind`, "real" is
`python -m benchmarks.real_axes`: both print the rates that a change of a number moves.
"""

from __future__ import annotations

import numpy as np

from whsklearn.gap.evidence import MAD as MAD  # for the modules of this plant

# --- which view is to be trusted ("real", "blind") ------------------------------------------------

# Share of the rms drive that a model may leave for the torque it predicts to stand for the drive.
DRIVE_KNOWN = 0.35

# --- how much of the motion a filter lets through ("real") ----------------------------------------

# Share of the rms drive that noise may make behind any filter.
LARGEST_FLOOR = 0.1
# Share of the gap that noise may make: cogging of order 72 needs a filter that lets it through (LAAS).
OF_THE_GAP = 0.2
# Share of the time, in motion, in which noise may hide the direction: each reversal costs friction.
BLIND_SHARE = 0.03
# Standard deviations of the velocity's noise below which its sign is not known; of the rms velocity, the same for
# records without noise.
NOISY, SLOW = 3.0, 0.01
# Multiple of what the encoder's noise makes of inertia times acceleration: surrogates leave 0.0037 to 0.0047 of the
# drive where that alone would make 0.0015 to 0.0019, since the controller puts the noise into the drive as well.
DRIVE_NOISE = 2.5
# Share of the encoder's step that counts as its noise at least: a reading that rests on its grid shows none, one
# spread evenly over a step 0.29.
GRID_AS_NOISE = 0.2
# Cut-off over the one before that is worth a second pass of inverse dynamics.
WIDER = 1.25
# Samples of age of the drive that are bookkeeping: a drive held over a sample is half a sample old, a logger may add
# one.
LATEST = 1.5
# Gain a number, above which numbers that a first look holds are set free: 2 ln(1 / alpha) at one percent.
PAYS = 9.2
# s: the oldest drive of a real log (pendulum rigs and arms reach -0.016 to 0.038 s)
OLDEST = 0.06
# Moves of a drive that was logged late: the first finds half of 16 ms, the third all.
MOST_MOVES = 6

# Judged samples for each block of cross-validation, or rests are not left out: a record at rest has no others.
FEWEST_A_BLOCK = 10

# --- how many places a look has looked at ("blind") -----------------------------------------------

# --- what an effect may be beside others, and what no axis does -----------------------------------

# Share of the rms left beside a play that a further effect must explain: impacts follow everything a little ("blind
# --kinds named" with backlash).
BESIDE_A_PLAY = 0.66
# Share of the evidence for a name that the first steps of a two-mass refit must have earned to go on ("blind").
HALF_WAY = 0.5
# rad of travel, over which a wave of one shaft must come back every turn.
SEVERAL_TURNS = 6 * np.pi
# rad, over which the cosine of gravity is a constant and a slope to 3 % of itself: names are shared.
LITTLE_TRAVEL = 0.5
# Multiple of the median power around it that makes a line of a reference, on which no tone is believed; and how far
# (in bins, 1 / duration) the line and what is around it reach: a Hann window spreads a line over 1.5 bins ("real
# --only so101").
STANDS_OUT = 10.0
LINE, AROUND = 1.5, 12.0
# Shares of the drive above which an effect that acts on it explains it by itself (SO-101: a ripple of 1 "closed"
# all).
LARGEST_SHARE = {"torque_ripple": 0.5, "load_friction": 0.75}
# Rms drives above which a torque only cancels another of the model: a pendulum that swings freely has 15 of gravity.
AGAINST = 100.0
# Share of its effect that a drive must keep when its gain changes: with 0.4 % of it left, inertia and missing torque
# fall to 0.4 % too, and "explained" KR300 A with Coulomb friction hidden. Drawn changes leave 70 % and more.
LEAST_GAIN_LEFT = 0.1
# rad a rad: an encoder error steeper than that would let the reading stand still.
STEEPEST_ERROR = 0.3
# Cross-validated evidence for one more order of a family (three numbers): LAAS earns eight, blind records with one
# order none. And the most orders of one family.
ORDER_NEED, MOST_ORDERS = 20.0, 12
# Multiple of the gain of the best whole order that a fractional one must have: teeth and poles are whole.
WHOLE_ORDER = 1.1
# Share of the largest height: a hill below is left out of a learned curve, its torque is below the band.
HILL_DROPPED = 0.02

# --- when the ends of the travel are struck -------------------------------------------------------
# The events are what a robust fit of the model leaves (`python -m benchmarks.blind_mujoco --only
# range_one,range_both,forcerange`).  Each number lies far from both sides.

# Robust standard deviations from which a sample is an event: stops reach 20 to 60.
STOP_FAR = 6.0
# The same at which a sample weighs half in the robust fit (Cauchy's weights), and beyond which one in the deeper half
# of the region counts as struck.
STOP_KNEE = 3.0
# Share of what is left that the events at the ends must hold: stops 0.99.
STOP_ENERGY = 0.8
# Share of the time at most: stops 0.02 to 0.06, saturation 0.78, backlash 0.94.
STOP_TIME = 0.25
# Share of the events at one end that push back: stops 0.97 to 1, saturation and backlash 0.5.
STOP_SIGN = 0.9
# Share of the deeper half of the region that must be struck: stops 0.8 to 1, all others below 0.15.
STOP_STRUCK = 0.7
# Share of the events' energy left outside the region: the blur carries some to before the contact.
STOP_EDGE = 0.03
# Share of the events' energy, below which an end has no stop.
STOP_MINOR = 0.05

# --- what is read off the record itself ("blind" with quantization and sensor_rectification) ------

# Confidence of what is seen in the readings and needs no inference: a grid, a lost sign.
GRID_SEEN, SIGN_SEEN = 0.95, 0.99
# Gap over floor up to which an encoder's grid explains all that is left.
NEAR_GRID = 1.3
# Step of the grid as a share of half the travel; finer ones are any encoder's.
COARSE_GRID = 2.5e-4
# Multiple of the encoder's stated step: one lost bit is twice.
COARSER_THAN_STATED = 1.5
# Share of the noise that the grid's rounding must make up.
GRID_NOISE = 0.7
# Share of the misfit that an unfolded reading may leave: half of a folded record is on the wrong side.
UNFOLDED = 0.1
# Share of the span: how far below zero a folded reading may lie, how far above its least value may, and how near zero
# it turns.
FOLD_BELOW, FOLD_ABOVE, FOLD_TURNS = 0.002, 0.01, 0.02
# s on either side of a turn over which slopes are taken; of the rms speed, the least of these slopes; and the ratios
# of the two that are one slope turned over: a real turn comes to rest.
FOLD_WINDOW, FOLD_SPEED, FOLD_RATIO = 0.006, 0.1, (0.4, 2.5)
# --- how long a free run shows the model ("real") -------------------------------------------------

# s: the longest horizon, and those tried where it shows nothing.
LONGEST_RUN = 0.5
SHORTER_RUNS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
# Share of the rms speed that a model's own motion may differ from its smoothed self: knocks reach 0.1.
OWN_MOTION = 0.2
# Share of the path of a horizon that a model may miss of its own record by the noise of the restarts.
OWN_ERROR = 0.1
# Share of the path that a run may leave by a torque that is worth no name.
OFF_PATH = 0.05
# Multiple of the variance of the narrower window's noise that the velocities of two smoothing windows may differ by:
# more is motion that the wider one smooths away (Lepski 1991).
AS_NOISE = 2.0
