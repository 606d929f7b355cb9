/* The recursions of the speed table in plain C: the same arithmetic as whsklearn's kernels, the orders of Example 5.1
   fixed when it is compiled; with AT_RUN_TIME the loops of RMILS run to variables, as those of a library must.
   `_c_reference.py` compiles it with -O3 and calls it through ctypes. */

#include <math.h>
#include <string.h>

enum { ROOM_B = 2, ROOM_C = 2, ROOM_P = 4, ROOM_1 = 3, ROOM_V = 6, ROOM = 9 };  /* of Example 5.1, p = 4 */
#ifdef AT_RUN_TIME
int NA = 2, NB = 2, NC = 2, ND = 2, NW = 3, P = 4, N1 = 3, NV = 6, N = 9;  /* not static: anybody may change them */
#else
enum { NA = 2, NB = 2, NC = 2, ND = 2, NW = 3, P = 4 };
enum { N1 = NA - 1 + NB, NV = N1 + NW, N = NV + NC - 1 + ND };
#endif

/* P = U D U', D on the diagonal, columns of U as rows below it (Bierman 1977, ch. V); returns phi' P phi + r. */
static double measurement_update(double *ud, const double *phi, double r, double *gain, int n)
{
    double alpha = r;
    for (int j = 0; j < n; j++) {
        double *row = ud + j * n, f = phi[j];
        for (int i = 0; i < j; i++)
            f += row[i] * phi[i];
        double d = row[j], g = d * f, before = alpha;
        alpha += f * g;
        row[j] = d * (before / alpha);
        gain[j] = g;
        double shift = -f / before;
        for (int i = 0; i < j; i++) {
            double u = row[i];
            row[i] = u + shift * gain[i];
            gain[i] += g * u;
        }
    }
    for (int j = 0; j < n; j++)
        gain[j] /= alpha;
    return alpha;
}

/* Recursive least squares, one row after another; theta (n,) and ud (n, n) change in place. */
void rls_rows(double *theta, double *ud, const double *rows, const double *y, long count, int n)
{
    double gain[64];
    for (long t = 0; t < count; t++) {
        const double *phi = rows + t * n;
        double e = y[t];
        for (int k = 0; k < n; k++)
            e -= phi[k] * theta[k];
        measurement_update(ud, phi, 1.0, gain, n);
        for (int k = 0; k < n; k++)
            theta[k] += gain[k] * e;
    }
}

/* The same for many axes, one after another. */
void rls_axes(double *theta, double *ud, const double *rows, const double *y, long axes, long count, int n)
{
    for (long a = 0; a < axes; a++)
        rls_rows(theta + a * n, ud + a * n * n, rows + a * count * n, y + a * count, count, n);
}

/* Eight axes abreast, which the compiler turns into vector instructions: state and samples have the axis last. */
enum { ABREAST = 8, NINE = 9 };
typedef double lanes[ABREAST];

static void rls_abreast(lanes *theta, lanes *ud, const double *rows, const double *y, long count)
{
    lanes phi[NINE], gain[NINE], e, f, g, alpha, before, shift;
    for (long t = 0; t < count; t++) {
        for (int l = 0; l < ABREAST; l++) {
            e[l] = y[l * count + t];
            alpha[l] = 1.0;
        }
        for (int k = 0; k < NINE; k++)
            for (int l = 0; l < ABREAST; l++) {
                phi[k][l] = rows[(l * count + t) * NINE + k];
                e[l] -= phi[k][l] * theta[k][l];
            }
        for (int j = 0; j < NINE; j++) {
            lanes *row = ud + j * NINE;
            memcpy(f, phi[j], sizeof f);
            for (int i = 0; i < j; i++)
                for (int l = 0; l < ABREAST; l++)
                    f[l] += row[i][l] * phi[i][l];
            for (int l = 0; l < ABREAST; l++) {
                g[l] = row[j][l] * f[l];
                before[l] = alpha[l];
                alpha[l] += f[l] * g[l];
                row[j][l] *= before[l] / alpha[l];
                gain[j][l] = g[l];
                shift[l] = -f[l] / before[l];
            }
            for (int i = 0; i < j; i++)
                for (int l = 0; l < ABREAST; l++) {
                    double u = row[i][l];
                    row[i][l] = u + shift[l] * gain[i][l];
                    gain[i][l] += g[l] * u;
                }
        }
        for (int k = 0; k < NINE; k++)
            for (int l = 0; l < ABREAST; l++)
                theta[k][l] += gain[k][l] / alpha[l] * e[l];
    }
}

