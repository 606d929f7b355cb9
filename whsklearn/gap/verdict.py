"""The verdict, from the effects found, the residual and the free run."""

from __future__ import annotations

from whsklearn.gap import evidence as rules

VERDICTS = ("no_gap", "named", "ambiguous", "partial", "unknown", "coloured_noise", "not_testable", "data_problem")


def verdict_of(
    names: list[str], closure: float, rivals: list[list[str]], *, quiet: bool, follows: float, left: float = 0.0,
    still: float = 0.0,
) -> str:  # fmt: skip
    """The verdict, from the effects taken and the residual.

    Parameters
    ----------
    names : list of str
        Effects taken; a family of orders counts once.
    closure : float
        Of the gap, all effects together.
    rivals : list of list of str
        For each effect, the names that could stand in its place, aliases left out.
    quiet : bool
        Whether the base model is at the floor already.
    follows : float
        Cross-validated share of the base model's gap that follows the motion.
    left : float
        What is left, in units of the floor (of noise or tolerance): several effects together can imitate
        one that has no name, so they must leave next to nothing.
    still : float
        Cross-validated share of what is left that follows the motion: a neighbour of the true effect closes most
        of the gap and leaves its own shape.

    Examples
    --------
    >>> verdict_of(["cogging"], 0.97, [[]], quiet=False, follows=0.5)
    'named'
    >>> verdict_of([], 0.0, [], quiet=False, follows=0.0)
    'coloured_noise'
    """
    if not names:
        if quiet:
            return "no_gap"
        return "unknown" if follows > rules.FOLLOWS else "coloured_noise"
    if closure < rules.PARTIAL:
        return "unknown"
    need = 1.0 - (1.0 - rules.NAMED) / len(names)
    repeated = len(set(names)) < len(names)
    several = len(names) > 1 and (left > rules.LEFT_BY_SEVERAL or repeated)
    if closure < need or still > rules.FOLLOWS or several:
        return "partial"
    return "ambiguous" if any(rivals) else "named"
