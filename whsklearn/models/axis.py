"""A servo axis as physics: inertia, friction law and effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from whsklearn.effects import Effect, FrictionLaw
from whsklearn.models.base import IdentifiedModel, as_input
from whsklearn.systems import ServoAxis

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

SUBSTEPS = 4  # fine steps a sample, as the fit of an axis has them; its code then takes under 100 ns a step


@dataclass(frozen=True)
class AxisModel(IdentifiedModel):
    """Inertia dv/dt = u - law(v) - effects, in units of the logged drive (u) and output.

    Parameters
    ----------
    inertia : float
        Drive per acceleration.
    law : FrictionLaw
        Friction as a function of velocity; may be a spline over it.
    effects : tuple of Effect
        What else there is, such as `InputOffset`, `Cogging`.

    References
    ----------
    Armstrong-Helouvry, Dupont and Canudas de Wit 1994, Automatica 30(7), 1083-1138.

    Examples
    --------
    >>> from whsklearn.effects import as_law
    >>> from whsklearn.models import AxisModel
    >>> model = AxisModel(0.5, as_law("coulomb"), dt=0.001, logged="velocity")
    >>> model.simulate([0.5] * 5).tolist()  # below its friction of 1 it stands
    [0.0, 0.0, 0.0, 0.0, 0.0]
    """

    inertia: float
    law: FrictionLaw
    effects: tuple[Effect, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "effects", tuple(self.effects))
        if self.logged == "output":
            raise ValueError("logged is 'output', and an axis answers with its velocity or position; say which.")
        self.system()  # refuses what cannot be simulated

    def system(self, **changes: Any) -> ServoAxis:
        """The axis as `ServoAxis`, to simulate it in closed loop or with other parts.

        Parameters
        ----------
        **changes
            Fields of `ServoAxis` that are to be others.
        """
        return ServoAxis(
            self.inertia, self.law, self.effects, sample_rate=1.0 / self.dt, **{"substeps": SUBSTEPS, **changes}
        )

    @property
    def kind(self) -> str:
        """``axis``."""
        return "axis"

    @property
    def parameters(self) -> dict[str, float]:
        """``inertia``, the law's weights, the effects' sizes and shapes."""
        axis = self.system()
        # of the simulator, not of the axis
        left_out = ("drive__", "transmission__", "sensor__", "controller__", "smoothing")
        return {k: float(v) for k, v in axis.parameters.items() if not k.startswith(left_out)}

    def simulate(self, u: ArrayLike, *, start: float = 0.0) -> NDArray[np.float64]:
        """Output from the drive alone, from standstill; see `IdentifiedModel.simulate`.

        Parameters
        ----------
        u : array-like of shape (n,)
            Drive in the unit of the log.
        start : float, default=0.0
            Position before the first sample, in the unit of the log; effects of the position act there.
        """
        record = self.system().simulate_drive(as_input(u), initial_position=start)
        return record.position if self.logged == "position" else record.velocity
