/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/* Whole matrices, measurements one by one: P = (1 - k h') P (1 - k h')' + r k k'. */

#include "rival.h"

static rival_model_t self;
static float x[N];
static float p[N][N];

static void product(float a[N][N], float b[N][N], float c[N][N]) /* c = a b */
{
    for (size_t i = 0U; i < N; i++) {
        for (size_t j = 0U; j < N; j++) {
            float sum = 0.0F;
            for (size_t k = 0U; k < N; k++) {
                sum += a[i][k] * b[k][j];
            }
            c[i][j] = sum;
        }
    }
}

static void product_across(float a[N][N], float b[N][N], float c[N][N]) /* c = a b' */
{
    for (size_t i = 0U; i < N; i++) {
        for (size_t j = 0U; j < N; j++) {
            float sum = 0.0F;
            for (size_t k = 0U; k < N; k++) {
                sum += a[i][k] * b[j][k];
            }
            c[i][j] = sum;
        }
    }
}

static void use(const float h[N], float miss, float r, float dx[N])
{
    float gain[N];
    float keep[N][N];
    float part[N][N];
    float s = r;
    float nu = miss;

    for (size_t i = 0U; i < N; i++) {
        gain[i] = 0.0F;
        for (size_t j = 0U; j < N; j++) {
            gain[i] += p[i][j] * h[j];
        }
        s += h[i] * gain[i];
        nu -= h[i] * dx[i];
    }
    for (size_t i = 0U; i < N; i++) {
        gain[i] /= s;
        dx[i] += gain[i] * nu;
        for (size_t j = 0U; j < N; j++) {
            keep[i][j] = ((i == j) ? 1.0F : 0.0F) - (gain[i] * h[j]);
        }
    }
    product(keep, p, part);
    product_across(part, keep, p);
    for (size_t i = 0U; i < N; i++) {
        for (size_t j = 0U; j < N; j++) {
            p[i][j] += (r * gain[i]) * gain[j];
        }
    }
}

void rival_init(void)
{
    rival_begin(&self);
    for (size_t i = 0U; i < N; i++) {
        for (size_t j = 0U; j < N; j++) {
            p[i][j] = (i == j) ? START[i] : 0.0F;
        }
    }
}

void rival_step(const costly_u_t *u, const costly_ekf_z_t *z)
{
    const float *const noise = rival_predict(&self, u, z, x);
    float part[N][N];
    float dx[N] = { 0.0F };

    product(self.step.x_x, p, part);
    product_across(part, self.step.x_x, p);
    for (size_t i = 0U; i < N; i++) {
        p[i][i] += noise[i];
    }
    for (size_t i = 0U; i < M; i++) {
        use(self.sense.z_x[i], self.miss[i], VARIANCE[i], dx);
    }
    for (size_t i = 0U; i < N; i++) {
        x[i] += dx[i];
    }
    rival_correct(&self, x);
}

float rival_state(size_t i)
{
    return x[i];
}

float rival_variance(size_t i)
{
    return p[i][i];
}

uint32_t rival_bytes(void)
{
    return (uint32_t)((sizeof(self) - sizeof(self.model)) + sizeof(x) + sizeof(p));
}
