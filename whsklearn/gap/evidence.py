"""The thresholds of the engine, and of what all plants share.

Those that only one kind of model knows stand beside it, in `plants.servo_evidence`.  How finely a fit steps or where a
search begins is no rule: such numbers stand where they are used.
"""

from __future__ import annotations

# Above each threshold stands what it guards against and how it was found.  "blind" is `python -m benchmarks.blind`,
# "real" is `python -m benchmarks.real_axes`: both print the rates that a change of a number moves.

# Standard deviation of a Gaussian over its median absolute deviation: what "robust deviations" are counted in.
MAD = 1.4826

# --- a name ---------------------------------------------------------------------------------------

# Share of the rms drive or output: no effect below is worth a name. Surrogates of records with nothing missing leave
# 0.0037 to 0.0047 of the drive in the inverse view. The one default of every entry.
DEFAULT_TOLERANCE = 0.004
# Closure below which the name of the nearest neighbour says nothing: wrong names close 0.2 in the median ("blind").
PARTIAL = 0.3
# Multiple of what the encoder's noise leaves of own records, below which nothing is missing: five records know it to a
# tenth.
QUIET = 1.35
# Share of the floor, or of the gap before, below which a difference is rounding and no gap.
NO_GAP = 1e-3

# --- held-out blocks ------------------------------------------------------------------------------

# Parts of a record, and the share at the end of each that is held out: 60 % fit and 40 % judge, and every part of a
# record that drifts is seen by both.
PARTS, HELD_OUT = 5, 0.4
# --- one name or another --------------------------------------------------------------------------

# Delta BIC to the runner-up: "very strong" of Kass and Raftery 1995, JASA 90(430).
LEAST_MARGIN = 10.0

# --- what has no name, and what a record cannot show ----------------------------------------------

# Learned curves of one record: each is a function of one or two signals (`benchmarks.learned`).
MOST_CURVES = 2
# Share of the cross-validated power left over that a learned curve must explain (`benchmarks.learned`).
LEARNED_SHARE = 0.1
# Share of the gap in simulation that learned curves must close, or they are left out (`benchmarks.learned`).
LEARNED_CLOSURE = 0.1
# Share of effects that are not testable above which "nothing is missing" is "not testable".
MOSTLY_BLIND = 0.5

# --- what is worth the time of a joint fit ("blind") ----------------------------------------------

# --- what is read off the record itself ("blind" with quantization) -------------------------------

# Differences of sorted readings up to this times the smallest one are one step of a grid, whose median is taken: a
# difference of two steps must stay out, and digits cut off in the file move one step a little.
ONE_STEP = 1.5
# Share of a step (times the root of their number) that a difference may miss whole steps by: digits cut off.
ON_GRID = 0.02
# Share of differences that must be whole steps.
MOSTLY_ON_GRID = 0.99
# Distinct values a sample: above, each is met once and a grid is no coarser than the noise.
DISTINCT = 0.9
# Share of a step: the mean distance of readings from the grid above which the step was rounded in the file and is
# taken from the whole span. A right step leaves hundredths, a wrong one a quarter.
STEP_ROUNDED = 0.15
# Share of the sixth differences that tells the noise, and what makes up for the largest ones, which impacts and steps
# of the drive make: 1.07 for a Gaussian.
NOISE_KEPT, NOISE_MADE_UP = 0.98, 1.06

# --- what a record must have before any diagnosis (`tests/gap/test_data_check.py`, "real") --------

# s: a third of a record is lost to restarts and filters, and the rest must hold several reversals.
SHORTEST_RECORD = 3.0
FEWEST_SAMPLES = 300
# Typical steps: five samples lost are a kick of several percent of the drive in any derivative.
HOLE = 5.5
# Share of steps that may differ from the typical one by more than this share of it.
UNEVEN, UNEVEN_STEP = 0.01, 0.5
# s a sample: ten samples a period of 2 Hz.
SLOWEST_SAMPLING = 0.05
# Share of samples at which the position must change.
MOVING = 0.002
# Changes of the drive: a torque step has two.
FEWEST_CHANGES = 4
# Share of samples at an extreme that is worth a word; runs of at least so many samples count.
FLAT, FLAT_RUN = 0.02, 3
# s over which a halt at an extreme is compared with the rest of the path.
TURNING = 0.01
# Multiple of the usual change of path (this quantile of it): a turn stays below 0.6 on eight pendulum logs and, by v
# = a t, below 1; sines clipped at their median or at nine tenths reach 1.9 to 7.6 (blind records of
# `benchmarks.blind_logs`).
SHARPER, USUAL = 1.4, 0.99
# Multiple of the 0.999 quantile of second differences; how many of them a record may have.
SPIKE, SPIKES_BORNE = 60.0, 2
# Share of what is left without a delay, below which the delay of a position servo's command is believed: a delay
# trades against viscous friction (`benchmarks.real_axes --only so101`).
WORTH_A_DELAY = 0.9

# --- what a report says of places and constants; no name depends on it ----------------------------

# Level of the p-value of a place, adjusted over the signals.
PLACE_LEVEL = 0.05
# Share of the gap beyond the share of samples: below, a range is not worth a sentence.
PLACE_EXCESS = 0.08
# Level of the p-value of a constant's drift, of some twenty pairs that are looked at.
DRIFT_LEVEL = 0.02
# Share of the gap that a drifting constant must take up, and of its drift, that one signal must explain.
DRIFT_SHARE = 0.1
# Multiple of the floor: what no uncertainty of a floor explains, so that a page does not call it noise.
ABOVE_NOISE = 2.0
