/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors
 *
 * Simulation of a model with the exact sensitivities of its discrete step, for training on the host. Included after the C of its physics.
 *
 * A step of a Runge-Kutta method is affine in the sensitivities: S1 = Phi S0 + sum over stages of W_s b_s, where b_s is what a stage
 * adds for each column. Phi and W_s [states][states] are made once a step, so a column costs two small products, whatever the method.
 */
#include <stdbool.h>
#include <string.h>

enum { CURVE, DENSE, MOST_STAGES = 4, MOST_LAYERS = 16 };
enum { IDENTITY, RELU, TANH, SIGMOID, SOFTPLUS };

/* A network: hat functions over knots, or layers. Its columns of the sensitivities begin at `first`. */
typedef struct {
    int kind, count, zero, layers;   /* knots, the knot whose value is fixed (-1: none; layers: -1: not 0 at 0), dense layers */
    const double *knots, *values;    /* [count] */
    const int *width, *activation;   /* [layers + 1], [layers] */
    const double *weights;           /* per layer [n_out][n_in], then biases [n_out]; of the last layer the bias is used if zero < 0 */
    const double *factor;            /* [inputs], then of the output: x * factor goes in, and out * factor comes out */
    int first, columns, widest, inputs;
} net_t;

typedef struct {
    int samples, substeps, stages, columns; /* columns of S; 0: simulate only */
    const double *nodes, *shares;           /* [stages] of the method */
    double step;                            /* s, of a substep */
    const double *p;                        /* [N_P] */
    const double *drive;                    /* [samples - 1][substeps][stages][2][N_U]: inputs and rates on the way to the next sample */
    const double *u;                        /* [samples][2][N_U] at the samples */
    int nets;
    const net_t *net;
    const int *net_of;                      /* [N_N] */
    double *x;                              /* [N_X], in and out */
    double *S;                              /* [N_X][columns], in and out; the columns begin with the free parameters */
    double *z;                              /* [samples][N_Z] */
    double *J;                              /* [samples][N_Z][columns] */
    double *inputs_seen;                    /* [samples][calls' inputs], or NULL */
    double *scratch;
    int inputs_total;
} job_t;

static inline double t_sigmoid(double x) { return (x >= 0.0) ? (1.0 / (1.0 + exp(-x))) : (exp(x) / (1.0 + exp(x))); }
static inline double t_softplus(double x) { return ((x > 0.0) ? x : 0.0) + log1p(exp(-fabs(x))); }

/* cell of a curve; the outermost ones go on for ever */
static int cell_of(const net_t *net, double x)
{
    int low = 0, high = net->count - 1;

    while (high - low > 1) {
        const int mid = (low + high) / 2;
        if (x >= net->knots[mid]) {
            low = mid;
        } else {
            high = mid;
        }
    }
    return low;
}

static double curve(const net_t *net, double x, double *slope, double *g, int touched[2])
{
    const int i = cell_of(net, x);
    const double wide = net->knots[i + 1] - net->knots[i], t = (x - net->knots[i]) / wide;

    *slope = (net->values[i + 1] - net->values[i]) / wide;
    if (g != NULL) {
        for (int k = 0; k < 2; k++) {
            const int knot = i + k;
            touched[k] = (knot == net->zero) ? -1 : (knot - ((net->zero >= 0 && knot > net->zero) ? 1 : 0));
            if (touched[k] >= 0) {
                g[touched[k]] = (k == 0) ? (1.0 - t) : t;
            }
        }
    }
    return net->values[i] + (*slope * (x - net->knots[i]));
}

/* layers on x [inputs]; h keeps what each layer gives */
static double forward(const net_t *net, const double *x, double *h)
{
    const double *w = net->weights;

    for (int i = 0; i < net->width[0]; i++) {
        h[i] = x[i] * net->factor[i];
    }
    for (int l = 0; l < net->layers; l++) {
        const int n_in = net->width[l], n_out = net->width[l + 1];
        const double *const b = &w[n_in * n_out];
        double *const y = &h[net->widest];
        for (int o = 0; o < n_out; o++) {
            double sum = ((l + 1 < net->layers) || (net->zero < 0)) ? b[o] : 0.0;
            for (int i = 0; i < n_in; i++) {
                sum += w[(o * n_in) + i] * h[i];
            }
            const int a = net->activation[l];
            y[o] = (a == RELU) ? ((sum > 0.0) ? sum : 0.0) : (a == TANH) ? (1.0 - (2.0 / (exp(2.0 * sum) + 1.0))) : (a == SIGMOID) ? t_sigmoid(sum) : (a == SOFTPLUS) ? t_softplus(sum) : sum;
        }
        w = &b[n_out];
        h = y;
    }
    return h[0];
}

