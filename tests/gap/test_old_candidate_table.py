"""Every candidate once, with a reason that is true of it."""

from __future__ import annotations

from types import SimpleNamespace

from whsklearn.effects import Cogging
from whsklearn.gap import Diagnosis, NamedEffect
from whsklearn.gap.evidence import Evidence
from whsklearn.gap.old_candidate_table import candidate_table
from whsklearn.gap.old_search import Found, Round
from whsklearn.gap.values import CandidateFit, Look


def weighed(name, delta_bic, closure=0.5, reason=""):
    return Evidence(CandidateFit(Look(name, 0.5), None), delta_bic, 0.1, 1.0, 0.3, closure, 1.0, reason=reason)


def table(named, evidence, looks=(), taken=()):
    diagnosis = Diagnosis("named" if named else "unknown", "", effects=named, need=30.0)
    found = Found(None, SimpleNamespace(terms=()), taken=list(taken))
    found.rounds = [Round(1, 1.0, evidence, [*(e.fitted.look for e in evidence), *looks], None)]
    lines = candidate_table(found, diagnosis)
    assert len({c.name for c in lines}) == len(lines)
    return {c.name: c for c in lines}


def test_each_has_its_status_and_the_strongest_is_first():
    cogging = weighed("cogging", 500.0, 0.97)
    named = [NamedEffect(Cogging(0.1, 12.0), {}, 480.0, 1.0, 0.96, aliases=["gravity_imbalance"])]
    evidence = [cogging, weighed("gravity_imbalance", 490.0), weighed("stribeck", 100.0),
                weighed("backlash", 20.0, -3.0, "evidence 20 is below the 30")]  # fmt: skip
    looks = [Look("end_stop", 0.0, expected=5.0), Look("dead_zone", 0.0, expected=1e9)]
    lines = table(named, evidence, looks, [cogging])
    assert next(iter(lines)) == "gravity_imbalance"
    assert {k: c.status for k, c in lines.items()} == {
        "cogging": "named", "gravity_imbalance": "alias", "stribeck": "ruled_out", "backlash": "ruled_out",
        "end_stop": "not_testable", "dead_zone": "ruled_out",
    }  # fmt: skip
    assert (lines["cogging"].delta_bic, lines["cogging"].closure) == (480.0, 0.96)
    assert lines["stribeck"].reason == "explains less than cogging by 400 of delta BIC"
    assert lines["backlash"].reason.startswith("evidence 20")
    assert lines["backlash"].closure == -1.0


def test_where_nothing_is_named_nobody_is_behind_anybody():
    lines = table([], [weighed("stribeck", 100.0)])
    assert lines["stribeck"].reason == "leaves too much of the gap"


def test_an_effect_of_a_later_round_is_there_too():
    late = NamedEffect(Cogging(0.1, 12.0), {}, 60.0, 1.0, 0.4)
    lines = table([late], [weighed("stribeck", 100.0)])
    assert (lines["cogging"].status, lines["cogging"].reason) == ("named", "accepted later")
