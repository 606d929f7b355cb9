"""Units in any spelling, and the factor to SI."""

from __future__ import annotations

import itertools
import math

import pytest

from whsklearn.logs.units import (
    _KNOWN,
    factor_between,
    factor_of,
    inertia_unit,
    integral_of,
    of_an_axis,
    readable,
    respelled,
    stated,
    symbol_of,
    turn_of,
    unit_for,
    unit_in,
    unit_of,
)


@pytest.mark.parametrize(
    ("unit", "si", "factor"), [("deg", "rad", math.pi / 180), ("ms", "s", 1e-3), ("mm", "m", 1e-3)]
)
def test_factors_lead_to_si(unit, si, factor):
    assert factor_of(unit) == (pytest.approx(factor), si)
    assert factor_of(si) == (1.0, si)  # what is SI already stays


@pytest.mark.parametrize(
    ("column", "unit", "in_si"),
    [
        ("torque [µNm]", "uNm", 1e-6),  # read as Nm before, a million times too much
        ("torque (mN·m)", "mNm", 1e-3),
        ("torque_mN_m", "mNm", 1e-3),
        ("Moment in Ncm", "Ncm", 1e-2),
        ("torque [lbf·in]", "lbf in", 4.4482216152605 * 0.0254),
        ("torque [ft-lb]", "lbf ft", 4.4482216152605 * 12 * 0.0254),
        ("torque_ozin", "ozf in", 4.4482216152605 / 16 * 0.0254),
        ("torque [kg·cm]", "kgf cm", 9.80665e-2),
        ("position [µrad]", "urad", 1e-6),
        ("Winkel in Grad", "deg", math.pi / 180),
        ("angle [arcsec]", "arcsec", math.pi / 648000),
        ("x [cm]", "cm", 1e-2),
        ("n [1/min]", "rpm", math.pi / 30),
        ("wheel_left_mps", "m/s", 1.0),
        ("gyro_z (dps)", "deg/s", math.pi / 180),
        ("torque_permille", "permille", 0.1),
        ("Drehmoment [‰]", "permille", 0.1),
        ("IL.FB (Arms)", "Arms", 1.0),  # Kollmorgen Workbench
        ("i_q [A rms]", "Arms", 1.0),
        ("Strom [mA_rms]", "mArms", 1e-3),
        ("Iq (A peak)", "Apk", 1.0),
        ("Torque Actual (% rated)", "%", 1.0),
        ("M_ist [%MN]", "%", 1.0),
        ("Torque actual value [per thousand of rated torque]", "permille", 0.1),  # CiA 402, 6077h
        ("Torque actual value [‰ of rated torque]", "permille", 0.1),
        ("torque_pct", "%", 1.0),
        ("Torque [0.1% rated]", "0.1 %", 0.1),  # AX5000
        ("Couple [daN.m]", "daNm", 10.0),  # metres before, and a position
        ("Torque [gf·m]", "gf m", 9.80665e-3),
        ("Moment [kp·m]", "kgf m", 9.80665),
        ("torque [kN·cm]", "daNm", 10.0),
        ("torque [cNm]", "Ncm", 1e-2),
        ("torque_dNm", "dNm", 1e-1),
        ("Torque [MNm]", "MNm", 1e6),  # a thousand millionth of it before
        ("Force [MN]", "MN", 1e6),
        ("FORCE [mN]", "mN", 1e-3),
        ("motorTorqueMNm", "mNm", 1e-3),
        ("Position [1/1000 deg]", "0.001 deg", math.pi / 180e3),  # a thousandth of the rated torque before
        ("Current [0,1 A]", "0.1 A", 0.1),
        ("Position, 0.01 deg", "0.01 deg", math.pi / 18e3),  # deg before, a hundred times too much
        ("Strom in 0.1 A", "0.1 A", 0.1),
        ("Position [″]", "arcsec", math.pi / 648000),
        ("Strom [µA]", "uA", 1e-6),
        ("pos [in]", "inch", 0.0254),
        ("Angle [gon]", "gon", math.pi / 200),
        ("Speed (r/min)", "rpm", math.pi / 30),
        ("vitesse [tr/min]", "rpm", math.pi / 30),
        ("Vorschub [mm/min]", "mm/min", 1e-3 / 60),
        ("time [d]", "d", 86400.0),
        ("Torque in N.m", "Nm", 1.0),
        ("time [min]", "min", 60.0),
        ("time_h", "h", 3600.0),
        ("torque_min", "as logged", 1.0),
        ("torque_nm (motor 1)", "Nm", 1.0),
    ],
)
def test_units_as_rigs_write_them(column, unit, in_si):
    assert unit_of(column) == unit
    assert factor_of(unit)[0] == pytest.approx(in_si, rel=1e-12)


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ("counts_per_s", "counts/s"),  # read as seconds before
        ("q_incr", "counts"),
        ("encoder_ticks", "counts"),
        ("increments", "counts"),
        ("torque_nm_filtered", "Nm"),
        ("position_deg_2", "deg"),
        ("Torque [Nm, filtered]", "Nm"),
        ("deg_per_sec", "deg/s"),
        ("n [min⁻¹]", "rpm"),
        ("v [mm·s^-1]", "mm/s"),
        ("m/s", "m/s"),
        ("Winkel/°", "deg"),
        ("pos_a_deg", "deg"),  # of axis a
        ("acc_rad_s2", "as logged"),
        ("acc_m_s_2", "as logged"),
        ("acc [m/s²]", "as logged"),
        ("x [1/s]", "as logged"),
        ("temp_deg_C", "as logged"),
        ("samples_per_s", "as logged"),
        ("torque_nm [Nm/rad]", "as logged"),
        ("Torque [foo·m]", "as logged"),
        ("position_deg_min", "as logged"),
        ("motor_kp", "as logged"),
        ("wrist_ft", "as logged"),
    ],
)
def test_a_unit_is_what_the_whole_name_measures(column, unit):
    assert unit_of(column) == unit


