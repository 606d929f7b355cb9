"""Errors about logs, separated by who can correct them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path


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


@contextlib.contextmanager
def damaged(path: Path, what: str, *failures: type[BaseException]) -> Iterator[None]:
    """Turn these errors of a format's library into a `LogError`: the file is not a complete ``what``."""
    try:
        yield
    except failures as error:
        reason = (str(error).strip() or type(error).__name__).splitlines()[0].rstrip(".")
        raise LogError(f"{path.name} is not a complete {what} ({reason[:160]}); copy or export it again.") from None
