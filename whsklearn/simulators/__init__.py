"""Simulators of other tools behind the three methods that `whsklearn.gap.GapFinder` needs."""

from whsklearn.simulators.fmu import FMUSimulator
from whsklearn.simulators.mujoco import MuJoCoSimulator

__all__ = ["FMUSimulator", "MuJoCoSimulator"]