static double slope_of(int activation, double y)
{
    switch (activation) {
    case RELU: return (y > 0.0) ? 1.0 : 0.0;
    case TANH: return 1.0 - (y * y);
    case SIGMOID: return y * (1.0 - y);
    case SOFTPLUS: return 1.0 - exp(-y);
    default: return 1.0;
    }
}

/* gradient of forward's result by the weights, added to g with a sign, and by the inputs */
static void backward(const net_t *net, const double *h, double sign, double *g, double *slope, double *e)
{
    double *back = &e[net->widest];
    const double *w = net->weights;
    int at = 0;

    for (int l = 0; l < net->layers; l++) {
        at += (net->width[l] + 1) * net->width[l + 1];
    }
    e[0] = net->factor[net->inputs];
    for (int l = net->layers - 1; l >= 0; l--) {
        const int n_in = net->width[l], n_out = net->width[l + 1];
        const double *const x = &h[l * net->widest], *const y = &h[(l + 1) * net->widest];
        double *const other = back;
        at -= (n_in + 1) * n_out;
        for (int i = 0; i < n_in; i++) {
            back[i] = 0.0;
        }
        for (int o = 0; o < n_out; o++) {
            const double d = e[o] * slope_of(net->activation[l], y[o]);
            for (int i = 0; i < n_in; i++) {
                back[i] += d * w[at + (o * n_in) + i];
            }
            if (g != NULL) {
                for (int i = 0; i < n_in; i++) {
                    g[at + (o * n_in) + i] += sign * d * x[i];
                }
                if ((l + 1 < net->layers) || (net->zero < 0)) {
                    g[at + (n_in * n_out) + o] += sign * d;
                }
            }
        }
        back = e;
        e = other;
    }
    if (slope != NULL) {
        for (int i = 0; i < net->inputs; i++) {
            slope[i] = e[i] * net->factor[i];
        }
    }
}

/* what a network gives at 0, which is taken away from it */
static void at_zero(const net_t *net, double *h, double *value)
{
    const double none[MOST_LAYERS] = {0};

    *value = forward(net, none, h);
}

static double network(const net_t *net, const double *zero, const double *in, double *slope, double *g, int touched[2], double *work)
{
    if (net->kind == CURVE) {
        return curve(net, in[0], slope, g, touched);
    }
    double *const e = &work[(net->layers + 1) * net->widest];
    const double value = (forward(net, in, work) - *zero) * net->factor[net->inputs];
    touched[0] = -2;
    if (slope != NULL) {
        if (g != NULL) {
            memset(g, 0, sizeof(double) * (size_t)net->columns);
        }
        backward(net, work, 1.0, g, slope, e);
        if (g != NULL) { /* the gradient at 0 lies behind zero */
            for (int c = 0; c < net->columns; c++) {
                g[c] -= zero[1 + c];
            }
        }
    }
    return value;
}

#define MOST_INPUTS 8
/* One evaluation: all networks, then f (rates or sensors) and, for columns, its total derivatives A by states, P by parameters, B by calls. */
typedef struct {
    double N[N_N + 1], slope[N_N + 1][MOST_INPUTS], D[N_N + 1][N_N + 1], nx[N_N + 1][N_X + 1], np[N_N + 1][N_F + 1];
    int touched[N_N + 1][2];
} calls_t;

static void evaluate_calls(const job_t *job, double *const zero[], const double *x, const double *u, bool slopes, calls_t *c, double *const g[], double *seen, double *work)
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
        c->N[m] = network(net, zero[job->net_of[m]], a, slopes ? c->slope[m] : (net->kind == CURVE) ? plain : NULL, slopes ? g[m] : NULL, c->touched[m], work);
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

static void substep(const job_t *job, double *const zero[], const double *drive, stage_t *st, double *const g[][N_N + 1], double *spare, double *work)
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

    evaluate_calls(job, zero, job->x, u, slopes, &st->c, g, (job->inputs_seen != NULL) ? &job->inputs_seen[k * job->inputs_total] : NULL, work);
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
            substep(job, zero, &job->drive[(((size_t)k * (size_t)job->substeps) + (size_t)i) * (size_t)job->stages * 2U * N_U], st, (double *const (*)[N_N + 1])g, spare, at);
        }
        for (int i = 0; i < N_X; i++) {
            if (!(fabs(job->x[i]) < far)) {
                return false;
            }
        }
    }
    return true;
}
