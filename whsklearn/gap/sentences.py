"""The diagnosis in words: its sentence, and the experiment that would show more."""

from __future__ import annotations

from typing import Any

from whsklearn.gap.diagnosis import ALPHA, spoken
from whsklearn.gap.localisation import NOWHERE
from whsklearn.gap.plant import QUIET
from whsklearn.gap.search import HALF

MENU = {
    frozenset(pair.split()): text
    for pair, text in {
        "input_offset asymmetric_coulomb": "Let the axis rest and ramp the drive slowly up and down until it breaks "
        "away in both directions, 30 s: at rest only an offset of the drive remains.",
        "input_delay actuator_lag": "Add a fast multisine (to a third of the sampling rate) at small amplitude, 20 s.",
        "quadratic_drag stribeck": "Run constant speeds from very slow to top speed, both ways, 60 s.",
        "backlash presliding_hysteresis": "Run one sine at three amplitudes, the smallest below 1 degree, 30 s.",
        "cogging disturbance_tone": "Cross the full turn at two constant speeds, 30 s: the frequency of cogging "
        "changes with the speed, that of a tone does not.",
        "cable_spring gravity_imbalance": "Travel at least half a turn at slow speed, 30 s.",
    }.items()
}
# Multiple of a number above which its standard error means that the record says nothing about it: the centre of a
# spring beside a free offset has 57,000. One that is zero by chance gets there once in a hundred times.
UNTOLD = 1.0 / ALPHA
RICH = (
    "Repeat with a rich reference: eight tones of 0.1 to 2.9 Hz on a slow triangle over the whole travel, 40 s; it "
    "shows all effects of the catalogue at two percent of the rms drive."
)


def article_list(names: list[str]) -> str:
    """Names joined as in a sentence.

    >>> article_list(["cogging", "stribeck", "backlash"])
    'cogging, stribeck and backlash'
    """
    pretty = [spoken(n) for n in names]
    return pretty[0] if len(pretty) == 1 else ", ".join(pretty[:-1]) + " and " + pretty[-1]


def numbers(named: Any) -> str:
    """The parameters with units, in short form; for a family of waves, also the number of further ones."""
    out = []
    for name, value, error, unit in named.told:
        if isinstance(value, str):
            out.append(f"{name} {value}")
        elif (error or 0.0) > UNTOLD * abs(value):
            out.append(f"{name} not determined")
        elif not name.startswith("phase"):
            out.append(f"{name} {value:.4g} {unit}".rstrip())
    if named.orders:
        out.append(f"and {len(named.orders)} more wave{'s' if len(named.orders) > 1 else ''}")
    return ", ".join(out)


def learned(d: Any) -> str:
    """What a nameless torque depends on, and how much of the gap it closes; empty if none was learned."""
    if d.learned is None:
        return ""
    on = article_list(d.learned.signals)
    if not d.effects:
        return f"A smooth torque that depends on {on} was learned in its place. "
    share = f"{100 * max(d.learned.closure, 0):.0f} %"
    return f"A smooth torque that depends on {on} was learned in addition and closes {share} of the rest. "


def _or_its_rivals(e: Any) -> str:
    """The label of an effect, with what the record cannot tell from it."""
    rivals = article_list(e.aliases).replace(" and ", " or ") if e.aliases else ""
    return f"{e.label} (or {rivals})" if rivals else str(e.label)


def summary(d: Any, plant: Any) -> str:
    """The verdict in one paragraph."""

    def percent(x: float) -> str:
        return f"{100 * x:.2f} %"

    what, whole = plant.gap_word, plant.whole
    before, after, floor = d.figures
    opening = (
        f"Of the rms {whole}{plant.subject}, the {what} is {percent(before)}; noise alone gives {percent(floor)}. "
    )
    if before > 1.0:
        opening += f"Above 100 % the base model is worse than none, which would leave all of the {whole} missing. "
    course = "stays at" if percent(after) == percent(before) else "falls to" if after < before else "rises to"
    closed = f"{100 * d.closure:.0f} % of the gap in simulation is closed"
    run = closed if d.closure >= 0.0 else "the simulation comes no closer to the record"
    left = f"The {what} {course} {percent(after)}, and {run}."
    if before == after:  # a coarse reading: it is in the record, not in the model's run
        left = "That is all the noise there is: nothing else is missing that this record could show."
    if d.verdict in ("named", "ambiguous"):
        open_ones = [e for e in d.effects if e.aliases and d.verdict == "ambiguous"]
        parts = [f"{spoken(e.label)} ({numbers(e)})" for e in d.effects if e not in open_ones]
        said = opening + (f"Consistent with {' and '.join(parts)}. " if parts else "")
        if open_ones:
            groups = "; ".join(article_list([e.label, *e.aliases]).replace(" and ", " or ") for e in open_ones)
            if not parts or d.effects[0] in open_ones:  # the first explains most
                beside = f"Beside it, it is consistent with {' and '.join(parts)}. " if parts else ""
                return f"{opening}Something is missing, and this record cannot tell which: {groups}. {beside}{left}"
            return f"{said}More is missing, and this record cannot tell which: {groups}. {left}"
        alias = sorted({a for e in d.effects for a in e.aliases})
        return said + left + (f" This record does not distinguish it from {article_list(alias)}." if alias else "")
    if d.verdict == "partial":
        names, more = article_list([_or_its_rivals(e) for e in d.effects]), len(d.effects) > 1
        taken = min(d.closure, (before - after) / max(before - floor, 1e-300))  # of the drive, and in simulation
        part = f"which explain{'' if more else 's'} {'most' if taken > HALF else 'only a part'} of it. "
        return opening + f"The gap resembles {names}, {part}" + learned(d) + left
    if d.shortfall:
        return opening + d.shortfall
    if d.verdict == "unknown" and d.interrupted:
        return opening + "The search was interrupted before it could name a cause; run the command again to its end."
    if d.verdict == "unknown":
        small = "It is no larger than noise, but it is not noise: " if percent(before) == percent(floor) else ""
        follows = "something follows the motion, and no effect of the catalogue could be shown to be the cause. "
        where = "No single signal shows where it lies." if d.where_sentence == NOWHERE else d.where_sentence
        told = small + follows if small else follows.capitalize()
        return opening + told + (learned(d) + left if d.learned else where)
    if d.verdict == "coloured_noise":
        return (
            opening
            + "The remainder is coloured noise: no function of the motion or of the drive predicts it. No effect "
            "is named."
        )
    if d.verdict == "not_testable":
        return opening + "No gap was found, but most effects could not have been detected in this record."
    if before > QUIET * floor:
        return opening + "That is more than noise but too little to name an effect."
    return (
        opening + "The model explains the log to within noise and the tolerance: nothing larger is missing that this "
        "record could show."
    )


def next_experiment(d: Any) -> str:
    """The experiment that would decide what this record cannot."""
    if d.shortfall:
        return "First give the base model the orders and the law that the record needs."
    if d.verdict == "named" and not any(e.aliases for e in d.effects):
        return "None needed for this verdict; validate the repaired model on a second record."
    open_names = {n.partition(" at ")[0] for e in d.effects for n in (e.name, *e.aliases)}
    for pair, text in MENU.items():
        if pair <= open_names:
            return text
    if d.verdict == "coloured_noise":
        return "Repeat the same reference twice: what repeats is a missing effect, what does not is noise."
    if d.verdict == "unknown":
        return "Repeat the experiment at half the amplitude and at half the speed; compare where the gap lies."
    if d.verdict == "no_gap":
        return "None needed; effects marked not testable would need a richer reference."
    return RICH
