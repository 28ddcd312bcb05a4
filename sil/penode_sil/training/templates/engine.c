/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors
 *
 * Simulation of a model with the exact sensitivities of its discrete step, for training on the host. Included after the C of its physics.
 *
 * A step of a Runge-Kutta method is affine in the sensitivities: S1 = Phi S0 + sum over stages of W_s b_s, where b_s is what a stage
 * adds for each column. Phi and W_s [states][states] are made once a step, so a column costs two small products, whatever the method.
 */
#define MOST_INPUTS 8
/* One evaluation: all networks, then f (rates or sensors) and, for columns, its total derivatives A by states, P by parameters, B by calls. */
typedef struct {
    double N[N_N + 1], slope[N_N + 1][MOST_INPUTS], D[N_N + 1][N_N + 1], nx[N_N + 1][N_X + 1], np[N_N + 1][N_F + 1];
    int touched[N_N + 1][2];
} calls_t;

static void evaluate_calls(const job_t *job, double *const zero[], const double *x, const double *u, bool slopes, calls_t *c,
                           double *const g[], double *seen, double *work)
{
    for (int m = 0; m < N_N; m++) {
        const net_t *const net = &job->net[job->net_of[m]];
        double a[MOST_INPUTS], ax[MOST_INPUTS * (N_X + 1)], ap[MOST_INPUTS * (N_F + 1)], an[MOST_INPUTS * (N_N + 1)];
        arguments(m, x, u, &u[N_U], job->p, c->N, a, slopes ? ax : NULL, ap, an);
        if (seen != NULL) {
            for (int k = 0; k < net->inputs; k++) {
                *seen++ = a[k];
            }
        }
        double plain[MOST_INPUTS];
        c->N[m] = network(net, zero[job->net_of[m]], a,
                          slopes                 ? c->slope[m]
                          : (net->kind == CURVE) ? plain
                                                 : NULL,
                          slopes ? g[m] : NULL, c->touched[m], work);
        if (!slopes) {
            continue;
        }
        for (int j = 0; j < N_X; j++) {
            c->nx[m][j] = 0.0;
        }
        for (int j = 0; j < N_F; j++) {
            c->np[m][j] = 0.0;
        }
        for (int l = 0; l < N_N; l++) {
            c->D[m][l] = (l == m) ? 1.0 : 0.0;
        }
        for (int k = 0; k < net->inputs; k++) {
            const double s = c->slope[m][k];
            for (int j = 0; j < N_X; j++) {
                c->nx[m][j] += s * ax[(k * N_X) + j];
            }
            for (int j = 0; j < N_F; j++) {
                c->np[m][j] += s * ap[(k * N_F) + j];
            }
            for (int l = 0; l < m; l++) {
                const double by = s * an[(k * N_N) + l];
                for (int j = 0; j < N_X; j++) {
                    c->nx[m][j] += by * c->nx[l][j];
                }
                for (int j = 0; j < N_F; j++) {
                    c->np[m][j] += by * c->np[l][j];
                }
                for (int q = 0; q <= l; q++) {
                    c->D[m][q] += by * c->D[l][q];
                }
            }
        }
    }
}

/* totals of `rows` results from their partial derivatives */
static void total(int rows, const calls_t *c, double *fx, double *fp, const double *fn, double *B)
{
    for (int r = 0; r < rows; r++) {
        for (int m = 0; m < N_N; m++) {
            const double by = fn[(r * N_N) + m];
            for (int j = 0; j < N_X; j++) {
                fx[(r * N_X) + j] += by * c->nx[m][j];
            }
            for (int j = 0; j < N_F; j++) {
                fp[(r * N_F) + j] += by * c->np[m][j];
            }
        }
        for (int q = 0; q < N_N; q++) {
            double sum = 0.0;
            for (int m = q; m < N_N; m++) {
                sum += fn[(r * N_N) + m] * c->D[m][q];
            }
            B[(r * N_N) + q] = sum;
        }
    }
}

/* C = A B, all [N_X][n] */
static void product(const double *a, const double *b, int n, double *c)
{
    for (int r = 0; r < N_X; r++) {
        for (int j = 0; j < n; j++) {
            double sum = 0.0;
            for (int k = 0; k < N_X; k++) {
                sum += a[(r * N_X) + k] * b[(k * n) + j];
            }
            c[(r * n) + j] = sum;
        }
    }
}