/* Nine regressors; `axes` a multiple of eight, each from theta = 0 and P = p0 I. */
void rls_axes_abreast(double *theta, const double *rows, const double *y, long axes, long count, double p0)
{
    lanes t[NINE], ud[NINE * NINE];
    for (long a = 0; a < axes; a += ABREAST) {
        memset(t, 0, sizeof t);
        memset(ud, 0, sizeof ud);
        for (int j = 0; j < NINE; j++)
            for (int l = 0; l < ABREAST; l++)
                ud[j * NINE + j][l] = p0;
        rls_abreast(t, ud, rows + a * count * NINE, y + a * count, count);
        for (int l = 0; l < ABREAST; l++)
            for (int k = 0; k < NINE; k++)
                theta[(a + l) * NINE + k] = t[k][l];
    }
}

/* State of one model: x(t-1) ..., dx/dtheta of each, v(t-1) ..., dv/dtheta of each. */
typedef struct {
    double x[ROOM_B], gx[ROOM_B][ROOM_1], v[ROOM_C], gv[ROOM_C][ROOM_V];
} state;

static double fast_tanh(double z)
{
    double s = z * z;
    if (s < 0.01) {
        double r = 62.0 / 2835.0 + s * (-1382.0 / 155925.0 + s * (21844.0 / 6081075.0 - s * (929569.0 / 638512875.0)));
        return z * (1.0 + s * (-1.0 / 3.0 + s * (2.0 / 15.0 + s * (-17.0 / 315.0 + s * r))));
    }
    double q = exp(-2.0 * fabs(z));
    return copysign((1.0 - q) / (1.0 + q), z);
}

static double predict(const double *theta, const state *s, const double *y_past, double *psi)
{
    double y_hat = s->v[0];
    for (int k = 0; k < NV; k++)
        psi[k] = s->gv[0][k];
    for (int m = 1; m < NC; m++) {
        double c = theta[NV + m - 1];
        y_hat += c * s->v[m];
        psi[NV + m - 1] = s->v[m];
        for (int k = 0; k < NV; k++)
            psi[k] += c * s->gv[m][k];
    }
    for (int i = 0; i < ND; i++) {
        y_hat -= theta[NV + NC - 1 + i] * y_past[i];
        psi[NV + NC - 1 + i] = -y_past[i];
    }
    return y_hat;
}

/* One sample on, law (4): viscous, Coulomb with tanh(kappa dx), reduced Stribeck; returns dx. */
static double advance(const double *theta, state *s, const double *u_past, double kappa)
{
    double x = u_past[0], g[ROOM_1];
    for (int m = NC - 1; m > 0; m--) {
        s->v[m] = s->v[m - 1];
        memcpy(s->gv[m], s->gv[m - 1], sizeof s->gv[m]);
    }
    for (int i = 1; i < NA; i++)
        x += theta[i - 1] * u_past[i];
    for (int j = 0; j < NB; j++)
        x -= theta[NA - 1 + j] * s->x[j];
    double dx = x - s->x[0], z = kappa * dx, sign, slope;
    if (fabs(z) > 20.0) {
        sign = dx > 0.0 ? 1.0 : -1.0;
        slope = 0.0;
    } else {
        sign = fast_tanh(z);
        slope = kappa * (1.0 - sign * sign);
    }
    double curve = fast_tanh(dx);
    const double *w = theta + N1;
    s->v[0] = w[0] * dx + w[1] * sign - w[2] * curve;
    double by_dx = w[0] + w[1] * slope - w[2] * (1.0 - curve * curve);
    s->gv[0][N1] = dx;
    s->gv[0][N1 + 1] = sign;
    s->gv[0][N1 + 2] = -curve;
    for (int k = 0; k < N1; k++) {
        g[k] = k < NA - 1 ? u_past[k + 1] : -s->x[k - (NA - 1)];
        for (int j = 0; j < NB; j++)
            g[k] -= theta[NA - 1 + j] * s->gx[j][k];
        s->gv[0][k] = by_dx * (g[k] - s->gx[0][k]);
    }
    for (int j = NB - 1; j > 0; j--) {
        memcpy(s->gx[j], s->gx[j - 1], sizeof g);
        s->x[j] = s->x[j - 1];
    }
    memcpy(s->gx[0], g, sizeof g);
    s->x[0] = x;
    return dx;
}

