"""The effects of a servo axis: one catalogue for laws, simulators and the gap workflow."""

from whsklearn.effects.base import PLACES, Effect, effect_names, get_effect
from whsklearn.effects.chain import ChainDeadZone, ChainLimit, ChainPlay, ChainResonance, ChainSpring, ChainTone
from whsklearn.effects.drive import ActuatorLag, DeadZone, InputDelay, InputOffset, Saturation, TorqueRipple
from whsklearn.effects.friction import (
    AsymmetricCoulomb,
    AsymmetricViscous,
    Coulomb,
    EarlyReversal,
    FrictionDrift,
    LoadFriction,
    PositionFriction,
    QuadraticDrag,
    ReducedStribeck,
    StaticEffect,
    Stribeck,
    Viscous,
)
from whsklearn.effects.hysteresis import BoucWen, GeneralizedMaxwellSlip, LuGre, PreslidingHysteresis
from whsklearn.effects.law import (
    FrictionLaw,
    as_law,
    cubic_spline_law,
    piecewise_linear_law,
    polynomial_law,
    reduced_law,
    smooth_law,
)
from whsklearn.effects.position import CableSpring, Cogging, ContactStop, EndStop, GravityImbalance, HardeningSpring
from whsklearn.effects.quantity import Quantity, Scales, choice, number
from whsklearn.effects.sensor import EncoderEccentricity, OutputDrift, OutputOffset, Quantization, SensorRectification
from whsklearn.effects.static import Hinge, LearnedTorque, NaturalSpline, Power, SpeedHinge, Tanh, TanhDifference
from whsklearn.effects.surroundings import Surroundings
from whsklearn.effects.timed import DisturbanceTone, ParameterChange
from whsklearn.effects.transmission import Backlash, FlexibleCoupling, LoadSideViscous

__all__ = [
    "PLACES", "ActuatorLag", "AsymmetricCoulomb", "AsymmetricViscous", "Backlash", "BoucWen", "CableSpring",
    "ChainDeadZone", "ChainLimit", "ChainPlay", "ChainResonance", "ChainSpring", "ChainTone", "Cogging",
    "ContactStop", "Coulomb", "DeadZone", "DisturbanceTone", "EarlyReversal", "Effect", "EncoderEccentricity",
    "EndStop", "FlexibleCoupling", "FrictionDrift", "FrictionLaw", "GeneralizedMaxwellSlip", "GravityImbalance",
    "HardeningSpring", "Hinge", "InputDelay", "InputOffset", "LearnedTorque", "LoadFriction", "LoadSideViscous",
    "LuGre", "NaturalSpline", "OutputDrift", "OutputOffset", "ParameterChange", "PositionFriction", "Power",
    "PreslidingHysteresis", "QuadraticDrag", "Quantity", "Quantization", "ReducedStribeck", "Saturation", "Scales",
    "SensorRectification", "SpeedHinge", "StaticEffect", "Stribeck", "Surroundings", "Tanh", "TanhDifference",
    "TorqueRipple", "Viscous", "as_law", "choice", "cubic_spline_law", "effect_names", "get_effect", "number",
    "piecewise_linear_law", "polynomial_law", "reduced_law", "smooth_law",
]  # fmt: skip
