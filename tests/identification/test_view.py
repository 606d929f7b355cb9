"""A record as the candidates see it: what was logged, how noisy it is, what cannot be used."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from whsklearn.identification.view import derivative, held_out_from, noise_floor, view
from whsklearn.logs import LogError

RNG = np.random.default_rng(0)
U = RNG.standard_normal(2000)
VELOCITY = lfilter([0.0, 0.05], [1.0, -0.97], U)
POSITION = np.cumsum(VELOCITY) * 0.01


@pytest.mark.parametrize(("y", "logged"), [(POSITION, "position"), (VELOCITY, "output"), (U**2, "output")])
def test_a_position_is_told_from_what_returns_when_the_drive_is_gone(y, logged):
    assert view(U, y, 0.01, "auto").logged == logged


@pytest.mark.parametrize("seed", range(5))
def test_a_response_about_an_operating_point_is_no_position(seed):
    """A valve half open: drive and output are constants apart, and hunt about them."""
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(4000, 0.1)
    command = np.fft.irfft(np.exp(2j * np.pi * rng.random(f.size)) * ((f > 0.0) & (f < 0.5)), 4000)
    command = 50.0 + 20.0 * command / command.std()
    sticky, at = np.empty(4000), 50.0
    for k, wanted in enumerate(command):
        at = wanted - np.sign(wanted - at) if abs(wanted - at) > 3.0 else at
        sticky[k] = at
    flow = lfilter([0.05], [1.0, -0.95], sticky, zi=[0.95 * 50.0])[0] + 0.1 * rng.standard_normal(4000)
    assert view(command, flow, 0.1, "auto").logged == "output"
    assert view(command, 0.01 * np.cumsum(sticky - 49.0), 0.1, "auto").logged == "position"


def test_the_target_of_a_position_is_its_velocity():
    t = 0.01 * np.arange(500)
    seen = view(U[:500], np.sin(3 * t), 0.01, "position")
    assert seen.target[20:-20] == pytest.approx(3 * np.cos(3 * t)[20:-20], abs=0.01)
    assert seen.part(100, 150).target == pytest.approx(seen.target[100:150])
    assert view(U, VELOCITY, 0.01, "velocity").target == pytest.approx(VELOCITY)


def test_derivatives_of_a_parabola_are_exact():
    t = 0.02 * np.arange(200)
    first, second = derivative(1.0 + 2.0 * t - 3.0 * t**2, 0.02)
    assert first == pytest.approx(2.0 - 6.0 * t)
    assert second == pytest.approx(-6.0)


@pytest.mark.parametrize("sigma", [1e-4, 1e-2])
def test_the_noise_of_a_slow_output_is_seen(sigma):
    y = np.sin(0.01 * np.arange(5000)) + sigma * RNG.standard_normal(5000)
    assert noise_floor(y) == pytest.approx(sigma, rel=0.1)
    assert noise_floor(U) == 0.0  # of a fast output nothing can be said


@pytest.mark.parametrize(("change", "said"), [({"dt": 0.0}, "dt is 0.0"), ({"logged": "torque"}, "logged is 'torque'")])
def test_settings_that_cannot_be_are_refused(change, said):
    with pytest.raises(ValueError, match=said):
        view(U, VELOCITY, **{"dt": 0.01, "logged": "auto"} | change)


def test_the_last_30_percent_are_held_out_and_more_where_they_stand():
    assert held_out_from(POSITION) == held_out_from(U) == 1400
    rising = np.clip(np.linspace(0.0, 4.0, 1000), 0.0, 1.0)  # at rest from sample 250 on
    cut = held_out_from(rising + 1e-4 * RNG.standard_normal(1000))
    assert np.ptp(rising[cut:]) == pytest.approx(0.3, abs=0.01)
    assert held_out_from(np.append(1.0, np.zeros(199))) == 60  # what is fitted needs some samples


def test_a_unit_says_what_the_output_is():
    """A pendulum's angle returns without a drive, and a rotor without friction keeps its speed."""
    rng = np.random.default_rng(0)
    drive = np.cumsum(rng.standard_normal(3000)) / 20
    hung = lfilter([0.0, 1e-3], [1.0, -1.98, 0.985], drive)
    turning = np.cumsum(drive) / 50
    torque, angle, rate = (1.0, "Nm"), (1.0, "rad"), (1.0, "rad/s")
    known = view(drive, hung, 0.01, "auto", si=(torque, angle))
    assert (known.logged, known.settles) == ("position", True)
    assert known.as_response.logged == "output"
    np.testing.assert_array_equal(known.as_response.target, hung)
    assert view(drive, hung, 0.01, "auto").logged == "output"
    assert view(drive, hung, 0.01, "auto", si=(angle, angle)).logged == "output"  # a commanded position
    # no weight is carried by a command
    assert [view(drive, hung, 0.01, "auto", si=(u, angle)).angle for u in (torque, angle, rate)] == [True, False, False]
    assert view(drive, turning, 0.01, "auto").logged == "position"
    assert view(drive, turning, 0.01, "auto", si=(torque, rate)).logged == "output"
    assert view(drive, turning, 0.01, "auto", si=(torque, (1.0, "counts/s"))).logged == "output"


def test_too_short_a_record_is_not_said_to_have_holes():
    with pytest.raises(LogError, match="The record has 10 samples, where 30 are needed"):
        view(np.arange(10.0), np.arange(10.0) ** 2, 0.01, "auto", groups=np.zeros(10, dtype=int))
    with pytest.raises(LogError, match="Holes cut the record into 2 segments"):
        view(np.arange(20.0), np.arange(20.0) ** 2, 0.01, "auto", groups=np.repeat([0, 1], 10))


@pytest.mark.parametrize("grid", [0.0, 1e-3])
def test_a_position_without_travel_is_no_record_of_an_axis(grid):
    """The judgement of `whsklearn gap`; an output that need not be a position may be white."""
    noise = 1e-4 * np.random.default_rng(1).standard_normal(2000)
    still = np.round((noise + 5e-4) / grid) * grid if grid else noise
    torque, angle = (1.0, "Nm"), (1.0, "rad")
    for settings in ({"logged": "auto", "si": (torque, angle)}, {"logged": "position"}):
        with pytest.raises(LogError, match=r"^The axis hardly moves: .* or a record in which the axis moves\.$"):
            view(U, still, 0.01, **settings)
    assert view(U, still, 0.01, "auto").logged == "output"
    assert view(U, POSITION + noise, 0.01, "auto", si=(torque, angle)).logged == "position"
