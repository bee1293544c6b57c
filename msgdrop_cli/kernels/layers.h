/* Dense layers, forward and backward, Adam, and the arena that their buffers are taken from.
 *
 * Shapes: `rows` samples; a layer has `inputs` and `outputs`. Weights are [inputs, outputs].
 */
#pragma once
#include <stddef.h>

#include "products.h"

typedef struct { int64_t inputs, outputs, weight, bias; } Layer; /* offsets in a flat Stacked */
typedef struct { float *weights, *exp_avg, *exp_avg_sq, *target; } Parameters; /* flat, all G */
typedef struct { float step_size, root_scale, new1, new2, epsilon; } Adam; /* new1: 1 - beta1 */
typedef struct { float *loss, *q; } Outcome;

/* One network's layer: weight [inputs, outputs], bias [outputs]. */
typedef struct { float *weight, *bias; int64_t inputs, outputs; } Dense;

static Dense dense_of(const Layer *l, float *flat, int64_t g)
{
    return (Dense){flat + l->weight + g * l->inputs * l->outputs, flat + l->bias + g * l->outputs,
                   l->inputs, l->outputs};
}

/* The same with as many outputs as a vector has lanes, the new ones 0; a copy in `padded`. */
static Dense widened(Dense d, float *padded)
{
    const size_t size = (size_t)d.outputs * sizeof(float);
    memset(padded, 0, (size_t)((d.inputs + 1) * LANES) * sizeof(float));
    for (int64_t k = 0; k < d.inputs; k++)
        memcpy(padded + k * LANES, d.weight + k * d.outputs, size);
    memcpy(padded + d.inputs * LANES, d.bias, size);
    return (Dense){padded, padded + d.inputs * LANES, d.inputs, LANES};
}

/* out [rows, outputs] = after(in [rows, inputs] times weight plus bias) */
static void forward_dense(Dense d, Matrix in, int64_t rows, After after, Matrix out)
{
    const Product p = {in.at, in.row, 1, {d.weight, d.outputs}, d.inputs};
    product(p, rows, d.outputs, (Ending){d.bias, after, NULL}, out);
}

/* grad_in [rows, inputs] = grad_out [rows, outputs] times the weight transposed, where the ReLU
 * that made `in` was open; in lies like grad_in; turned: room for the transposed weight. */
static void backward_dense(Dense d, Matrix grad_out, int64_t rows, const float *in, Matrix grad_in,
                           float *turned)
{
    for (int64_t o = 0; o < d.outputs; o++)
        for (int64_t i = 0; i < d.inputs; i++)
            turned[o * d.inputs + i] = d.weight[i * d.outputs + o];
    const Product p = {grad_out.at, grad_out.row, 1, {turned, d.inputs}, d.outputs};
    product(p, rows, d.inputs, (Ending){NULL, THROUGH_RELU, in}, grad_in);
}

/* gradient [inputs, outputs] = in [rows, inputs] transposed times grad_out [rows, outputs] */
static void weight_gradient(Matrix in, int64_t inputs, Matrix grad_out, int64_t outputs,
                            int64_t rows, float *gradient)
{
    const Product p = {in.at, 1, in.row, grad_out, rows};
    product(p, inputs, outputs, (Ending){NULL, PLAIN, NULL}, (Matrix){gradient, outputs});
}

/* Rows of LANES numbers become rows of their first `outputs`, in place. */
static void narrowed(float *gradient, int64_t inputs, int64_t outputs)
{
    for (int64_t k = 1; k < inputs; k++)
        memmove(gradient + k * outputs, gradient + k * LANES, (size_t)outputs * sizeof(float));
}

/* Adam (l. 753). */

INLINE void adam_step(Adam r, float *weight, float *exp_avg, float *exp_avg_sq, Vec grad)
{
    const Vec m = fused(r.new1, grad - AT(exp_avg), AT(exp_avg));
    const Vec v = fused(r.new2, fused_square(grad, -AT(exp_avg_sq)), AT(exp_avg_sq));
    AT(exp_avg) = m;
    AT(exp_avg_sq) = v;
    Vec root;
    UNROLLED for (int i = 0; i < WIDTH; i++) root[i] = sqrtf(v[i]);
    AT(weight) -= r.step_size * m / fused(r.root_scale, root, (Vec){0} + r.epsilon);
}

/* The target moves towards the weight by tau; at 0 it is not touched. */
INLINE void follow(float *target, float *weight, float tau)
{
    if (tau > 0.0f) AT(target) = fused(tau, AT(weight) - AT(target), AT(target));
}

/* One step of the `count` parameters from `at` on, with factor * grad; then the target follows by
 * tau, if it does. What is left at the end is done in a copy of whole vectors. */
INLINE void adam_each(Adam r, const Parameters *p, int64_t at, const float *grad, int64_t count,
                      float factor, float tau)
{
    float *w = p->weights + at, *m = p->exp_avg + at, *v = p->exp_avg_sq + at, *t = p->target + at;
    int64_t k = 0;
    for (; k + WIDTH <= count; k += WIDTH) {
        adam_step(r, w + k, m + k, v + k, factor * READ(grad + k));
        follow(t + k, w + k, tau);
    }
    if (k == count) return;
    const size_t left = (size_t)(count - k) * sizeof(float);
    float part[5][WIDTH] = {{0}}, *from[4] = {w + k, m + k, v + k, t + k};
    for (int i = 0; i < 4; i++) memcpy(part[i], from[i], left);
    memcpy(part[4], grad + k, left);
    adam_step(r, part[0], part[1], part[2], factor * READ(part[4]));
    follow(part[3], part[0], tau);
    for (int i = 0; i < (tau > 0.0f ? 4 : 3); i++) memcpy(from[i], part[i], left);
}

/* Buffers, one after the other in memory that Python gives; each begins a line of the cache. */

typedef struct { char *memory; int64_t taken; } Arena;

static void *take(Arena *a, int64_t bytes)
{
    void *found = a->memory + a->taken;
    a->taken += (bytes + 63) / 64 * 64;
    return found;
}

static float *floats(Arena *a, int64_t count) { return take(a, count * (int64_t)sizeof(float)); }

/* What Python mirrors: it compares when it loads the library. */

typedef struct { const char *name; int64_t offset, size; } Field; /* "Struct.field", or "Struct" */
#define FIELD(S, f) {#S "." #f, offsetof(S, f), sizeof(((S *)0)->f)}
#define STRUCT(S) {#S, 0, sizeof(S)}
#define SHARED_FIELDS                                                                        \
    STRUCT(Layer), FIELD(Layer, inputs), FIELD(Layer, outputs), FIELD(Layer, weight),        \
    FIELD(Layer, bias), STRUCT(Parameters), FIELD(Parameters, weights),                      \
    FIELD(Parameters, exp_avg), FIELD(Parameters, exp_avg_sq), FIELD(Parameters, target),    \
    STRUCT(Adam), FIELD(Adam, step_size), FIELD(Adam, root_scale), FIELD(Adam, new1),        \
    FIELD(Adam, new2), FIELD(Adam, epsilon), STRUCT(Outcome), FIELD(Outcome, loss),          \
    FIELD(Outcome, q)
