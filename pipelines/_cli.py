"""Names under which jobs outside the wheel know the shared code of `whsklearn.cli.job`."""

from whsklearn.cli.job import guarded, job, say_where, table, tracker_for, wrapped

__all__ = ["guarded", "job", "say_where", "table", "tracker_for", "wrapped"]
