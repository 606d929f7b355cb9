"""A full memory re-run in parts while the next samples come, so that none of them has to wait.

A full memory is a page.  It is re-run during the half page of samples that follows, a few
dozen samples read for each that comes; the models it gives then catch up with what came
meanwhile and take over at a fixed sample.  What they are is a function of the page and of
the samples up to there alone: how the work was divided makes no difference, and it can
begin anew at any time, so it is no part of the state.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from whsklearn.recursion.consolidation import refine_part
from whsklearn.recursion.replay import AT, BUDGET, PHASE, UNBOUNDED, work_size
from whsklearn.recursion.rerun import (
    LADDER,
    adopted,
    best_first,
    climb_to,
    inference_sharpness,
    left_of_prior,
    rerun_in_parts,
    weights_of,
)
from whsklearn.recursion.subinnovations import MOVING, STILL, relative_sharpness, run_windows

if TYPE_CHECKING:
    from collections.abc import Iterator

    from whsklearn.recursion.reading import Reading, State

READ_PER_SAMPLE = 64  # a page takes 22 readings at most: with 64 it is done after seven tenths of the half page
COST_OF_WINDOW = 8  # readings that one sample of the recursion counts for


def shift_memory(state: State, r: Reading, n: int) -> None:
    """Drop the oldest ``n`` samples, but for the history that the next one needs; a new block begins."""
    h, rest = r.history, state["fill"] - n
    for name, before in (
        ("memory_u", h), ("memory_y", h), ("memory_restart", 0), ("memory_still", 0), ("memory_idle", 0),
        ("memory_kept", 0),
    ):  # fmt: skip
        state[name][: before + rest] = state[name][n : n + before + rest].copy()
        state[name][before + rest :] = name == "memory_kept"
    state["fill"] = rest
    state["blocks"] += 1


class PageRerun:
    """The re-run of the page in memory.

    Parameters
    ----------
    state : dict
        Of a stream whose memory is full; nothing of it changes before `take_over`.
    r : Reading
    """

    def __init__(self, state: State, r: Reading):
        self.state, self.reading, self.block = state, r, state["blocks"]
        self._work = np.zeros(work_size(r.dims, state["before"].shape[1]))
        self._steps = self._rerun()
        self._ends: list[tuple[np.ndarray, np.ndarray]] = []
        self._models: dict[str, Any] = {}
        self._parents: list[int] = []
        self._caught_up = 0
        self._known = float(state["page_known"])

    def belongs_to(self, state: State) -> bool:
        """Whether this is the re-run of the page that the state holds now."""
        return self.state is state and self.block == state["blocks"]

    def advance(self, n_samples: int) -> None:
        """Do what ``n_samples`` new samples pay for."""
        self._work[BUDGET] = READ_PER_SAMPLE * len(self.state["page_theta"]) * n_samples
        self._go_on()

    def take_over(self) -> None:
        """Finish, and let the new models go on in the place of the old; the page is turned."""
        self._work[BUDGET] = UNBOUNDED
        self._go_on()
        state, r = self.state, self.reading
        s, m = state, r.memory
        if self._models:
            s.update(self._models)
            s["theta"], s["ud"], s["before"], s["loss"], s["motion"] = self._running
        for name in ("origin", "prior_theta", "prior_information"):
            s[name] = s[name][self._parents].copy()
        left = left_of_prior(s, m)
        for i, (information, end) in enumerate(self._ends):
            if information.any():  # a page of rest says nothing, and lets nothing be forgotten
                s["prior_information"][i] = information + left * s["prior_information"][i]
                s["prior_theta"][i] = self._page_theta[i]
            s["origin"][i] = end
        shift_memory(state, r, m)
        s["page_theta"] = s["theta"].copy()

    def _go_on(self) -> None:
        """Spend the budget."""
        if next(self._steps, "done") == "done" and self._models:
            self._catch_up()

    def _rerun(self) -> Iterator[None]:
        """Refine each model on the page, then ask each what the page says and where it ends; yields without budget."""
        state, r = self.state, self.reading
        h, m = r.history, r.memory
        u, y = state["memory_u"][h : h + m], state["memory_y"][h : h + m]
        restart, weights = state["memory_restart"][:m], weights_of(state, m)
        thetas, parents = state["page_theta"], list(range(len(state["page_theta"])))
        moved = np.ptp(y) > 0.0 and not state["memory_idle"][:m].all()
        if moved:
            seen = state["seen"] - (state["fill"] - m)
            rungs = climb_to(relative_sharpness(seen, LADDER[-1]))[-2:]
            found = []
            for s in parents:
                found.append(
                    (yield from rerun_in_parts(state, r, s, thetas[s], rungs, u, restart, weights, self._work))
                )
            chosen = best_first(found)
            if chosen:
                self._models = adopted(chosen, weights.sum(), self._known)
                thetas = self._models["theta"]
                parents = [c.parent for c in chosen]
        ends, nothing = [], np.zeros((r.size, r.size))
        for theta, parent in zip(thetas, parents, strict=True):
            information, end = np.zeros((r.size, r.size)), np.zeros(state["before"].shape[1])
            kappa = inference_sharpness(theta, r, u, restart)
            self._work[AT] = 0
            self._work[PHASE] = 0
            while not refine_part(
                theta, *r.law, kappa, state["origin"][parent], state["memory_u"], state["memory_y"],
                state["memory_restart"], m, h, 1, weights, theta, nothing, 0, information, end, self._work,
            ):  # fmt: skip
                yield
            ends.append((information * moved, end))
        self._begin_catching_up(thetas)
        self._ends, self._parents = ends, parents

    def _begin_catching_up(self, thetas: np.ndarray) -> None:
        """The new models where the page ends."""
        state, r = self.state, self.reading
        h, m, k = r.history, r.memory, state["recent_y"].size
        self._page_theta = thetas.copy()
        if not self._models:
            return
        new = self._models
        self._running = tuple(new[name].copy() for name in ("theta", "ud", "before", "loss", "motion"))
        begun = np.flatnonzero(state["memory_restart"][:m])
        self._since = m - int(begun[-1]) if begun.size else m + h
        self._recent_u, self._recent_y = np.zeros((k, r.n_inputs)), np.zeros(k)
        known = min(self._since, k, m + h)
        self._recent_u[:known] = state["memory_u"][h + m - known : h + m][::-1]
        self._recent_y[:known] = state["memory_y"][h + m - known : h + m][::-1]
        self._recent_u = self._recent_u.ravel()

    def _catch_up(self) -> None:
        """Take the new models through the samples that came since the page."""
        state, r = self.state, self.reading
        m, h = r.memory, r.history
        restart, kept = state["memory_restart"][m:], state["memory_kept"][m:]
        marks = np.where(state["memory_still"][m:], STILL, MOVING).astype(np.uint8)
        rest = state["fill"] - m
        while self._caught_up < rest and self._work[BUDGET] > 0:
            at = self._caught_up
            if restart[at]:
                self._since = 0
                for past in (self._running[2], self._recent_u, self._recent_y):
                    past[:] = 0.0
            stop = at + 1 + int(min(self._work[BUDGET] / (COST_OF_WINDOW * len(self._running[0])), rest))
            stop = min(stop, rest)
            begun = np.flatnonzero(restart[at + 1 : stop] | (kept[at + 1 : stop] != kept[at : stop - 1]))
            stop = at + 1 + int(begun[0]) if begun.size else stop
            piece = slice(h + m + at, h + m + stop)
            theta, ud, before, loss, motion = self._running
            self._since = run_windows(
                theta, ud, before, loss, motion, self._recent_u, self._recent_y, self._since, 0,
                np.full(3, kept[at]), self._models["ceiling"], self._models["sharpness"], 0.0,
                *r.law, r.p, r.frozen, state["memory_u"][piece], state["memory_y"][piece], marks[at:stop],
            )  # fmt: skip
            self._work[BUDGET] -= (stop - at) * COST_OF_WINDOW * len(self._running[0])
            self._caught_up = stop
