"""A change in a file that a kernel inlines is seen by the next process, without cleaning anything by hand."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba

import whsklearn
from whsklearn._numba import fingerprint, imported

PACKAGE = Path(whsklearn.__file__).parent
SCRIPT = """
import numpy as np
from whsklearn.effects.terms import VISCOUS, term_values
value = term_values(VISCOUS, 0.0, 0.0, 0.0, np.zeros(1), np.ones(1), np.inf)[0]
print(value, sum(term_values.stats.cache_hits.values()))
"""


def run(folder):
    """What the kernel gives in a process of its own, and whether it came from the cache."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith(("NUMBA_", "PYTHONPATH"))}
    out = subprocess.run(
        [sys.executable, "-c", SCRIPT], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    value, hits = out.stdout.split()
    return float(value), int(hits)


def test_an_edited_equation_is_run_and_an_unchanged_one_comes_from_the_cache(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "whsklearn", ignore=shutil.ignore_patterns("__pycache__"))
    assert run(tmp_path) == (1.0, 0)
    assert run(tmp_path) == (1.0, 1)
    friction = tmp_path / "whsklearn" / "effects" / "friction.py"
    before, after = "return dx, 0.0, 1.0", "return 3.0 * dx, 0.0, 3.0"
    assert friction.read_text().count(before) == 1
    friction.write_text(friction.read_text().replace(before, after))
    assert run(tmp_path) == (3.0, 0)


def test_imports_are_found_however_they_are_written():
    lines = ("from whsklearn.effects import codes, Effect", "from whsklearn.effects.terms import (", "    term,  # a",
             "    tanh as t,", ")", "import numpy", "import whsklearn.effects.law", "")  # fmt: skip
    names = [f.name for f in imported("\n".join(lines))]
    assert names == ["codes.py", "terms.py", "law.py"]


def test_a_kernel_depends_on_what_it_inlines_two_files_down():
    assert "friction.py" in {f.name for f in imported((PACKAGE / "effects" / "terms.py").read_text())}
    assert fingerprint(PACKAGE / "effects" / "terms.py") != fingerprint(PACKAGE / "effects" / "signs.py")


def test_the_users_own_setting_is_left_as_it_was():
    assert not str(numba.config.CACHE_DIR).startswith(str(PACKAGE))
