"""What a store holds after a test."""

from __future__ import annotations

from whsklearn import tracking


def runs(tracker: tracking.Tracker) -> dict:
    """The runs of its experiment, by name."""
    found = tracker.client.search_runs([tracker.experiment_id])
    return {r.info.run_name: r for r in found}
