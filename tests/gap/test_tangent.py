"""The look: gains of columns in a record and in null rows."""

from __future__ import annotations

import numpy as np
import pytest

from whsklearn.gap.tangent import AT_ONCE, Family, Look, Tangent, looks_at, undiluted, with_p_values

N, M = 600, 12


def rows(seed=0, size=1.0):
    rng = np.random.default_rng(seed)
    base, column = rng.standard_normal((N, 3)), rng.standard_normal(N)
    null = rng.standard_normal((M, N))
    return base, column, null, size * column + base @ [1.0, -2.0, 0.5] + rng.standard_normal(N)


def family(*columns, name="effect", positive=False, offset=False):
    def blocks(_):
        yield list(range(len(columns))), np.stack([c.reshape(N, -1) for c in columns], axis=1), 1.0

    return Family(name, blocks, lambda shape, sizes: (shape, sizes), 1, positive, offset)


def test_gain_is_that_of_least_squares_beside_the_models_columns():
    base, column, null, y = rows()
    look = Tangent(y, null, base, N).look(family(column))
    before, after = (np.linalg.lstsq(x, y, rcond=None)[1][0] for x in (base, np.column_stack([base, column])))
    assert look.gain == pytest.approx(N * np.log(before / after), rel=1e-9)
    assert look.size == pytest.approx(np.sqrt((before - after) / N), rel=1e-9)


def test_shapes_that_come_one_by_one_are_looked_at_together_once_for_all_tangents():
    base, column, null, y = rows()
    shapes = [column + k * null[0] for k in range(AT_ONCE + 7)]
    made = []

    def one_by_one(_):
        for k, c in enumerate(shapes):
            made.append(k)
            yield [k], c[:, None, None], 1.0 + k / 100.0

    shares = 1.0 + np.arange(len(shapes)) / 100.0
    at_once = Family("effect", lambda _: [(range(len(shapes)), np.stack(shapes, 1)[:, :, None], shares)], lambda *a: a)
    tangents = Tangent(y, null, base, N), Tangent(y - column, null[:5], base, N)
    for look, tangent in zip(looks_at(Family("effect", one_by_one, lambda *a: a), *tangents), tangents, strict=True):
        whole = tangent.look(at_once)
        assert look.start[0] == whole.start[0]
        assert look.gain == pytest.approx(whole.gain, rel=1e-9)
        np.testing.assert_allclose(look.null, whole.null, rtol=1e-9)
        np.testing.assert_allclose(look.explained, whole.explained, atol=1e-9)
    assert made == list(range(len(shapes)))


def test_the_best_shape_and_its_size_start_the_refit():
    base, column, null, y = rows(size=2.0)
    other = np.random.default_rng(9).standard_normal(N)
    shape, sizes = Tangent(y, null, base, N).look(family(other, column)).start
    assert shape == 1
    assert sizes[0] == pytest.approx(2.0, abs=0.2)


def test_what_lies_in_the_models_plane_explains_nothing_and_is_not_visible():
    base, _, null, y = rows()
    look = Tangent(y, null, base, N).look(family(base @ [1.0, 1.0, 0.0]))
    assert look.gain == 0.0
    assert look.visible < 1e-6


def test_a_size_of_the_wrong_sign_counts_for_nothing():
    base, column, null, y = rows(size=-1.0)
    tangent = Tangent(y, null, base, N)
    assert tangent.look(family(column, positive=True)).gain == 0.0
    assert tangent.look(family(column)).gain > 100.0


def test_an_effect_without_a_size_is_there_as_it_is_or_not():
    base, column, null, y = rows(size=1.0)
    tangent = Tangent(y, null, base, N)
    right, double = (tangent.look(family(c, offset=True)).gain for c in (column, 2.0 * column))
    assert right > 100.0
    assert double < 0.2 * right  # 2 r c - c^2 is nothing at twice the size


def test_the_record_is_significant_and_its_null_rows_are_not():
    base, column, null, y = rows()
    looks = [Tangent(v, null, base, N).look(family(column)) for v in (y, null[0])]
    p = [with_p_values([k])[0].p_value for k in looks]
    assert p[0] < 1e-6
    assert p[1] > 0.01


