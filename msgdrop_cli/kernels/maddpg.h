/* What an update of maddpg.c works on: shapes, memories, buffers, and the listed inputs.
 *
 * Letters: R runs, B joint samples, N agents, S = N - 1 senders, O and A numbers of an observation
 * and an action, `rows` = B * N: samples, then agents.
 */
#pragma once
#include "layers.h"
#include "nonzeros.h"

typedef struct {
    int64_t runs, agents, observation, action, senders, masks_actions;
    Layer a1, a2, f1, f2, g1, h1, h2; /* actor, critic; without g1 f1 sees the others, if any */
} Net;
typedef struct { /* memories of runs; Drawn in protocol.py */
    const float *obs;
    const int32_t *next_row;
    const float *action, *reward, *discount;
    const int64_t *rows;
    int64_t obs_rows, run_rows; /* rows of a run */
} Memory;
typedef struct {
    float gamma, tau, max_norm;
    Adam critic, actor;
    int64_t batch_size, improves_actor;
} Rule;

typedef struct { float *weight, *bias; } Gradient;
typedef struct { Matrix f1, joint, h1, q; } Pass; /* [rows, units]; f1: (f1, a), joint: (f2, g1) */
typedef struct {
    const Net *net;
    int64_t r, batch, rows; /* the run; B; B * N */
    int64_t *places;        /* [2B] rows of obs: now, next */
    float *action, *reward, *discount; /* [B, N, A], [B, N], [B] as replayed */
    const float *keep;                 /* [N, B, S] */
    int32_t *start; /* [2 rows + 1]: an observation's first entry of the list; then its action */
    List list;
    Pass online, target;
    Gradient a1, a2, f1, f2, g1, h1, h2; /* one after the other, with zeros between them */
    float *end;
    float *own, *part, *turned, *padded;
    Matrix hidden, numbers, grad_last, grad_hidden, grad_h1, grad_joint, grad_f1, grad_own;
} Work;

static const float NO_FACTOR = 1.0f;
static const Factor ONE = {&NO_FACTOR, 0};
static const uint16_t IN_ORDER[LANES] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

/* The inputs: all are listed once an update, and serve every first layer. */

static Row observation_of(const Work *w, int64_t t)
{
    return row_of(w->list, w->start[t], w->start[t + 1] - w->net->action);
}

static Row with_own_action(const Work *w, int64_t t)
{
    return row_of(w->list, w->start[t], w->start[t + 1]);
}

static Row action_of(const Work *w, const float *actions, int64_t t)
{
    return (Row){IN_ORDER, actions + t * w->net->action, w->net->action};
}

/* Lists the observations of joint rows, whose places are given, or which follow each other. */
static void list_inputs(const Work *w, const float *obs, const int64_t *places, int64_t rows)
{
    const int64_t agents = w->net->agents, units = w->net->observation, wide = agents * units;
    int64_t found = 0;
    int32_t *start = w->start;
    for (int64_t b = 0; b < rows; b++) {
        const float *x = obs + (places ? places[b] : b) * wide;
        if (places && b + 1 < rows) { /* they lie anywhere in memory: ask early */
            const float *later = obs + places[b + 1] * wide;
            for (int64_t k = 0; k < wide; k += LANES) __builtin_prefetch(later + k);
        }
        for (int64_t i = 0; i < agents; i++, x += units) {
            *start++ = (int32_t)found;
            found = list_numbers(x, units, w->list, found) + w->net->action;
        }
    }
    *start = (int32_t)found;
}

/* Puts own actions [rows, A] behind the observations t on, as f1 sees them. */
static void list_own_actions(const Work *w, int64_t t, const float *own)
{
    const int64_t count = w->net->action;
    for (int64_t row = 0; row < w->rows; row++)
        for (int64_t a = 0, at = w->start[t + row + 1] - count; a < count; a++, at++) {
            w->list.unit[at] = (uint16_t)(w->net->observation + a);
            w->list.value[at] = own[row * count + a];
        }
}

