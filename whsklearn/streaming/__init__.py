"""A stream as a service: rows come day and night, and what was learnt survives whatever ends the process.

`StreamMonitor` is the loop, for an application that has rows of its own: it learns, repairs the clock, watches the
innovations and says what changed.  `run_stream` puts files around it: a CSV file that may grow or JSON lines on stdin,
a checkpoint that is replaced in one step, records as JSON lines, a run in MLflow.  ``whsklearn stream`` is its command.

Stamps of a stream are put right row by row (`clock`), from the three rows that follow; a record is put right as a whole
(`whsklearn.logs.timebase`), from the statistics of all its stamps.  What either knows the other cannot use.
"""

from whsklearn.streaming.monitor import Options, Refused, StreamMonitor
from whsklearn.streaming.service import Files, run_stream

__all__ = ["Files", "Options", "Refused", "StreamMonitor", "run_stream"]
