"""Import each package of the library before pytest imports its modules for their doctests.

With ``--import-mode=importlib`` pytest imports the package of a module and then the module, even if the package has
just imported it. There would be two classes of each name, and the package would hold the one that ``sys.modules`` does
not. pytest does not import again what is there already.
"""

from __future__ import annotations

import importlib
from pathlib import Path

ROOT = Path(__file__).parent


def pytest_collect_file(file_path: Path) -> None:
    """Import the package of a module of the library."""
    if file_path.suffix == ".py" and file_path.is_relative_to(ROOT / "whsklearn"):
        importlib.import_module(".".join(file_path.parent.relative_to(ROOT).parts))