@pytest.mark.parametrize("pattern", ["gain_{}_per_{}", "gain [{}/{}]", "gain {}/{}", "gain_{}_{}", "{}_per_{}"])
def test_a_ratio_of_units_is_never_read_as_one_of_them(pattern):
    for top, bottom in itertools.product((u for u in _KNOWN if "/" not in u and " " not in u), repeat=2):
        ratio = symbol_of(f"{top}/{bottom}")
        if pattern == "gain_{}_{}" and (len(top) == 1 or symbol_of(top + bottom)):
            continue  # the letter of an axis; or a product, such as N_m
        if pattern == "gain_{}_{}" and bottom == "min" and ratio != "rpm":
            ratio = None  # a minimum
        assert unit_of(pattern.format(top, bottom)) == (ratio or "as logged"), (top, bottom)


def test_every_rate_is_its_motion_per_second():
    rates = [symbol for symbol in _KNOWN if factor_of(symbol)[1].endswith("/s")]
    assert {"rpm", "deg/s", "mm/min", "counts/min"} <= set(rates)
    for symbol in rates:
        (of, si), (by, unit) = factor_of(symbol), integral_of(symbol)
        assert by * factor_of(unit)[0] == pytest.approx(of, rel=1e-12)
        assert si == f"{factor_of(unit)[1]}/s"
        assert factor_of(readable(symbol))[1] == si.removesuffix("/s")


@pytest.mark.parametrize("unit", ["N", "Nm", "A", "V", "m", "rad", "deg"])
def test_a_prefix_is_the_same_power_of_ten_on_every_unit(unit):
    powers = {"k": 3, "da": 1, "d": -1, "c": -2, "m": -3, "u": -6}
    known = {p: _KNOWN[p + unit] for p in powers if p + unit in _KNOWN and (p, unit) != ("d", "a")}
    assert len(known) >= 2
    for prefix, (by, si, _) in known.items():
        assert (by, si) == (pytest.approx(10.0 ** powers[prefix] * factor_of(unit)[0], rel=1e-12), factor_of(unit)[1])


@pytest.mark.parametrize("stated", ["foo·m", "dyn.cm", "¡", "Â°"])
def test_a_unit_that_is_not_known_is_quoted_and_no_other(stated):
    assert unit_in("", f"Winkel [{stated}]", "position") == stated


def test_a_position_in_nm_is_in_nanometres():
    assert factor_of(unit_for("position", unit_of("x [nm]"))) == (1e-9, "m")
    assert factor_of(unit_for("drive", unit_of("torque_nm"))) == (1.0, "Nm")
    assert stated({"position": "nm", "drive": "nm"}) == {"position": "nm", "drive": "Nm"}


