"""What goes wrong with a log, told apart by who can mend it."""

from __future__ import annotations


class LogError(ValueError):
    """A log that cannot be used; the message names the place and the remedy."""


class ColumnError(LogError):
    """A column that was asked for is not in the log: the call or the options are wrong, not the log."""


class LogWarning(UserWarning):
    """Something in a log was mended on reading; the message says what."""
