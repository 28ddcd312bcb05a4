/* SPDX-License-Identifier: MIT
 * Copyright (c) 2026 the penode authors
 *
 * Networks for training on the host: hat functions and layers, with their gradients. Included before engine.c.
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

static inline double t_sigmoid(double x)
{
    return (x >= 0.0) ? (1.0 / (1.0 + exp(-x))) : (exp(x) / (1.0 + exp(x)));
}
static inline double t_softplus(double x)
{
    return ((x > 0.0) ? x : 0.0) + log1p(exp(-fabs(x)));
}

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
            y[o] = (a == RELU)       ? ((sum > 0.0) ? sum : 0.0)
                   : (a == TANH)     ? (1.0 - (2.0 / (exp(2.0 * sum) + 1.0)))
                   : (a == SIGMOID)  ? t_sigmoid(sum)
                   : (a == SOFTPLUS) ? t_softplus(sum)
                                     : sum;
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
    const double none[MOST_LAYERS] = { 0 };

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
