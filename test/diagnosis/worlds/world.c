/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors
 *
 * Coordinates q with inertia m, places with deflection s = A (q, u), laws f(s, v) with one state each, Kutta's 3/8 rule.
 * m q'' = -A' f + G u + ext; u, du, ext are given at every step and joined by straight lines. */
#include <math.h>

enum {
    LINEAR,
    WAVE,
    RUB,
    ATAN,
    STRIBECK,
    POWER,
    ONE_SIDE,
    STOP,
    PLAY,
    SKEW,
    KNEE,
    FADE,
    HYSTERESIS,
    MAXWELL,
    LIFT,
    PRESSED,
    AERATED,
    SINE,
    MOUNT,
    CONSTANT
};
#define WIDE 8 /* parameters a law */
#define ROOM 64

typedef struct {
    int n, nu, np, nl;
    const double *m, *A, *G;
    const int *type, *place;
    const double *p;
} world_t;

static double ramp(double x, double e)
{
    return 0.5 * (x + sqrt(x * x + e * e));
} /* max(x, 0), rounded */

/* Force of a law; its state w changes at *dw. */
static double law(int type, const double *p, double s, double v, double w, double t, double *dw)
{
    double x;
    *dw = 0.0;
    switch (type) {
    case LINEAR: return p[0] * s + p[1] * v;
    case WAVE: return p[0] * (sin(s / p[1] + p[2]) - sin(p[2]));
    case RUB: return p[0] * v / sqrt(v * v + p[1] * p[1]);
    case ATAN: return p[0] * 0.6366197723675814 * atan(v / p[1]);
    case STRIBECK: return p[0] * (1.0 + p[3] / (1.0 + v * v / (p[2] * p[2]))) * v / sqrt(v * v + p[1] * p[1]);
    case POWER: return p[2] > 0.0 ? p[0] * v * fabs(v) : p[0] * s * s * s;
    case ONE_SIDE: return -p[0] * (ramp(-s, p[1]) - 0.5 * p[1]); /* stiffer in compression by p0 */
    case STOP: return p[2] * p[0] * (ramp(p[2] * s - p[1], p[3]) - ramp(-p[1], p[3]));
    case PLAY: x = s / p[1] * (s / p[1]); return -p[0] * s / sqrt(sqrt(sqrt(1.0 + x * x * x * x)));
    case SKEW: return p[0] * (sqrt(v * v + p[1] * p[1]) - p[1]);
    case KNEE: return -p[0] * (v - p[1] * asinh(v / p[1]));
    case FADE: return -p[0] * v * (t < p[1] ? t / p[1] : 1.0);
    case HYSTERESIS: *dw = (v - 0.5 * w * (fabs(v) * fabs(w) + v * w)) / p[1]; return p[0] * w;
    case MAXWELL: *dw = v - w / p[1]; return p[0] * w;
    case LIFT: return -p[0] * ramp(s - p[1], p[2]);
    case PRESSED: x = ramp(-s, p[1]); return -p[0] * x * x;
    case AERATED: /* oil p0 in series with a pocket of gas, half as wide as p1, p2 at its wall */
        x = w / p[1];
        x = p[2] * x * (1.0 + 25.0 * x * x * x * x * x * x);
        *dw = v - x / p[0];
        return x - p[0] * v;
    case SINE: return p[0] * sin(s) + p[1] * v;
    case MOUNT: /* damper p0 on a flexible mount p1; w is the stretch of the mount */ *dw = v - p[1] * w / p[0]; return p[1] * w - p[0] * v;
    default: return p[0];
    }
}

static void rates(const world_t *a, const double *y, const double *u, const double *du, const double *ext, double t, double *dy,
                  double *force)
{
    const int n = a->n, wide = n + a->nu;
    for (int i = 0; i < n; ++i) {
        dy[i] = y[n + i];
        dy[n + i] = ext[i];
        for (int k = 0; k < a->nu; ++k) dy[n + i] += a->G[i * a->nu + k] * u[k];
    }
    for (int l = 0; l < a->nl; ++l) {
        const double *row = a->A + a->place[l] * wide;
        double s = 0.0, v = 0.0;
        for (int i = 0; i < n; ++i) s += row[i] * y[i], v += row[i] * y[n + i];
        for (int k = 0; k < a->nu; ++k) s += row[n + k] * u[k], v += row[n + k] * du[k];
        force[l] = law(a->type[l], a->p + l * WIDE, s, v, y[2 * n + l], t, &dy[2 * n + l]);
        for (int i = 0; i < n; ++i) dy[n + i] -= row[i] * force[l];
    }
    for (int i = 0; i < n; ++i) dy[n + i] /= a->m[i];
}

/* out: per sample q, q', q'', forces. Returns 0, or 1 if it ran away. */
int world_run(int n, int nu, int np, int nl, const double *m, const double *A, const double *G, const int *type, const int *place,
              const double *p, const double *u, const double *du, const double *ext, const double *start, long steps, double h, int every,
              double *out)
{
    const world_t a = { n, nu, np, nl, m, A, G, type, place, p };
    const int size = 2 * n + nl;
    const double at[4] = { 0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0 };
    double y[ROOM] = { 0 }, z[ROOM], k[4][ROOM], force[ROOM], un[ROOM], dun[ROOM], en[ROOM];
    if (size > ROOM) return 1;
    for (int i = 0; i < 2 * n; ++i) y[i] = start[i];
    for (long j = 0; j <= steps; ++j) {
        for (int stage = 0; stage < 4; ++stage) {
            const double x = j < steps ? at[stage] : 0.0;
            const long next = j < steps ? j + 1 : j;
            for (int i = 0; i < nu; ++i) {
                un[i] = u[j * nu + i] + x * (u[next * nu + i] - u[j * nu + i]);
                dun[i] = du[j * nu + i] + x * (du[next * nu + i] - du[j * nu + i]);
            }
            for (int i = 0; i < n; ++i) en[i] = ext[j * n + i] + x * (ext[next * n + i] - ext[j * n + i]);
            for (int i = 0; i < size; ++i) {
                z[i] = y[i];
                if (stage == 1) z[i] += h / 3.0 * k[0][i];
                if (stage == 2) z[i] += h * (k[1][i] - k[0][i] / 3.0);
                if (stage == 3) z[i] += h * (k[0][i] - k[1][i] + k[2][i]);
            }
            rates(&a, z, un, dun, en, ((double)j + x) * h, k[stage], force);
            if (stage == 0 && j % every == 0) {
                double *o = out + (j / every) * (3 * n + nl);
                for (int i = 0; i < 2 * n; ++i) o[i] = y[i];
                for (int i = 0; i < n; ++i) o[2 * n + i] = k[0][n + i];
                for (int l = 0; l < nl; ++l) o[3 * n + l] = force[l];
            }
        }
        for (int i = 0; i < size; ++i) {
            y[i] += h / 8.0 * (k[0][i] + 3.0 * (k[1][i] + k[2][i]) + k[3][i]);
            if (!(fabs(y[i]) < 1e9)) return 1;
        }
    }
    return 0;
}
