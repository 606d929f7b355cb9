"""Thresholds of the rules that only a simulator of one's own knows (`whsklearn.gap.evidence` holds the engine's).

Above each stands what it guards against; `python -m benchmarks.blind_simulator` and `python -m benchmarks.mjcf_gap`
print the rates that a change of a number moves.
"""

from __future__ import annotations

# Share of the error: an effect that leaves less is fitted again under the weights of what it leaves, since before the
# weights hid the effect's own spectrum; a look that promised as much, and whose fit leaves more, is begun anew.
PROMISING = 0.5
# Such fits at most, and the share of the error that the last one leaves: a stop takes three.
AGAIN, SETTLED = 4, 0.8
# Gain of a look at an elementary law in which no derivative shows anything, and at an effect that has no column at
# all: both are ranked behind every look that shows something, and are simulated all the same.
ALWAYS_TRIED, NO_COLUMN = 1e-9, 1e-6
