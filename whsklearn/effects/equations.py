"""All equations of the catalogue as compiled functions of numbers, at weight one unless they are phased.

The effects' classes (`whsklearn.effects.friction` and its neighbours) say what an equation means, in which units and
ranges; `whsklearn.effects.rows` maps a code to an equation. Signs follow the torque
balance J a = tau - friction, so the drive must supply what is positive.  On a Wiener-Hammerstein system velocity is dx
= x(t) - x(t-1) of (4).

``s`` is sign(dx) and ``ds`` its slope: at rest the sign is a choice between two directions, and it is a tanh where a
gradient is needed.
"""

from __future__ import annotations

import math

from whsklearn._numba import njit, part
from whsklearn.effects import codes

_equation = njit(cache=False, error_model="numpy")

N_STATES = 8  # states of a memory of the path: the asperities of generalized Maxwell slip
AHEAD = N_STATES  # column after the states: the path travelled since the last advance, of all effects of an axis


# --- drive -----------------------------------------------------------------------------------------------------------
@_equation
def dead_zone(width, u):
    """What a dead zone takes from the drive, clip(u, -d, d)."""
    return clipped(u, width)


@_equation
def saturation(limit, u):
    """What a limit takes from the drive, u - clip(u, -U, U)."""
    return u - clipped(u, limit)


@_equation
def torque_ripple(cosine, sine, order, angle, u):
    """What ripple takes from the drive, u (c cos(k q) + s sin(k q))."""
    return u * wave(cosine, sine, order * angle)


@_equation
def lagged(u, state, constant, h):
    """Mean output over a step h, and the new state, of T du_eff/dt = u - u_eff under a constant u; exact."""
    if constant <= 0.0:
        return u, u
    decay = math.exp(-h / constant)
    return u + (state - u) * (1.0 - decay) * constant / h, u + (state - u) * decay


@_equation
def delayed(age):
    """Whole samples of a delay of ``age`` samples, and the weight of the drive one further sample back."""
    whole = math.floor(age)
    return int(whole), age - whole


# --- dry friction of a solver of contacts ----------------------------------------------------------------------------
@_equation
def early_stop(lead, impedance, inertia, h):
    """Mean torque over a step h per velocity by which early friction takes it, d J (1 - exp(-h / T)) / h, its share of
    what makes v decay with T, and the slope by T.
    """
    left = math.exp(-h / lead)
    return impedance * inertia * (1.0 - left) / h, -impedance * inertia * left / lead**2


@_equation
def early_friction(lead, impedance, inertia, pull, v, backwards, forwards, h):
    """Mean torque over a step h: the share d of what makes v decay with T, within the two that friction can take."""
    wanted = impedance * pull + early_stop(lead, impedance, inertia, h)[0] * v
    if wanted > forwards:
        return forwards
    return backwards if wanted < backwards else wanted


# --- friction as a function of velocity: value, slope by x, slope by dx ----------------------------------------------
UNDERFLOW = 700.0  # beyond this exp(-x) is below 1e-304 and takes ten times as long to compute


@_equation
def viscous(dx):
    """Dx."""
    return dx, 0.0, 1.0


@_equation
def coulomb(s, ds):
    """sign(dx)."""
    return s, 0.0, ds


@_equation
def asymmetric_coulomb(s, ds):
    """|sign(dx)|: one in motion, zero at rest."""
    return s * s, 0.0, 2.0 * s * ds


@_equation
def asymmetric_viscous(dx, s, ds):
    """|dx|."""
    return dx * s, 0.0, s + dx * ds


@_equation
def stribeck(velocity, exponent, dx, s, ds):
    """exp(-|dx / v_s|^delta) sign(dx)."""
    r = abs(dx) / velocity
    if r == 0.0:
        return s, 0.0, ds
    power = r**exponent
    if power > UNDERFLOW:
        return 0.0, 0.0, 0.0
    bump = math.exp(-power)
    slope = -bump * (exponent * power / abs(dx)) * (1.0 if dx > 0.0 else -1.0)  # divided early, while exp is computed
    return bump * s, 0.0, bump * ds + slope * s


@_equation
def reduced_stribeck(velocity, dx):
    """-tanh(dx / v_s)."""
    s = tanh(dx / velocity)
    return -s, 0.0, -(1.0 - s * s) / velocity


@_equation
def quadratic_drag(dx):
    """dx |dx|."""
    return dx * abs(dx), 0.0, 2.0 * abs(dx)


# --- terms of general laws: value, slope by x, slope by dx -----------------------------------------------------------
@_equation
def smooth_coulomb(velocity, dx):
    """tanh(dx / v): the smooth Coulomb term gamma_4 tanh(gamma_5 dx) of (3), with its derivatives."""
    s = tanh(dx / velocity)
    return s, 0.0, (1.0 - s * s) / velocity


@_equation
def smooth_stribeck(fast, slow, dx):
    """tanh(dx / fast) - tanh(dx / slow), with its derivatives: the Stribeck term of (3)."""
    p, _, slope_p = smooth_coulomb(fast, dx)
    q, _, slope_q = smooth_coulomb(slow, dx)
    return p - q, 0.0, slope_p - slope_q


