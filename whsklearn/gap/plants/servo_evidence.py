"""Thresholds of the rules that apply only to a servo axis.

The comment above each number gives its purpose and source.  "blind" is `python -m benchmarks.blind` and "real" is
`python -m benchmarks.real_axes`; both print the rates that change with a number.
"""

from __future__ import annotations

from whsklearn.gap.calibration import least_lead
from whsklearn.gap.diagnosis import ALPHA
from whsklearn.identification.drive_lead import KNOWN as KNOWN
from whsklearn.identification.drive_lead import LATEST as LATEST
from whsklearn.identification.drive_lead import OLDEST as OLDEST

# --- how much of the motion a filter lets through ("real") ----------------------------------------

# Largest noise as a share of the gap: cogging of order 72 needs a filter that passes it (LAAS).
OF_THE_GAP = 0.2
# Largest share of the time in motion during which noise hides the direction: friction is lost at each reversal.
BLIND_SHARE = 0.03
# The sign of a velocity is unknown below so many standard deviations of its noise; for records without noise, below
# this share of the rms velocity.
NOISY, SLOW = 3.0, 0.01
# Multiple of the noise of inertia times acceleration due to the encoder: the residual of surrogates is 0.0037 to 0.0047
# of the drive while this noise alone is 0.0015 to 0.0019, because the controller also puts the noise into the drive.
DRIVE_NOISE = 2.5
# Smallest noise as a share of the encoder's step: a reading that rests on its grid shows none, and one spread evenly
# over a step shows 0.29.
GRID_AS_NOISE = 0.2
# Ratio to the previous cut-off that is worth a second pass of inverse dynamics; with every change of it, KR300 A gets a
# limit of its drive that is not there ("real").
WIDER = 1.25
# Gain per number above which numbers that a first look holds are freed, and a learned curve is better than a simpler
# one: the lead that parts two explanations at the level alpha (`whsklearn.gap.calibration.least_lead`).
PAYS = least_lead(ALPHA)

# Judged samples; with fewer, rests are used too: a record at rest has no others. Ten numbers with ten samples each.
FEWEST_JUDGED = 100

# --- limits on effects beside others, and what no axis does ---------------------------------------

# rad of travel below which the cosine of gravity is a constant and a slope to within 3 %, so that names are shared.
LITTLE_TRAVEL = 0.5
# Multiple of the median power around it from which a peak is a line of the reference, where no tone is accepted; and
# the widths, in bins (1 / duration), of the line and of its surroundings: a Hann window spreads a line over 1.5 bins
# ("real --only so101").
STANDS_OUT = 10.0
LINE, AROUND = 1.5, 12.0
# Smallest gain after a change of gain, relative to before: with 0.4 %, inertia and missing torque also fall to 0.4 %,
# which "explained" KR300 A with Coulomb friction hidden. Simulated changes keep 70 % and more.
LEAST_GAIN_LEFT = 0.1
MOST_ORDERS = 12  # of one family; each costs a scan

# --- when the ends of the travel are struck -------------------------------------------------------
# The events are the large residuals of a robust fit (`python -m benchmarks.blind_mujoco --only
# range_one,range_both,forcerange`).  Of a stop they have 0.99 of the residual's energy, and 0.8 to 1 of the outer half
# of its region is struck, of all others less than 0.15; both must be most of it.

# Robust standard deviations above which a sample is an event: stops reach 20 to 60.
STOP_FAR = 6.0
# Deviations at which a sample has half weight in the robust fit (Cauchy's weights), and above which a sample in the
# outer half of the region counts as struck.
STOP_KNEE = 3.0
# Share of the events' energy allowed outside the regions: the blur carries some to before the contact.
STOP_EDGE = 0.03

# --- effects read directly from the record ("blind" with quantization and sensor_rectification) ---

# Step of the grid as a share of half the travel, where a coarse encoder is not told by its counts: linear axes.
COARSE_GRID = 2.5e-4
# Counts a turn of the coarsest encoders that servos are sold with: 12 bits (AS5600, Dynamixel XL330), 1024 lines.
USUAL_COUNTS = 4096
# Multiple of the encoder's stated or usual step: one lost bit doubles it.
COARSER_THAN_STATED = 1.5
# Largest misfit of an unfolded reading as a share of that before: half of a folded record is on the wrong side.
UNFOLDED = 0.1
# Share of the span: how close to zero a folded reading turns.
FOLD_TURNS = 0.02
# s on either side of a turn over which slopes are computed; and the smallest such slope, as a share of the rms speed,
# because a real turn comes to rest.
FOLD_WINDOW, FOLD_SPEED = 0.006, 0.1
# --- how long a free run shows the model ("real") -------------------------------------------------

# s: the longest horizon, and those tried if it shows nothing.
LONGEST_RUN = 0.5
SHORTER_RUNS = (0.2, 0.1, 0.05, 0.02, 0.01, 0.005)
# Largest difference between a model's own motion and its smoothed version, as a share of the rms speed: impacts reach
# 0.1.
OWN_MOTION = 0.2
# Largest error on a model's own record due to the noise of the restarts, as a share of the path within a horizon.
OWN_ERROR = 0.1
# Largest deviation of a run due to a torque that is not worth naming, as a share of the path.
OFF_PATH = 0.05
# Largest mean square difference of the velocities of two smoothing windows, as a multiple of the noise variance of the
# narrower one: a larger difference is motion that the wider one smooths away (Lepski 1991).
AS_NOISE = 2.0