/* out[c] += sum over rows of by[r] in[r][c] */
static void add_columns(const double *by, const double *in, int rows, int columns, int stride, double *out)
{
    for (int r = 0; r < rows; r++) {
        const double f = by[r];
        if (f != 0.0) {
            const double *const row = &in[r * stride];
            for (int c = 0; c < columns; c++) {
                out[c] += f * row[c];
            }
        }
    }
}

/* g of a call times `by`, into the columns of its network; only what a hat function touches is not 0 */
static void add_network(const job_t *job, int m, const int touched[2], const double *g, double by, double *out)
{
    const net_t *const net = &job->net[job->net_of[m]];
    double *const own = &out[net->first];

    if (touched[0] != -2) {
        for (int k = 0; k < 2; k++) {
            if (touched[k] >= 0) {
                own[touched[k]] += by * g[touched[k]];
            }
        }
        return;
    }
    for (int c = 0; c < net->columns; c++) {
        own[c] += by * g[c];
    }
}

typedef struct {
    double A[N_X * N_X + 1], P[N_X * N_F + 1], B[N_X * N_N + 1], K[N_X + 1], W[N_X * N_X + 1];
    calls_t c;
} stage_t;

/* all columns one step on */
static void spread(const job_t *job, const stage_t *st, const double *phi, double *const g[][N_N + 1], double *spare)
{
    const int n = job->stages;
    const int C = job->columns;
    memcpy(spare, job->S, sizeof(double) * (size_t)(N_X * C));
    memset(job->S, 0, sizeof(double) * (size_t)(N_X * C));
    for (int r = 0; r < N_X; r++) {
        double *const row = &job->S[r * C];
        add_columns(&phi[r * N_X], spare, N_X, C, C, row);
        for (int s = 0; s < n; s++) {
            double by[N_F + N_N + 1];
            for (int j = 0; j < N_F + N_N; j++) {
                by[j] = 0.0;
            }
            for (int k = 0; k < N_X; k++) {
                const double w = st[s].W[(r * N_X) + k];
                for (int j = 0; j < N_F; j++) {
                    by[j] += w * st[s].P[(k * N_F) + j];
                }
                for (int m = 0; m < N_N; m++) {
                    by[N_F + m] += w * st[s].B[(k * N_N) + m];
                }
            }
            for (int j = 0; j < N_F; j++) {
                row[j] += by[j];
            }
            for (int m = 0; m < N_N; m++) {
                add_network(job, m, st[s].c.touched[m], g[s][m], by[N_F + m], row);
            }
        }
    }
}

/* S1 = Phi S0 + sum of W_s b_s */
static void propagate(const job_t *job, stage_t *st, double *const g[][N_N + 1], double *spare)
{
    const int n = job->stages;
    double M[MOST_STAGES][N_X * N_X + 1], L[MOST_STAGES][MOST_STAGES][N_X * N_X + 1], phi[N_X * N_X + 1], t[N_X * N_X + 1];

    for (int i = 0; i < N_X * N_X; i++) {
        phi[i] = (i % (N_X + 1)) == 0 ? 1.0 : 0.0;
    }
    for (int s = 0; s < n; s++) {
        const double a = job->step * job->nodes[s];
        for (int i = 0; i < N_X * N_X; i++) {
            t[i] = ((i % (N_X + 1)) == 0 ? 1.0 : 0.0) + ((s > 0) ? (a * M[s - 1][i]) : 0.0);
        }
        product(st[s].A, t, N_X, M[s]);
        for (int j = 0; j < s; j++) {
            for (int i = 0; i < N_X * N_X; i++) {
                t[i] = a * L[s - 1][j][i];
            }
            product(st[s].A, t, N_X, L[s][j]);
        }
        for (int i = 0; i < N_X * N_X; i++) {
            L[s][s][i] = (i % (N_X + 1)) == 0 ? 1.0 : 0.0;
            phi[i] += job->step * job->shares[s] * M[s][i];
        }
    }
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < N_X * N_X; i++) {
            st[j].W[i] = 0.0;
            for (int s = j; s < n; s++) {
                st[j].W[i] += job->step * job->shares[s] * L[s][j][i];
            }
        }
    }
    spread(job, st, phi, g, spare);
}