/* theta += gain e, halved until L1 is stable; what `_step` of subinnovations.py does. */
static void step(double *theta, const double *gain, double e)
{
    double old[ROOM], scale = 1.0;
    memcpy(old, theta, sizeof old);
    for (int halving = 0; halving < 10; halving++, scale *= 0.5) {
        int ok = 1;
        for (int k = 0; k < N; k++) {
            theta[k] = old[k] + scale * gain[k] * e;
            ok &= fabs(theta[k]) < 1e8;
        }
        double first = theta[NA - 1] / 0.999, second = theta[NA] / (0.999 * 0.999);
        if (ok && fabs(second) < 1.0 && fabs(first) < 1.0 + second)
            return;
    }
    memcpy(theta, old, sizeof old);
}

/* RMILS, p = 4, exact gradient, one start from theta and P0 I: forgetting from 0.95 to 1, kappa rising to 80. */
void rmils(double *theta, double p0, const double *u, const double *y, long count)
{
    double ud[ROOM * ROOM] = {0}, psi[ROOM], gain[ROOM], loss = 0.0, norm = 0.0, moved = 0.0, moves = 0.0;
    double recent_u[ROOM_P + 2] = {0}, recent_y[ROOM_P + 2] = {0}, forgetting = 0.95, sharpness = 1.0;
    state before = {0};
    for (int j = 0; j < N; j++)
        ud[j * N + j] = p0;
    for (long t = 0; t < count; t++) {
        memmove(recent_u + 1, recent_u, sizeof recent_u - sizeof(double));
        memmove(recent_y + 1, recent_y, sizeof recent_y - sizeof(double));
        recent_u[0] = u[t];
        recent_y[0] = y[t];
        int window = t + 1 < P ? (int)(t + 1) : P;
        forgetting += (1.0 - 0.99) * (1.0 - forgetting);
        if (forgetting != 1.0)
            for (int j = 0; j < N; j++)
                if (ud[j * N + j] < 1e3 * p0)
                    ud[j * N + j] = fmin(ud[j * N + j] * (1.0 / forgetting), 1e3 * p0);
        for (int i = 0; i < window; i++) {
            int now = window - 1 - i;
            state work = before;
            for (int k = window - 1; k > now; k--)
                advance(theta, &work, recent_u + k + 1, sharpness);
            double e = recent_y[now] - predict(theta, &work, recent_y + now + 1, psi), size = fabs(e);
            for (int k = 0; k < N; k++)
                size += fabs(psi[k]);
            int usable = size < 1e60;
            if (now == 0) {
                loss = 0.995 * loss + (usable ? e * e : 1e60);
                norm = 0.995 * norm + 1.0;
            }
            if (usable) {
                measurement_update(ud, psi, P, gain, N);
                step(theta, gain, e);
            }
        }
        if (t + 1 >= P) {
            double dx = advance(theta, &before, recent_u + P, sharpness);
            moved = 0.995 * moved + dx * dx;
            moves = 0.995 * moves + 1.0;
        }
        double rising = fmin(fmax(pow((t + 1) / 32.0, 1.75), 1.0), 80.0);
        sharpness = rising / fmax(sqrt(moved / fmax(moves, 1.0)), 1e-12);
    }
}