@_equation
def power(degree, x):
    """x^k with its derivatives."""
    if degree == 0.0:
        return 1.0, 0.0, 0.0
    return x**degree, degree * x ** (degree - 1.0), 0.0


@_equation
def hinge(knot, x):
    """max(x - knot, 0) with its derivatives."""
    if x > knot:
        return x - knot, 1.0, 0.0
    return 0.0, 0.0, 0.0


@_equation
def natural_spline(knot, last_but_one, last, x):
    """d_k(x) - d_m(x) with d_k = ((x - k)_+^3 - (x - l)_+^3) / (l - k); a straight line beyond the last knot."""
    if x <= knot:
        return 0.0, 0.0, 0.0
    p, q, m = x - knot, x - last_but_one, last - last_but_one
    if x >= last:  # in closed form, because the cubes cancel there
        slope = 3.0 * (last_but_one - knot)
        width = last - knot
        return width * width - m * m + slope * (x - last), slope, 0.0
    value, slope = p * p * p / (last - knot), 3.0 * p * p / (last - knot)
    if q > 0.0:
        value -= q * q * q / m
        slope -= 3.0 * q * q / m
    return value, slope, 0.0


@_equation
def speed_hinge(knot, dx):
    """sign(dx) max(|dx| - knot, 0) with its derivatives."""
    if dx > knot:
        return dx - knot, 0.0, 1.0
    if dx < -knot:
        return dx + knot, 0.0, 1.0
    return 0.0, 0.0, 0.0


# --- friction that varies with the load, with position, with time ----------------------------------------------------
@_equation
def load_friction(drive, s, ds):
    """|u| sign(v) and its slope by v."""
    return abs(drive) * s, abs(drive) * ds


@_equation
def position_friction(cosine, sine, order, x, s, ds):
    """(c cos(k x) + d sin(k x)) sign(dx)."""
    level = wave(cosine, sine, order * x)
    return s * level, s * order * wave(sine, -cosine, order * x), ds * level


@_equation
def friction_drift(time_constant, time, s, ds):
    """(1 - exp(-t/T)) sign(v) and its slope by v."""
    level = 1.0 - math.exp(-time / time_constant)
    return level * s, level * ds


# --- friction before sliding: states z, a memory of the path ---------------------------------------------------------
@_equation
def stribeck_level(ratio, velocity, v):
    """g(v) = 1 + (ratio - 1) exp(-(v/v_s)^2): the level of friction over its value at speed."""
    return 1.0 + (ratio - 1.0) * math.exp(-((v / velocity) ** 2))


@_equation
def dahl(z, s, path):
    """z after a path of ``path`` presliding distances in the direction s: dz/dx = (1 - z sign(v)) / x_s, exact."""
    return s + (z - s) * math.exp(-path)


@part
def advance_hysteresis(code, p, z, k, dx, v):
    """Move the states z[k] along a path dx travelled at velocity v; exact for a constant v."""
    if dx == 0.0:
        return
    s = 1.0 if dx > 0.0 else -1.0
    r = abs(dx) / p[k, 1]
    if code == codes.DAHL:
        z[k, 0] = dahl(z[k, 0], s, r)
    elif code == codes.LUGRE:
        g = stribeck_level(p[k, 2], p[k, 3], v)
        z[k, 0] = g * dahl(z[k, 0] / g, s, r / g)
    elif code == codes.BOUC_WEN:
        w = z[k, 0] * s
        a = 1.0 if w >= 0.0 else 2.0 * p[k, 2] - 1.0
        w = w + r if abs(a) < 1e-9 else 1.0 / a + (w - 1.0 / a) * math.exp(-a * r)
        z[k, 0] = s * w
    else:
        n = int(p[k, 2])
        g = stribeck_level(p[k, 3], p[k, 4], v)
        for i in range(n):
            z[k, i] = min(g, max(-g, z[k, i] + s * r * (n + 1.0) / (2.0 * (i + 1.0))))


@part
def hysteresis_torque(code, p, z, k, v):
    """z[k], with LuGre's damping of the asperities, and its derivative by velocity."""
    if code == codes.MAXWELL_SLIP:
        n = int(p[k, 2])
        total = 0.0
        for i in range(n):
            total += z[k, i]
        return total / n, 0.0
    if code == codes.LUGRE and p[k, 4] > 0.0:
        g = stribeck_level(p[k, 2], p[k, 3], v)
        slope = p[k, 4] / p[k, 1] * (1.0 - (z[k, 0] if v > 0.0 else -z[k, 0]) / g)
        return z[k, 0] + slope * v, slope
    return z[k, 0], 0.0


# --- position --------------------------------------------------------------------------------------------------------
@_equation
def cable_spring(stiffness, centre, angle):
    """c (q - q_0) (Nm)."""
    return stiffness * (angle - centre)


