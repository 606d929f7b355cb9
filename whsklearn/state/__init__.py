"""State files without pickle."""

from whsklearn.state.files import read_kind, read_state, write_state

__all__ = ["read_kind", "read_state", "write_state"]
