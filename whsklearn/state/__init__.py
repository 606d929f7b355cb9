"""State files without pickle."""

from whsklearn.state.files import FORMAT_VERSION, pack_state, read_kind, read_state, unpack_state, write_state

__all__ = ["FORMAT_VERSION", "pack_state", "read_kind", "read_state", "unpack_state", "write_state"]
