/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors */

/*
 * A triangular root of the covariance, P = R' R, R upper triangular in rows. Prediction: Householder's triangulation of
 * [R phi'; root of Q], of which column j is 0 below row N + j. Measurements one by one, as Carlson (1973) has it.
 */

#include "rival.h"

static rival_model_t self;
static float x[N];
static float root[N][N];
static float tall[2U * N][N];
static float noise_root[N];

static float root_of(float v)
{
    return __builtin_sqrtf(v);
}

static void triangulate(void)
{
    for (size_t j = 0U; j < N; j++) {
        float sum = 0.0F;
        for (size_t k = j; k <= (N + j); k++) {
            sum += tall[k][j] * tall[k][j];
        }
        const float length = root_of(sum);
        const float head = tall[j][j];
        const float to = (head < 0.0F) ? length : -length;
        const float inverse = 1.0F / (sum - (head * to));
        tall[j][j] = head - to;
        for (size_t c = j + 1U; c < N; c++) {
            float share = 0.0F;
            for (size_t k = j; k <= (N + j); k++) {
                share += tall[k][j] * tall[k][c];
            }
            share *= inverse;
            for (size_t k = j; k <= (N + j); k++) {
                tall[k][c] -= share * tall[k][j];
            }
            root[j][c] = tall[j][c];
        }
        root[j][j] = to;
    }
}

static void predict(const float *noise)
{
    for (size_t i = 0U; i < N; i++) {
        for (size_t j = 0U; j < N; j++) {
            float sum = 0.0F;
            for (size_t k = i; k < N; k++) {
                sum += root[i][k] * self.step.x_x[j][k];
            }
            tall[i][j] = sum;
            tall[N + i][j] = ((i == j) && (noise != NONE)) ? noise_root[i] : 0.0F;
        }
    }
    triangulate();
}

static void use(const float h[N], float miss, float r, float dx[N])
{
    float sum[N] = { 0.0F };
    float before = r;
    float before_root = root_of(r);
    float nu = miss;

    for (size_t j = N; j > 0U; j--) {
        float *const row = root[j - 1U];
        float along = 0.0F;
        for (size_t k = j - 1U; k < N; k++) {
            along += row[k] * h[k];
        }
        const float now = before + (along * along);
        const float now_root = root_of(now);
        const float keep = before_root / now_root;
        const float take = along / (before_root * now_root);
        for (size_t k = j - 1U; k < N; k++) {
            const float old = row[k];
            row[k] = (keep * old) - (take * sum[k]);
            sum[k] += along * old;
        }
        before = now;
        before_root = now_root;
        nu -= h[j - 1U] * dx[j - 1U];
    }
    for (size_t i = 0U; i < N; i++) {
        dx[i] += sum[i] * (nu / before);
    }
}

void rival_init(void)
{
    rival_begin(&self);
    for (size_t i = 0U; i < N; i++) {
        for (size_t j = 0U; j < N; j++) {
            root[i][j] = (i == j) ? root_of(START[i]) : 0.0F;
        }
        noise_root[i] = root_of(NOISE[i]);
    }
}

void rival_step(const costly_u_t *u, const costly_ekf_z_t *z)
{
    const float *const noise = rival_predict(&self, u, z, x);
    float dx[N] = { 0.0F };

    predict(noise);
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
    float sum = 0.0F;

    for (size_t k = 0U; k <= i; k++) {
        sum += root[k][i] * root[k][i];
    }
    return sum;
}

uint32_t rival_bytes(void)
{
    return (uint32_t)((sizeof(self) - sizeof(self.model)) + sizeof(x) + sizeof(root) + sizeof(tall) + sizeof(noise_root));
}