def test_samples_of_no_weight_say_nothing():
    base, column, null, y = rows()
    weight = np.ones(N)
    weight[:300] = 0.0
    spoiled = y + np.where(weight == 0.0, 100.0 * column, 0.0)
    clean, dirty = (Tangent(v, null, base, N, weight).look(family(column)).gain for v in (y, spoiled))
    assert dirty == pytest.approx(clean, rel=1e-9)


@pytest.mark.parametrize("weight", [1.0, 0.1])
def test_an_effect_is_as_large_where_less_is_certain(weight):
    """Weights tell what a sample is worth as evidence; whether an effect is worth naming does not depend on them."""
    base, _, null, _ = rows()
    here = np.arange(N) < 200
    column = np.where(here, np.random.default_rng(1).standard_normal(N), 0.0)
    told = np.where(here, weight, 1.0)
    look = undiluted(Tangent(0.5 * column, null, base, N, told).look(family(column)), told)
    assert look.whole == pytest.approx(0.5 * np.sqrt(np.mean(column**2)), rel=0.05)
    assert look.size == pytest.approx(weight * look.whole, rel=0.05)


def test_columns_on_some_rows_say_what_they_say_with_zeros_elsewhere():
    rng = np.random.default_rng(3)
    left, null, own = rng.standard_normal(300), rng.standard_normal((5, 300)), rng.standard_normal((300, 4))
    some = rng.standard_normal((100, 1, 1))
    whole = np.zeros((300, 1, 1))
    whole[1::3] = some
    tangent = Tangent(left, null, own, 300.0, weight=rng.uniform(0.5, 2.0, 300))
    one, other = (
        tangent.look(Family("x", lambda _, c=c: [([0], c, 1.0)], lambda *_: None, rows=rows))
        for c, rows in ((some, slice(1, None, 3)), (whole, slice(None)))
    )
    assert one.gain == pytest.approx(other.gain)
    assert one.null == pytest.approx(other.null)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_an_effect_of_at_most_the_least_size_is_named_no_more_often_than_alpha(share):
    """400 records of a column of a size up to the least one in white noise, which shows a tenth of that size."""
    rng, n, least = np.random.default_rng(0), 2000, 0.02
    column = rng.standard_normal(n)
    column /= np.sqrt(np.mean(column**2))

    def gain_and_size(y):
        size = float(y @ column) / n
        return n * np.log(float(y @ y) / float(np.sum((y - size * column) ** 2))), abs(size)

    named = 0
    for _ in range(400):
        noise = 0.1 * rng.standard_normal((10, n))
        g, size = gain_and_size(share * least * column + noise[0])
        null = np.array([gain_and_size(e)[0] for e in noise[1:]])
        (look,) = with_p_values([Look("cogging", g, null, size=size, degrees=1.0)], least)
        named += look.p_value <= 0.05
    assert named / 400 < 0.05 + 2 * np.sqrt(0.05 * 0.95 / 400)


def test_a_large_effect_keeps_its_p_value_and_none_counts_from_nothing():
    null = np.array([1.0, 2.0, 0.5, 1.5, 0.7, 1.1, 0.3, 2.2, 0.9])
    large, small = (Look("cogging", 400.0, null, size=s, degrees=1.0) for s in (10.0, 0.019))
    assert with_p_values([large], 0.02)[0].p_value < 1e-5
    assert with_p_values([small], 0.02)[0].p_value == 1.0
    assert with_p_values([small])[0].p_value < 1e-5
    nameless = Look("", 400.0, null, size=0.019, degrees=1.0)
    assert with_p_values([nameless], 0.02)[0].p_value < 1e-5


def test_what_another_record_knows_of_the_numbers_counts_as_rows_beside_it():
    base, column, null, y = rows()
    known, none = np.diag([9.0, 0.0, 30.0]), np.zeros(3)
    unseen = np.column_stack(
        [base, np.append(1.0, np.zeros(N - 1))]
    )  # of a number whose row is left out nothing is known
    weight = np.append(0.0, np.ones(N - 1))
    look = Tangent(y, null, unseen, N, weight, np.pad(known, ((0, 0), (0, 1)))).look(family(column))
    stacked, target = np.vstack([base[1:], known]), np.append(y[1:], none)
    wide = np.column_stack([stacked, np.append(column[1:], none)])
    before, after = (np.linalg.lstsq(x, target, rcond=None)[1][0] for x in (stacked, wide))
    assert look.gain == pytest.approx(N * np.log(before / after), rel=1e-9)
