"""The table of candidates: every catalogue name once, its evidence and why it is or is not the answer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from whsklearn.gap.diagnosis import CandidateLine

if TYPE_CHECKING:
    from whsklearn.gap.diagnosis import Diagnosis
    from whsklearn.gap.old_search import Found


def candidate_table(found: Found, diagnosis: Diagnosis) -> list[CandidateLine]:
    """Every catalogue name once: its best evidence, its status and why."""
    named = {e.name: e for e in diagnosis.effects}
    aliases = {a for e in diagnosis.effects for a in e.aliases}
    lines: dict[str, CandidateLine] = {}
    for r in found.rounds[:1]:
        for e in r.evidence:
            if e.name not in lines:
                lines[e.name] = CandidateLine(
                    e.name, e.delta_bic, float(np.clip(e.closure, -1, 1)), "ruled_out", e.reason
                )
        for t in r.looks:
            name = t.name
            if name in lines:
                continue
            if t.expected < diagnosis.need:
                reason = "two percent of the rms drive would not show in this record"
                lines[name] = CandidateLine(name, 0.0, 0.0, "not_testable", reason)
            else:
                reason = "its signature does not follow the gap"
                lines[name] = CandidateLine(name, 0.0, 0.0, "ruled_out", reason)
    winner = found.taken[0] if found.taken else None
    for name, line in lines.items():
        if name in named:
            line.status, line.reason = "named", "accepted"
            line.delta_bic, line.closure = named[name].delta_bic, float(np.clip(named[name].closure, -1, 1))
        elif name in aliases:
            line.status, line.reason = "alias", "this record cannot tell it from the named effect"
        elif not line.reason:
            behind = winner.delta_bic - line.delta_bic if winner else 0.0
            line.reason = (
                f"explains less than {winner.name} by {behind:.0f} of delta BIC"
                if winner
                else "leaves too much of the gap"
            )
    for name, late in named.items():
        if name not in lines:
            share = float(np.clip(late.closure, -1, 1))
            lines[name] = CandidateLine(name, late.delta_bic, share, "named", "accepted later")
    return sorted(lines.values(), key=lambda c: -c.delta_bic)
