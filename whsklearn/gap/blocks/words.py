"""The verdict on a u-y record in words."""

from __future__ import annotations

from typing import Any

from whsklearn.gap.words import article_list, numbers


def sentence(d: Any) -> str:
    """One paragraph, the answer first."""
    share = 100 * d.before["nmse"]
    rms = f"The free run misses the held-out output by {d.before['rmse']:.4g} rms ({share:.3g} % of its variance)"
    left = (
        f"{rms}; repaired, by {d.after['rmse']:.4g}, with a noise floor of {d.floor:.4g}: "
        f"{100 * max(d.closure, 0):.0f} % of the gap is closed."
    )
    if d.verdict == "named":
        parts = [f"{e.name.replace('_', ' ')} ({numbers(e)})" for e in d.effects]
        alias = sorted({a for e in d.effects for a in e.aliases})
        tail = f" No such record can tell it from {article_list(alias)}." if alias else ""
        return "Consistent with " + " and ".join(parts) + ". " + left + tail
    if d.verdict == "ambiguous":
        groups = [article_list([e.name, *e.aliases]).replace(" and ", " or ") for e in d.effects]
        return "Something is missing, and this record cannot tell which: " + "; ".join(groups) + ". " + left
    if d.verdict == "partial":
        return f"The gap resembles {article_list([e.name for e in d.effects])}, which explains a part only. " + left
    if d.verdict == "unknown":
        return f"{rms}. What is missing follows the signals and is none of the catalogue's effects. " + d.where_sentence
    if d.verdict == "coloured_noise":
        return f"{rms}. What is left is coloured noise: it follows no signal of the chain. No effect is named."
    if d.verdict == "not_testable":
        return f"{rms}. No gap is seen, but this record could not have shown most effects."
    return f"{rms}: white noise explains it. Nothing is missing that this record could show."


def next_step(d: Any) -> str:
    """The experiment that would decide what is open."""
    open_names = {n for e in d.effects for n in (e.name, *e.aliases)}
    if {"output_offset", "asymmetric_coulomb"} <= open_names or {"output_offset", "input_offset"} <= open_names:
        return "Hold the input constant until the output rests: an offset of the output stays, friction's falls away."
    if d.verdict == "named" and not any(e.aliases for e in d.effects):
        return "None needed for this verdict; validate the repaired model on a second record."
    if d.verdict == "coloured_noise":
        return "Repeat the same input twice: what repeats is a missing effect, what does not is noise."
    if d.verdict == "no_gap":
        return "None needed; effects marked not testable would need another input."
    if d.verdict in ("unknown", "partial"):
        return "Repeat with half and with twice the input: an effect that grows out of proportion shows its place."
    return "Repeat with a longer record of white or multisine input; four times the samples halve the doubt."