static void substep(const job_t *job, double *const zero[], const double *drive, stage_t *st, double *const g[][N_N + 1], double *spare,
                    double *work)
{
    const bool slopes = job->columns > 0;
    double xs[N_X + 1];

    for (int s = 0; s < job->stages; s++) {
        const double *const u = &drive[s * 2 * N_U];
        double fn[N_X * N_N + 1];
        for (int i = 0; i < N_X; i++) {
            xs[i] = job->x[i] + ((s > 0) ? (job->step * job->nodes[s] * st[s - 1].K[i]) : 0.0);
        }
        evaluate_calls(job, zero, xs, u, slopes, &st[s].c, g[s], NULL, work);
        rates(xs, u, &u[N_U], job->p, st[s].c.N, st[s].K, slopes ? st[s].A : NULL, st[s].P, fn);
        if (slopes) {
            total(N_X, &st[s].c, st[s].A, st[s].P, fn, st[s].B);
        }
    }
    if (slopes) {
        propagate(job, st, g, spare);
    }
    for (int s = 0; s < job->stages; s++) {
        for (int i = 0; i < N_X; i++) {
            job->x[i] += job->step * job->shares[s] * st[s].K[i];
        }
    }
}

static void observe(const job_t *job, double *const zero[], int k, stage_t *st, double *const g[], double *work)
{
    const bool slopes = job->columns > 0;
    const double *const u = &job->u[k * 2 * N_U];
    double zx[N_Z * N_X + 1], zp[N_Z * N_F + 1], zn[N_Z * N_N + 1], B[N_Z * N_N + 1];

    evaluate_calls(job, zero, job->x, u, slopes, &st->c, g, (job->inputs_seen != NULL) ? &job->inputs_seen[k * job->inputs_total] : NULL,
                   work);
    sensors(job->x, u, &u[N_U], job->p, st->c.N, &job->z[k * N_Z], slopes ? zx : NULL, zp, zn);
    if (!slopes) {
        return;
    }
    total(N_Z, &st->c, zx, zp, zn, B);
    for (int r = 0; r < N_Z; r++) {
        double *const row = &job->J[((k * N_Z) + r) * job->columns];
        memset(row, 0, sizeof(double) * (size_t)job->columns);
        add_columns(&zx[r * N_X], job->S, N_X, job->columns, job->columns, row);
        for (int j = 0; j < N_F; j++) {
            row[j] += zp[(r * N_F) + j];
        }
        for (int m = 0; m < N_N; m++) {
            add_network(job, m, st->c.touched[m], g[m], B[(r * N_N) + m], row);
        }
    }
}

/* doubles of scratch that a job needs */
long train_scratch(const job_t *job)
{
    long widest = 1, columns = 0, most = 1;

    for (int n = 0; n < job->nets; n++) {
        const long own = (long)(job->net[n].layers + 3) * job->net[n].widest;
        widest = (own > widest) ? own : widest;
        most = (job->net[n].columns > most) ? job->net[n].columns : most;
        columns += job->net[n].columns + 1;
    }
    return widest + columns + (N_X * (long)job->columns) + (((MOST_STAGES + 1) * (long)(N_N + 1)) * most);
}

/** Samples first to last - 1; the state is that of `first` on entry and of `last` at the end. False: NaN, Inf, or beyond all bounds. */
bool train_run(const job_t *job, int first, int last)
{
    static const double far = 1e12;
    stage_t st[MOST_STAGES];
    double *at = job->scratch, *zero[N_N + 1], *g[MOST_STAGES + 1][N_N + 1];
    double *const spare = at;
    long most = 1;

    at += N_X * job->columns;
    for (int n = 0; n < job->nets; n++) {
        most = (job->net[n].columns > most) ? job->net[n].columns : most;
        zero[n] = at;
        at += job->net[n].columns + 1;
    }
    for (int s = 0; s <= MOST_STAGES; s++) {
        for (int m = 0; m < N_N; m++) {
            g[s][m] = at;
            at += most;
        }
    }
    for (int n = 0; n < job->nets; n++) {
        const net_t *const net = &job->net[n];
        memset(zero[n], 0, sizeof(double) * (size_t)(net->columns + 1));
        if ((net->kind == DENSE) && (net->zero >= 0)) {
            at_zero(net, at, zero[n]);
            backward(net, at, 1.0, &zero[n][1], NULL, &at[(net->layers + 1) * net->widest]);
        }
    }
    for (int k = first; k < last; k++) {
        observe(job, zero, k, &st[0], g[MOST_STAGES], at);
        for (int i = 0; (k + 1 < job->samples) && (i < job->substeps); i++) {
            substep(job, zero, &job->drive[(((size_t)k * (size_t)job->substeps) + (size_t)i) * (size_t)job->stages * 2U * N_U], st,
                    (double *const(*)[N_N + 1]) g, spare, at);
        }
        for (int i = 0; i < N_X; i++) {
            if (!(fabs(job->x[i]) < far)) {
                return false;
            }
        }
    }
    return true;
}