@_equation
def hardening_spring(stiffness, centre, angle):
    """c (q - q_0)^3 (Nm)."""
    deflection = angle - centre
    return stiffness * deflection * deflection * deflection


@_equation
def end_stop(stiffness, limit, relaxation, side, angle, velocity):
    """k max(d + tau dd/dt, 0) in contact, d = side q - q_s > 0: it pushes and never pulls (Nm)."""
    depth = side * angle - limit
    if depth <= 0.0:
        return 0.0
    return side * stiffness * max(depth + relaxation * side * velocity, 0.0)


# --- sensor ----------------------------------------------------------------------------------------------------------
@_equation
def output_drift(rate, time):
    """c t (rad)."""
    return rate * time


@_equation
def sensor_rectification(fraction, angle):
    """f (|q| - q), the error in the reading of a sensor that loses the sign (rad)."""
    return fraction * (abs(angle) - angle)


@_equation
def quantized(step, reading):
    """s round(q / s); the reading itself at step zero."""
    return step * math.floor(reading / step + 0.5) if step > 0.0 else reading


# --- time ------------------------------------------------------------------------------------------------------------
@_equation
def disturbance_tone(cosine, sine, frequency, time):
    """A cos(2 pi f t + phi) by its cosine and its sine weight (Nm)."""
    return wave(cosine, sine, 2.0 * math.pi * frequency * time)


@_equation
def parameter_change(change, start, time, regressor):
    """c r(t) from t_0 on, t_0 included; r is the regressor of the parameter that changes."""
    return change * regressor if time >= start else 0.0


# --- learned curves --------------------------------------------------------------------------------------------------
@part
def hill(z):
    """The cubic B-spline on knots -2, -1, 0, 1, 2, scaled to one at zero (de Boor 1978, ch. IX)."""
    z = abs(z)
    if z >= 2.0:
        return 0.0
    if z >= 1.0:
        return 0.25 * (2.0 - z) ** 3
    return 1.0 - 1.5 * z * z + 0.75 * z * z * z


@part
def distance(x, centre, period):
    """x - centre, taken the short way round if the signal has a period above zero."""
    d = x - centre
    if period > 0.0:
        d -= period * math.floor(d / period + 0.5)
    return d


@part
def learned_torque(code, centre, width, period, q, v, s, ds, u):
    """Torque per unit of height, and its slope by velocity where a sign changes at rest."""
    if code == codes.LEARNED_SPEED:
        h = hill(distance(abs(v), centre, 0.0) / width)
        return h * s, h * ds
    if code == codes.LEARNED_VELOCITY:
        return hill(distance(v, centre, 0.0) / width), 0.0
    if code == codes.LEARNED_DRIVE:
        return hill(distance(u, centre, 0.0) / width), 0.0
    h = hill(distance(q, centre, period) / width)
    if code == codes.LEARNED_FRICTION:
        return h * s, h * ds
    if code == codes.LEARNED_DAMPING:
        return h * v, h
    return h, 0.0


# --- shared by several equations ------------------------------------------------------------------------------------
AT_REST = 1e-6


@part
def tanh(z):
    """The hyperbolic tangent to three units in the last place, in half of the C library's time.

    (1 - q) / (1 + q) with q = exp(-2 |z|); near zero, where that cancels, its Taylor series.
    """
    s = z * z
    if s < 0.01:
        r = 62.0 / 2835.0 + s * (-1382.0 / 155925.0 + s * (21844.0 / 6081075.0 - s * (929569.0 / 638512875.0)))
        return z * (1.0 + s * (-1.0 / 3.0 + s * (2.0 / 15.0 + s * (-17.0 / 315.0 + s * r))))
    q = math.exp(-2.0 * abs(z))
    return math.copysign((1.0 - q) / (1.0 + q), z)


@part
def smooth_sign(dx, kappa):
    """sign(dx) and its slope; tanh(kappa dx) for a finite kappa, the sign with that slope for -kappa."""
    if kappa == math.inf:
        return (1.0 if dx > 0.0 else (-1.0 if dx < 0.0 else 0.0)), 0.0
    z = kappa * dx
    if abs(z) > 20.0:  # there tanh is one to the last bit, as for most samples of a sharp sign
        return (1.0 if dx > 0.0 else -1.0), 0.0
    s = tanh(z)
    if kappa < 0.0:
        # the tail of a motion that has long decayed, such as 1e-20, counts as rest and has no sign
        return (0.0 if abs(z) < AT_REST else (1.0 if dx > 0.0 else -1.0)), -kappa * (1.0 - s * s)
    return s, kappa * (1.0 - s * s)


@njit(cache=False, error_model="numpy")
def wave(cosine, sine, argument):
    """``cosine`` cos(argument) + ``sine`` sin(argument), which is A cos(argument + phi) with A e^(i phi) = c - i s."""
    return cosine * math.cos(argument) + sine * math.sin(argument)


@njit(cache=False, error_model="numpy")
def clipped(value, limit):
    """clip(value, -limit, limit)."""
    return min(limit, max(-limit, value))