/* Copies what run r has drawn, and lists what it has seen: the observations, then the next. */
static void take_batch(const Work *w, const Memory *m)
{
    const Net *n = w->net;
    const int64_t *rows = m->rows + w->r * w->batch, numbers = n->agents * n->action;
    for (int64_t b = 0; b < w->batch; b++) {
        const int64_t at = w->r * m->run_rows + rows[b];
        const float *action = m->action + at * numbers, *reward = m->reward + at * n->agents;
        memcpy(w->action + b * numbers, action, (size_t)numbers * sizeof(float));
        memcpy(w->reward + b * n->agents, reward, (size_t)n->agents * sizeof(float));
        w->discount[b] = m->discount[at];
        w->places[b] = rows[b];
        w->places[w->batch + b] = m->next_row[at];
    }
    const int64_t wide = n->agents * n->observation;
    list_inputs(w, m->obs + w->r * m->obs_rows * wide, w->places, 2 * w->batch);
}

/* The buffers. */

static Matrix taken(Arena *a, int64_t rows, int64_t units)
{
    return (Matrix){floats(a, rows * units), units};
}

static void take_gradients(const Net *n, Arena *a, Work *w)
{
    const Layer *layers[7] = {&n->a1, &n->a2, &n->f1, &n->f2, &n->g1, &n->h1, &n->h2};
    Gradient *grads[7] = {&w->a1, &w->a2, &w->f1, &w->f2, &w->g1, &w->h1, &w->h2};
    for (int i = 0; i < 7; i++) {
        grads[i]->weight = floats(a, layers[i]->inputs * layers[i]->outputs);
        grads[i]->bias = floats(a, layers[i]->outputs);
    }
    w->end = floats(a, 0);
}

/* Puts the buffers for `batch` joint samples into `memory`; returns the bytes that they take. */
static int64_t lay_out(const Net *n, int64_t batch, char *memory, Work *w)
{
    const int64_t rows = batch * n->agents, h = n->h1.outputs, joint = n->h1.inputs;
    const int64_t wide = n->f2.inputs, first = n->f1.outputs, units = n->a1.outputs;
    const int64_t entries = 2 * rows * (n->observation + n->action) + SPARE;
    int64_t most = joint * h;
    if (wide * n->f2.outputs > most) most = wide * n->f2.outputs;
    if (LANES * units > most) most = LANES * units;
    Arena a = {memory, 0};
    w->net = n;
    w->batch = batch;
    w->rows = rows;
    take_gradients(n, &a, w);
    Pass *passes[2] = {&w->online, &w->target};
    for (int i = 0; i < 2; i++) {
        passes[i]->f1 = taken(&a, rows, wide);
        passes[i]->joint = taken(&a, rows, joint);
        passes[i]->h1 = taken(&a, rows, h);
        passes[i]->q = taken(&a, rows, LANES);
    }
    w->places = take(&a, 2 * batch * (int64_t)sizeof(int64_t));
    w->action = floats(&a, rows * n->action);
    w->reward = floats(&a, rows);
    w->discount = floats(&a, batch);
    w->own = floats(&a, rows * n->action);
    w->part = floats(&a, 2 * (first > n->g1.outputs ? first : n->g1.outputs));
    w->turned = floats(&a, most);
    w->padded = floats(&a, (first + joint + h + units + 1) * LANES);
    w->hidden = taken(&a, rows, units);
    w->numbers = taken(&a, rows, LANES);
    w->grad_last = taken(&a, rows, LANES);
    w->grad_hidden = taken(&a, rows, units);
    w->grad_h1 = taken(&a, rows, h);
    w->grad_joint = taken(&a, rows, joint);
    w->grad_f1 = taken(&a, rows, wide);
    w->grad_own = taken(&a, rows, LANES);
    w->start = take(&a, (2 * rows + 1) * (int64_t)sizeof(int32_t));
    w->list.unit = take(&a, entries * (int64_t)sizeof(uint16_t));
    w->list.value = floats(&a, entries);
    return a.taken;
}
