"""Effects at ports that only a chain of blocks has: before L1, between L1 and the law, and behind L2.

On an axis a play and a coupling are between two inertias, and a limit is in the drive.  A chain has no inertia, so
there the same names stand for other equations, of the signal at the port ``at``.
"""

from __future__ import annotations

import math

from whsklearn.effects import codes
from whsklearn.effects.base import Effect
from whsklearn.effects.drive import DeadZone, Saturation
from whsklearn.effects.position import HardeningSpring
from whsklearn.effects.quantity import choice, number
from whsklearn.effects.timed import DisturbanceTone
from whsklearn.effects.transmission import Backlash, FlexibleCoupling


class ChainPlay(Effect, catalogued=False):
    """A play of width b at the input or between L1 and the law: after each reversal the signal does not follow.

    See Also
    --------
    ChainDeadZone : loses the signal by its size, not after a reversal.

    Examples
    --------
    >>> from whsklearn import WienerHammersteinSystem
    >>> from whsklearn.effects import ChainPlay
    >>> system = WienerHammersteinSystem([1.0], [], [1.0], [], "linear", effects=[ChainPlay(0.5, at="input")])
    >>> system.simulate([1.0, 0.8, 0.0, 0.0]).tolist()
    [0.0, 0.0, 0.75, 0.75]
    """

    gap: float = number(0.1, "rad", 1e-5, 1e3, log=True, span=(1e-3, 1.5), starts=(0.02, 0.05, 0.12, 0.3, 0.6))
    at: str = choice("middle", {"middle": codes.BACKLASH, "input": codes.PLAY_U})

    name = Backlash.name
    place = "transmission"
    port = "block"
    column_kind = "none"
    equation = "play of width b"
    signature = "after a reversal the signal does not move until the play is crossed"
    needs = "reversals"
    reference = Backlash.reference


class ChainResonance(Effect, catalogued=False):
    """A resonance of static gain one between L1 and the law or behind L2: a mass on a spring with its input held over a
    sample.

    See Also
    --------
    FlexibleCoupling : the same on an axis, between two inertias.

    Examples
    --------
    >>> from whsklearn import WienerHammersteinSystem
    >>> from whsklearn.effects import ChainResonance
    >>> soft = WienerHammersteinSystem([1.0], [], [1.0], [], "linear", effects=[ChainResonance(0.25, 0.1)])
    >>> round(float(soft.simulate([1.0] * 200)[-1]), 6)
    1.0
    """

    frequency: float = number(
        0.1, "Hz", 1e-3, 1e6, log=True, scale="resonance", span=(0.02, 1.96), starts=(0.16, 0.36, 0.64, 1.0, 1.5)
    )
    damping_ratio: float = number(0.1, "1", 0.002, 0.95, log=True, starts=(0.1,))
    at: str = choice("middle", {"middle": codes.FLEXIBLE_COUPLING, "output": codes.RESONANCE_Y})

    name = FlexibleCoupling.name
    place = "transmission"
    port = "block"
    column_kind = "none"
    equation = "a resonance of gain one, natural frequency f, damping zeta"
    neutral = math.inf
    signature = FlexibleCoupling.signature
    needs = FlexibleCoupling.needs
    reference = "Astrom, Wittenmark 1997, Computer-Controlled Systems, table 2.1"


class ChainTone(DisturbanceTone):
    """A tone A cos(2 pi f t + phi) that is added to the law's output, or to the input.

    See Also
    --------
    DisturbanceTone : the same where it adds to the law.

    Examples
    --------
    >>> from whsklearn import WienerHammersteinSystem
    >>> from whsklearn.effects import ChainTone
    >>> hums = WienerHammersteinSystem([1.0], [], [1.0], [], "linear", effects=[ChainTone(1.0, 0.25, at="input")])
    >>> abs(hums.simulate([0.0] * 6)).round(9).tolist()
    [0.0, 0.0, 1.0, 0.0, 1.0, 0.0]
    """

    at: str = choice("law", {"law": codes.DISTURBANCE_TONE, "input": codes.TONE_U})


class ChainLimit(Saturation):
    """A limit of the input, clip(u, -U, U), or of x between L1 and the law.

    See Also
    --------
    Saturation : the same at the input of an axis.

    Examples
    --------
    >>> from whsklearn import WienerHammersteinSystem
    >>> from whsklearn.effects import ChainLimit
    >>> cut = WienerHammersteinSystem([1.0], [], [1.0], [], "linear", effects=[ChainLimit(0.5, at="middle")])
    >>> cut.simulate([1.0, 0.3, 0.0, 0.0]).tolist()
    [0.0, 0.0, 0.5, 0.3]
    """

    at: str = choice("input", {"input": codes.SATURATION, "middle": codes.SATURATION_X})


class ChainDeadZone(DeadZone):
    """A dead zone of the input, u - clip(u, -d, d), or of x between L1 and the law.

    See Also
    --------
    DeadZone : the same at the input of an axis.

    Examples
    --------
    >>> from whsklearn import WienerHammersteinSystem
    >>> from whsklearn.effects import ChainDeadZone
    >>> dead = WienerHammersteinSystem([1.0], [], [1.0], [], "linear", effects=[ChainDeadZone(0.5, at="middle")])
    >>> dead.simulate([1.0, 0.3, 0.0, 0.0]).tolist()
    [0.0, 0.0, 0.5, 0.0]
    """

    at: str = choice("input", {"input": codes.DEAD_ZONE, "middle": codes.DEAD_ZONE_X})


class ChainSpring(HardeningSpring):
    """A spring c (x - x_0)^3 that adds to the law, or that acts on the mass that L1 represents: it is then subtracted
    from the input.

    With the second, L1 linear behind u - c x^3 is Duffing's oscillator: the input is held over a sample, and the force
    changes with x (`whsklearn.systems.chain.held_pull`).

    See Also
    --------
    HardeningSpring : the first form.

    Examples
    --------
    >>> from whsklearn import WienerHammersteinSystem
    >>> from whsklearn.effects import ChainSpring
    >>> spring = ChainSpring(0.5, at="input")
    >>> mass = WienerHammersteinSystem([1.0], [-0.5], [1.0], [], "linear", effects=[spring])
    >>> round(float(mass.simulate([1.0] * 200)[-1]), 6)  # x = 2 (u - x^3 / 2)
    1.0
    """

    at: str = choice("law", {"law": codes.HARDENING_SPRING, "input": codes.SPRING_U})


CHAIN_FORMS: dict[str, type[Effect]] = {
    c.name: c for c in (ChainPlay, ChainResonance, ChainTone, ChainLimit, ChainDeadZone, ChainSpring)
}
