"""A stream as a service: rows arrive around the clock, and the learned state survives however the process ends.

`StreamMonitor` is the loop, for an application that has its own rows.  It learns, repairs the clock, watches the
innovations and reports what changed.  `run_stream` adds files: a CSV file that may grow or JSON lines on stdin, a
checkpoint that is replaced atomically, records as JSON lines, and a run in MLflow.  Its command is
``whsklearn stream``.

The time stamps of a stream are corrected row by row (`clock`), from the three rows that follow.  Those of a record are
corrected as a whole (`whsklearn.logs.timebase`), from the statistics of all stamps.  The two share no information.
"""

from whsklearn.streaming.monitor import Options, Refused, StreamMonitor
from whsklearn.streaming.service import Files, run_stream

__all__ = ["Files", "Options", "Refused", "StreamMonitor", "run_stream"]
