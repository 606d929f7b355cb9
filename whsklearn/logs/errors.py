"""Errors about logs, separated by who can correct them."""

from __future__ import annotations


class LogError(ValueError):
    """A log that cannot be used; the message names the place and the remedy.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from whsklearn.logs import LogError, load_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "empty.csv")
    ...     path.touch()
    ...     try:
    ...         load_log(path, drive="torque_nm", position="position_rad")
    ...     except LogError as error:
    ...         print(error)
    empty.csv is empty...
    """


class ColumnError(LogError):
    r"""A column that was asked for is not in the log: the call or the options are wrong, not the log.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> from whsklearn.logs import ColumnError, open_source
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder, "log.csv")
    ...     _ = path.write_text("t,u\n0,1\n1,2\n2,3\n")
    ...     try:
    ...         open_source(path).resolve("torque", "drive")
    ...     except ColumnError as error:
    ...         print(error)
    log.csv...
    """


class LogWarning(UserWarning):
    """Something in a log was repaired while reading; the message says what.

    Examples
    --------
    >>> from whsklearn.logs import LogWarning
    >>> issubclass(LogWarning, UserWarning)
    True
    """
