"""Records of an arm behind the filters of a `RigidBodyLags`: their rows, and more columns at these rows."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils.validation import check_array

from whsklearn.effects.base import Array
from whsklearn.filtering.records import Motion, central_difference, zero_phase
from whsklearn.lags.axis_rows import experiments, stack_columns
from whsklearn.systems.arm import direction_of

ABRUPT = 1e-12, 0.0  # rad/s and s: a reversal at rest and at once


@dataclass
class ArmRows:
    """Whole records, one after the other; filters and memories begin anew at each."""

    lags: Any  # a `RigidBodyLags`, which makes them
    position: Array  # (n, n_joints), as measured, and so are the drives
    drive: Array
    groups: Any  # (n,): marks experiments, or None
    phi: Array  # (m, n_joints, n_columns)
    target: Array  # (m, n_joints): drives
    keep: NDArray[np.bool_]  # (m, n_joints): rows that count: those of fast joints
    moved: Motion  # of all samples behind the finer filter, (n, n_joints) each
    kept: NDArray[np.int64]  # (m,): samples of the rows

    @cached_property
    def weights(self) -> Array:
        """Weights of the joints, (n_joints,): see `RigidBodyLags.joint_weights`."""
        return self.lags.joint_weights(self.phi, self.target, self.keep)

    @cached_property
    def smooth(self) -> Array:
        """The drives behind the finer filter, (n, n_joints)."""
        return self.fine(self.drive)

    def fine(self, drive: Array) -> Array:
        """Any drives behind the finer filter, (n, n_joints)."""
        return self.of_each(lambda u: zero_phase(u, self.lags.sample_rate, self.lags._fine), drive)

    def of_each(self, function: Callable[..., Array], *signals: Array) -> Array:
        """Results of a function for every record, one after the other."""
        pieces = experiments(self.groups, len(self.position))
        return np.concatenate([function(*(x[s] for x in signals)) for s in pieces])

    def blur(self, x: Array) -> Array:
        """Signals of all samples, shape (n, ...), filtered and taken at the rows."""
        return self.of_each(self.lags._filtered, x)[self.kept]

    def with_columns(self, *more: Array) -> ArmRows:
        """The same rows with more columns, (m, n_joints, k) each."""
        own = {f.name: getattr(self, f.name) for f in dataclasses.fields(ArmRows)}
        return ArmRows(**own | {"phi": np.concatenate([self.phi, *more], axis=2)})

    def axis_columns(
        self, axis: str, terms: Sequence[Any], reversal: tuple[float, float] | None = None, drive: Array | None = None
    ) -> Array:
        """Columns of effects along an axis, (m, k).

        ``reversal``: how dry friction reverses there, the speed and the lead as in ``reversals`` of `RigidBodyLags`.
        ``drive`` (n, n_joints): of which effects are functions; as measured if not given.
        """
        d, rate = direction_of(self.lags.arm_.joints, axis), self.lags.sample_rate
        turns = {axis: reversal} if reversal else self.lags.reversals

        def made(u: Array, *signals: Array) -> Array:
            moved = Motion(*signals)
            return stack_columns(tuple(terms), moved, u, np.arange(len(u)) / rate, turning(turns, [axis], moved))[:, 1:]

        smooth = self.smooth if drive is None else self.fine(drive)
        return self.blur(self.of_each(made, smooth @ d, *(x @ d for x in self.moved)))

    def predicted(self, theta: Array) -> Array:
        """Drives for these weights of the columns, before the filter, (n, n_joints)."""
        parts = self.of_each(lambda u, *moved: self.lags.drives(Motion(*moved), u, theta), self.smooth, *self.moved)
        return np.asarray(parts)

    def per_age(self, theta: Array, order: int = 1) -> Array:
        """Change of each joint's drive per second of its age, (m, n_joints), or its derivative of a higher order.

        It is that of the drive that these weights predict, because a measured one would explain its own noise.
        """

        def change(u: Array) -> Array:
            u = self.lags._filtered(u)
            for _ in range(order):
                u = central_difference(u, self.lags.sample_rate)
            return u

        return self.of_each(change, self.predicted(theta))[self.kept]


def records_of(lags: Any, X: ArrayLike, y: ArrayLike, groups: ArrayLike | None = None) -> ArmRows:
    """Whole records behind the filters: their unweighted rows, and the motion from which they are computed.

    The arguments are those of `RigidBodyLags.rows`, and so are the errors.
    """
    X = np.asarray(check_array(X, dtype=np.float64))
    lags.fit(X)
    target = lags._checked_drives(y, len(X))
    drive, pieces = lags._drive(X, target), list(experiments(groups, len(X)))
    position = X[:, : lags.arm_.n_joints]
    longest = position[max(pieces, key=lambda s: s.stop - s.start)]
    if len(pieces) > 1 and lags.cutoff is None:
        lags._set_cutoff(lags._cutoff_of(longest, len(X)))
    along = [lags._columns_along(X[s], drive[s]) for s in pieces]
    moved = Motion(*map(np.concatenate, zip(*(one for _, one in along), strict=True)))
    limits = lags._limits(longest, moved.velocity)
    each = [lags._seen(*one, target[s], limits) for one, s in zip(along, pieces, strict=True)]
    phi, filtered, keep = map(np.concatenate, zip(*each, strict=True))
    kept = np.concatenate([lags.samples_of(s.stop - s.start) + s.start for s in pieces])
    return ArmRows(lags, position, target, groups, phi, filtered, keep, moved, kept)


def turning(reversals: Mapping[str, tuple[float, float]] | None, axes: Sequence[str], along: Motion) -> Array | None:
    """Whose tanh is the sign of dry friction, for the motions along these axes one after the other; see `reversals`."""
    if not reversals:
        return None
    each = [reversals.get(axis, ABRUPT) for axis in axes]
    speed, lead = np.repeat(each, along.velocity.size // len(axes), axis=0).T
    return np.asarray((along.velocity + lead * along.acceleration) / speed)