@pytest.mark.parametrize("unit", ["inc/4096", "cts/4096", "4096 counts/rev", "4096 inc/turn", "4096 CPR"])
def test_the_counts_of_a_turn_have_many_spellings(unit):
    assert unit_of(f"Position [{unit}]") == "counts/4096"


@pytest.mark.parametrize("unit", ["counts/0", "counts/1e", "counts/x", "rad/4096", "0 CPR"])
def test_counts_of_no_turn_are_no_unit(unit):
    assert symbol_of(unit) is None


@pytest.mark.parametrize("unit", ["rad", "deg", "counts/4096", "ticks/4096"])
def test_a_turn_is_two_pi_in_any_angle(unit):
    assert turn_of(unit) * factor_of(unit)[0] == pytest.approx(2 * math.pi)


def test_spelling_and_case_do_not_matter_and_the_unknown_is_kept():
    assert symbol_of(" NM ") == symbol_of("nm") == "Nm"
    assert symbol_of("furlong") is None
    assert factor_of("furlong") == (1.0, "furlong")
    assert turn_of("Nm") is None


def test_roles_are_checked():
    assert stated({"output": "deg", "input": "A"}) == {"position": "deg", "drive": "A"}
    with pytest.raises(ValueError, match="expected one of time"):
        stated({"torque": "Nm"})
    with pytest.raises(ValueError, match="unit of time"):
        stated({"time": "deg"})


@pytest.mark.parametrize(("a", "b"), [("Nm", "mNm"), ("rad", "deg"), ("rad/s", "rpm"), ("mA", "A"), ("m", "mm")])
def test_there_and_back_is_one(a, b):
    assert factor_between(a, b) * factor_between(b, a) == pytest.approx(1.0)
    assert factor_between(a, b) * factor_of(b)[0] == pytest.approx(factor_of(a)[0])


@pytest.mark.parametrize(("a", "b"), [("A", "Nm"), ("rad", "m"), ("N", "Nm"), ("counts", "rad")])
def test_what_measures_something_else_is_refused(a, b):
    with pytest.raises(ValueError, match=f"{a} cannot be converted to {b}"):
        factor_between(a, b)


@pytest.mark.parametrize("unstated", ["", "as logged"])
def test_a_unit_that_nothing_tells_is_taken_for_si(unstated):
    assert factor_between("mNm", unstated) == pytest.approx(1e-3)
    assert factor_between(unstated, "mNm") == pytest.approx(1e3)


@pytest.mark.parametrize(
    ("unit", "told", "factor"),
    [
        ("Nm s/rad", "mNm s/deg", 1e-3 / math.radians(1)),
        ("Nm s2/rad2", "mNm s2/deg2", 1e-3 / math.radians(1) ** 2),
        ("Nm/rad3", "mNm/deg3", 1e-3 / math.radians(1) ** 3),
        ("rad/Nm", "deg/mNm", math.radians(1) * 1e3),
        ("rad/s", "deg/s", math.radians(1)),
        ("kg m²", "kg m²", 1.0),
        ("s", "s", 1.0),
        ("1", "1", 1.0),
    ],
)
def test_a_compound_unit_is_brought_over_symbol_by_symbol(unit, told, factor):
    assert respelled(unit, {"Nm": "mNm", "rad": "deg"}) == (pytest.approx(factor), told)


def test_inertia_has_a_name_where_the_drive_is_a_torque_or_a_force():
    assert [inertia_unit(*u) for u in (("Nm", "rad"), ("N", "m"), ("V", "rad"))] == ["kg m²", "kg", "V s²/rad"]
    assert respelled(inertia_unit("A", "rad"), {"A": "mA", "rad": "deg"})[1] == "mA s²/deg"


@pytest.mark.parametrize(("logged", "told"), [("deg", "deg"), ("counts/16384", "rad"), ("mm/s", "mm"), ("", "rad")])
def test_people_are_told_of_motions_and_not_of_counts(logged, told):
    assert readable(logged, "rad") == told


@pytest.mark.parametrize(
    ("role", "unit"), [("position", "banana"), ("position", "Nm"), ("drive", "Nn"), ("velocity", "V")]
)
def test_an_axis_takes_only_units_of_the_table(role, unit):
    with pytest.raises(ValueError, match=f"The unit of {role} is '{unit}'; expected one of"):
        of_an_axis(stated({role: unit}))
    of_an_axis(
        stated({"position": "nm", "drive": "0.01 Arms", "velocity": "rpm", "time": "ticks/8000", "reference": "deg"})
    )
