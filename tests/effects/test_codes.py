"""One numbering: each effect has a code, none is used twice."""

from __future__ import annotations

from collections import Counter

from whsklearn.effects import codes, effect_names, get_effect

NUMBERS = {k: v for k, v in vars(codes).items() if k.isupper() and not k.startswith("N_")}


def test_no_number_is_used_twice():
    assert [n for n, count in Counter(NUMBERS.values()).items() if count > 1] == []


def test_every_effect_of_the_catalogue_has_one():
    for name in effect_names():
        cls = get_effect(name)
        effect = cls()
        assert effect.code in NUMBERS.values(), name
        assert len(effect.row) <= codes.N_NUMBERS
