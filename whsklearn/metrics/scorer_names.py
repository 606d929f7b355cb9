"""Entering scorers under a name: the only file that touches scikit-learn's scorer registry.

scikit-learn (1.5 to 1.9) has no public call for this.  ``get_scorer`` looks names up in
a dict, and every estimator or function with a ``scoring`` parameter froze the set of
valid names when its module was imported.  Both are extended here; if a later version
moves them, names stop working and ``scoring=free_run_scorer(nmse)`` still does.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

from sklearn.metrics import _scorer

_KNOWN = "neg_mean_squared_error"


def register_scorers(scorers: dict[str, Any]) -> None:
    """Make ``scoring=name`` valid everywhere; a name of scikit-learn's own is never replaced."""
    registry = getattr(_scorer, "_SCORERS", {})
    ours = {name: scorer for name, scorer in scorers.items() if name not in registry}
    registry.update(ours)
    for options in _scoring_options():
        options.update(ours)


def _scoring_options() -> Iterator[set[str]]:
    """The name sets that modules of scikit-learn already imported have frozen."""
    modules = [m for name, m in list(sys.modules.items()) if name.startswith("sklearn.") and m is not None]
    seen: set[int] = set()
    for module in modules:
        for value in list(vars(module).values()):
            for attribute in ("_parameter_constraints", "_skl_parameter_constraints"):
                constraints = getattr(value, "__dict__", {}).get(attribute)
                if not isinstance(constraints, dict) or id(constraints) in seen:
                    continue
                seen.add(id(constraints))
                for constraint in constraints.get("scoring", ()):
                    options = getattr(constraint, "options", None)
                    if isinstance(options, set) and _KNOWN in options:
                        yield options
