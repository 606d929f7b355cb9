"""Position, velocity and acceleration from a measured position: of whole records, and of streams."""

from whsklearn.filtering.records import Motion, central_difference, decimate, motion, velocity_noise, zero_phase
from whsklearn.filtering.streams import causal_cutoff, causal_delay, causal_kernels, causal_motion, causal_window

__all__ = [
    "Motion", "causal_cutoff", "causal_delay", "causal_kernels", "causal_motion", "causal_window",
    "central_difference", "decimate", "motion", "velocity_noise", "zero_phase",
]  # fmt: skip
