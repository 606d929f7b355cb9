"""State files without pickle."""

from whsklearn.state.files import is_state, read_state, write_state

__all__ = ["is_state", "read_state", "write_state"]
