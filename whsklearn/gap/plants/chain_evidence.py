"""Thresholds of the rules that only a chain of blocks knows (`whsklearn.gap.evidence` holds those of the engine).

They differ from a servo axis's since all that is judged is a one-step error, white under the right model, of records of
some thousand samples, whose outliers are the samples on the wrong side of a reversal.  Above each stands what it guards
against and how it was found; "chains" is `python -m benchmarks.blind_blocks`, which prints the rates that a change of a
number moves.
"""

from __future__ import annotations

from whsklearn.gap.evidence import MAD as MAD  # for the modules of this plant
from whsklearn.gap.evidence import MOST_REFINED, Limits

# One-step errors with outliers capped, white under the right model, so no share of n is asked beyond BIC's own; 30 is
# three times "very strong" and twice what the best of 34 candidates reached on 60 records with nothing missing
# ("chains --none 60").  A record of 1800 samples in five held-out blocks cannot show an effect of 2 % in four of
# them, so half must do.  A fit costs a tenth of a second: all looks are fitted even at the floor.  With two, two
# right names of 62 were lost ("chains --first-seed 300000"); with seven none of 60 empty records has a name and CPU
# seconds are the same ("chains --named 2 --none 60 --samples 1500 --first-seed 410000").
CAPPED = Limits(per_sample=0.0, least=30.0, most=30.0, over_chance=2.0, price=1.0, blocks=0.5, few_refined=MOST_REFINED)

# --- what is left ---------------------------------------------------------------------------------

# p-value of generic functions below which a finished model leaves something: 0.03 of 300 empty chains.
LEFT_OVER = 1e-4
# The same while searching: another round costs seconds, a missed effect a name.
STILL_LEFT = 2e-3
# Share of the mean square that they must then explain: long records make any trifle significant.
LEFT_SHARE = 0.02
# p-values at which what is left follows the motion, and at which it may do so.
FOLLOWS_SURE, FOLLOWS_LIKELY = LEFT_OVER, 0.05
# Share of the gap that it must be if it only may: guards "foreign effect not confidently named" ("chains").
FOLLOWS_MUCH = 0.1
# Share of the gap's mean square that generic functions are believed to take at most: some noise there always is.
MOST_FOLLOWS = 0.99
# Share of what the effects leave, below which more orders and a free law show that the base model is too small and no
# effect is missing. A second effect beside a named one is imitated by them too, but rarely to a half ("chains --pair
# 20"); the WH2009 circuit under orders of two ends at 0.2.
TOO_SMALL = 0.5
# Share of the mean square that orders, or a law, must take off to be put down to them in a sentence.
SPOKEN_OF = 0.2

# --- what a look tells ----------------------------------------------------------------------------

# Independent places that a scan looks at, by what it finds: orders of x from 0.25 to 20, frequencies, times of a
# change.
PLACES = {"": 1, "position": 20, "time": 2000, "step": 40}
# Share of a signature that the model's own numbers must leave over: below, no record shows the effect.
ABSORBED = 0.02
# The same below which a signature is rounding and gets no score.
NOTHING_LEFT = 1e-4
# Share of the size it was tried at that a look must ask for: what should shrink to a twentieth should be gone.
ASKS_FOR = 0.05
# Coherence of two signatures beyond the model's own numbers from which on the names are aliases.
SAME_SIGNATURE = 0.97
# Delta BIC that a linear look must promise: what it sees is a lower bound, a refit gains more.
LITTLE_PROMISE = -5.0
# Below that a refit of a few steps tells enough.
MODEST_PROMISE = 15.0
# Best scores of one way of looking that become looks: as many as are refined.
LOOKS_OF_ONE_KIND = MOST_REFINED
# Samples: names of a longer record are looked for in the first ones; time only.
LONG_RECORD, SEARCHED = 12_000, 8_000

# --- chance: samples on the wrong side of a sign --------------------------------------------------

# What one sample can cost at the most, in variances: on the wrong side of a reversal it costs the sign's height.
CAP = 16.0
# Robust deviations: beyond, a sample is on the wrong side of a sign; of 1e6 Gaussian ones none is.
WRONG_SIDE = 6.0
# The same beyond which a sample is left out of the test of whiteness: of 1e5 Gaussian ones one is, and beside a
# missed reversal several errors in a row are large, which would pass for colour.
OUTLIER = 4.5
# The same to which held-out errors are held, so that no block is one sample.
HELD_TO = 4.0
# Multiple of the evidence that a name needs: no chance and no other minimum of the base reached it.
BEYOND_DOUBT = 10.0
# Samples, or reversals, that may come right by chance; evidence that sits in them is none.
FEW_EVENTS = 5
# Share of the evidence a name needs that must be there without the five best samples.
WITHOUT_FEW = 0.5
# Samples for which L2 remembers a sign: a pole at 0.8 leaves a sixth of it.
SIGN_REMEMBERED = 8
# Share of the held-out mean square of the free run: above, an effect makes the model worse.
RUNS_WORSE = 1.01

# --- the base model's minima ----------------------------------------------------------------------

# Multiple of the least sum of squares up to which another minimum of the base may hold the truth.
OTHER_MINIMUM = 4.0
# Share of the sum of squares that blocks fitted anew must leave, or the refit from the base model stands.
BETTER_ANEW = 0.98

# --- what is read off the readings ----------------------------------------------------------------

# Confidence of what is seen in the readings and needs no inference: a grid, a lost sign.
GRID_SEEN, SIGN_SEEN = 0.95, 0.99
# Share of the sum of squares that an unfolded reading may leave: a fold turns half of the output over.
SIGN_LOST = 0.5
# Fraction of a fold from which it may stand at the end of its range: the whole sign is lost, which is physical.
WHOLE_FOLD = 0.5
# Share of the rms: a folded signal passes zero, one with an offset need not.
TOUCHES_ZERO = 0.02
# Share of the output's rms in rounding errors: a finer grid is a converter's, and no effect.
COARSE_READING = 0.003
# Share of the errors' mean square that rounding must make up to be told.
ROUNDING = 0.15

# --- what a record must have (`tests/gap/plants/test_chain_check.py`) -----------------------------

# Samples: some twenty numbers are fitted to 60 % of them.
FEWEST = 400
# Share of samples at which input or output may repeat the one before: a record held longer shows a constant.
STANDING = 0.98
# Share of samples at an extreme above which the output is clipped, and the distinct values without which it is a
# signal of a few levels and not a clipped one.
CLIPPED, LEVELS = 0.02, 50
# Multiple of the 0.99 quantile of the distance from the median: beyond is an outlier of the file.
FAR = 40.0
