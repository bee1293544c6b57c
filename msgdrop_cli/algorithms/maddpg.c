/* The whole update of maddpg.py for networks that all agents of a run share, run after run.
 *
 * The rule is that of MADDPG._improve and _improve_actor, which are its oracle
 * (tests/test_compiled_maddpg.py): the target (l. 273), the critic's loss, its step, and every
 * second time the policy gradient (l. 277) through the critic as it is by then. A gradient is
 * clipped as a whole, so it is stored, and each step is followed by the target's.
 *
 * Waterworld's observations are mostly zeros (94%). What is not 0 is listed once an update and
 * serves every first layer: the actors', f of the critics, and g, where slot k of agent i holds
 * agent k, or agent k + 1 from i = k on. So the products of a slot with these two serve all agents.
 * Rows are samples, then agents. Every sum has one order whatever the stack.
 */
#ifdef __AVX512F__
#include <immintrin.h>
#endif

#include "../networks/products.h"

typedef struct {
    int64_t runs, agents, observation, action, senders, masks_actions;
    Layer a1, a2, f1, f2, g1, h1, h2; /* the actor, the critic; g1 of no outputs: DDPG */
} Net;
typedef struct { /* memories of runs; Drawn in protocol.py */
    const float *obs;
    const int32_t *next_row;
    const float *action, *reward, *discount;
    const int64_t *rows;
    int64_t obs_rows, run_rows; /* rows of a run */
} Memory;
typedef struct { float *action, *reward, *discount; const float *keep; float *loss, *q; } Batch;
typedef struct { float gamma, tau, max_norm; Adam critic, actor; } Rule;
typedef struct { float *weight, *bias; } Gradient;
typedef struct { float *f1, *joint, *h1, *q; } Pass; /* f1: (f1, a) */
typedef struct {
    int64_t *places;
    float *action, *reward, *discount;
    int32_t *start, *unit; /* [observations + 1]: the first of each that is not 0; its place */
    float *value;
    Pass online, target;
    Gradient a1, a2, f1, f2, g1, h1, h2; /* one after the other, with zeros between them */
    float *own, *hidden, *numbers, *part, *turned, *last;
    float *grad_last, *grad_hidden, *grad_h1, *grad_joint, *grad_f1, *grad_own, *end;
} Scratch;

static const float *weight_of(const Layer *l, const float *flat, int64_t r)
{
    return flat + l->weight + r * l->inputs * l->outputs;
}

static const float *bias_of(const Layer *l, const float *flat, int64_t r)
{
    return flat + l->bias + r * l->outputs;
}

/* First layers: what is 0 is left out. */

/* Lists what is not 0 in x, from `found` on; returns the new end. */
static int32_t find(const float *x, int64_t units, const Scratch *s, int32_t found)
{
    int64_t k = 0;
#ifdef __AVX512F__
    __m512i unit = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    for (; k < units; k += 16, unit = _mm512_add_epi32(unit, _mm512_set1_epi32(16))) {
        const __mmask16 there = units - k < 16 ? (__mmask16)((1u << (units - k)) - 1u) : 0xffff;
        const __m512 v = _mm512_maskz_loadu_ps(there, x + k);
        const __mmask16 some = _mm512_cmp_ps_mask(v, _mm512_setzero_ps(), _CMP_NEQ_UQ);
        _mm512_storeu_si512(s->unit + found, _mm512_maskz_compress_epi32(some, unit));
        _mm512_storeu_ps(s->value + found, _mm512_maskz_compress_ps(some, v));
        found += __builtin_popcount(some);
    }
#else
    for (; k < units; k++) { /* no branch to guess wrong */
        s->unit[found] = (int32_t)k;
        s->value[found] = x[k];
        found += x[k] != 0.0f;
    }
#endif
    return found;
}

/* Lists the observations of joint rows, whose places are given, or which follow each other. */
static void list(const Net *n, const float *obs, const int64_t *places, int64_t rows,
                 const Scratch *s)
{
    const int64_t wide = n->agents * n->observation;
    int32_t found = 0, *start = s->start;
    for (int64_t b = 0; b < rows; b++) {
        const float *x = obs + (places ? places[b] : b) * wide;
        if (places && b + 1 < rows) { /* they lie anywhere in memory: ask early */
            const float *later = obs + places[b + 1] * wide;
            for (int64_t k = 0; k < wide; k += LANES) __builtin_prefetch(later + k);
        }
        for (int64_t i = 0; i < n->agents; i++, x += n->observation) {
            *start++ = found;
            found = find(x, n->observation, s, found);
        }
    }
    *start = found;
}

/* Copies what run r has drawn, and lists what it has seen: the observations, then the next. */
static void take(const Net *n, const Memory *m, int64_t r, int64_t size, const Scratch *s,
                 const Batch *batch)
{
    const int64_t *rows = m->rows + r * size, numbers = n->agents * n->action;
    for (int64_t b = 0; b < size; b++) {
        const int64_t at = r * m->run_rows + rows[b];
        const float *action = m->action + at * numbers, *reward = m->reward + at * n->agents;
        memcpy(batch->action + b * numbers, action, (size_t)numbers * sizeof(float));
        memcpy(batch->reward + b * n->agents, reward, (size_t)n->agents * sizeof(float));
        batch->discount[b] = m->discount[at];
        s->places[b] = rows[b];
        s->places[size + b] = m->next_row[at];
    }
    list(n, m->obs + r * m->obs_rows * n->agents * n->observation, s->places, 2 * size, s);
}

/* The columns of a row, as many as registers hold; the last vector may overlap its neighbour. */
#define VEC(v) ((v) == vecs - 1 ? last : (v) * LANES)
#define BY_COLUMNS(width, CALL)                                                           \
    do {                                                                                  \
        const int64_t all = ((width) + LANES - 1) / LANES, parts = (all + 7) / 8;         \
        const int64_t most = (all + parts - 1) / parts;                                   \
        for (int64_t vecs = all - most * (parts - 1), h = 0; h < (width); vecs = most) {  \
            const int64_t next = h + vecs * LANES;                                        \
            const int64_t last = (next < (width) ? next : (width)) - LANES - h;           \
            switch (vecs) {                                                               \
                case 1: CALL(1); break; case 2: CALL(2); break; case 3: CALL(3); break;   \
                case 4: CALL(4); break; case 5: CALL(5); break; case 6: CALL(6); break;   \
                case 7: CALL(7); break; default: CALL(8);                                 \
            }                                                                             \
            h = next;                                                                     \
        }                                                                                 \
    } while (0)

typedef struct { const int32_t *unit; const float *value; int64_t count; } Row; /* what is not 0 */
static const int32_t IN_ORDER[LANES] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
static const Row NOTHING = {0};

static Row observation_of(const Scratch *s, int64_t t)
{
    const int32_t from = s->start[t];
    return (Row){s->unit + from, s->value + from, s->start[t + 1] - from};
}

static Row action_of(const Net *n, const float *actions, int64_t t)
{
    return (Row){IN_ORDER, actions + t * n->action, n->action};
}

INLINE void add_row(int vecs, int64_t last, Vec *sum, Row x, const float *weight, int64_t width)
{
    for (int64_t e = 0; e < x.count; e++) {
        const float *row = weight + x.unit[e] * width, value = x.value[e];
        __asm__("" : "+r"(row)); /* one address for all of them; gcc makes one for each */
        for (int v = 0; v < vecs; v++) sum[v] += value * READ(row + VEC(v));
    }
}

INLINE void add_up_columns(int vecs, int64_t last, Row x, const float *weight, Row a,
                           const float *action_weight, int64_t width, const float *start,
                           After after, float *out)
{
    Vec sum[8];
    for (int v = 0; v < vecs; v++) sum[v] = start ? READ(start + VEC(v)) : (Vec){0};
    add_row(vecs, last, sum, x, weight, width);
    add_row(vecs, last, sum, a, action_weight, width);
    for (int v = 0; v < vecs; v++)
        AT(out + VEC(v)) = after == RELU ? (Vec)((Mask)sum[v] & ~(sum[v] < 0.0f)) : sum[v];
}

/* out[width] = after(start + x times weight + a times action_weight). */
static void add_up(Row x, const float *weight, Row a, const float *action_weight, int64_t width,
                   const float *start, After after, float *out)
{
#define CALL(V) add_up_columns(V, last, x, weight + h, a, action_weight + h, width, \
                               start ? start + h : NULL, after, out + h)
    BY_COLUMNS(width, CALL);
#undef CALL
}

INLINE void spread_columns(int vecs, int64_t last, Row x, float *weight, int64_t width,
                           const float *grad)
{
    Vec slope[8], sum[8];
    for (int v = 0; v < vecs; v++) slope[v] = READ(grad + VEC(v));
    for (int64_t e = 0; e < x.count; e++) {
        float *row = weight + x.unit[e] * width, value = x.value[e];
        __asm__("" : "+r"(row));
        for (int v = 0; v < vecs; v++) sum[v] = READ(row + VEC(v)) + value * slope[v];
        for (int v = 0; v < vecs; v++) AT(row + VEC(v)) = sum[v]; /* all are read by now: overlap */
    }
}

/* The transposed of that: the rows of a gradient += what they were multiplied by times grad. */
static void spread(Row x, float *weight, int64_t width, const float *grad)
{
#define CALL(V) spread_columns(V, last, x, weight + h, width, grad + h)
    BY_COLUMNS(width, CALL);
#undef CALL
}

/* out += x */
static void add(int64_t count, const float *restrict x, float *restrict out)
{
    for (int64_t h = 0; h < count; h++) out[h] += x[h];
}

/* g's input: bias + the others' observations, if kept, + their actions; out [B, N, joint]. */
static void add_others(const Net *n, const Scratch *s, const float *flat, int64_t r, int64_t batch,
                       int64_t t, const float *action, const float *keep, float *out)
{
    const Layer *l = &n->g1;
    const int64_t width = l->outputs, joint = n->h1.inputs, agents = n->agents;
    const float *weight = weight_of(l, flat, r), *bias = bias_of(l, flat, r);
    const float *acted = weight + n->senders * n->observation * width;
    float *unseen = s->part, *seen = s->part + width;
    for (int64_t row = 0; row < batch * agents; row++)
        memcpy(out + row * joint, bias, (size_t)width * sizeof(float));
    for (int64_t k = 0; k < n->senders; k++) {
        for (int64_t row = 0; row < 2 * batch; row++) {
            const int64_t b = row / 2, j = k + row % 2, at = b * agents + j;
            add_up(NOTHING, weight, action_of(n, action, at), acted, width, NULL, PLAIN, unseen);
            add_up(observation_of(s, t + at), weight, NOTHING, acted, width, unseen, PLAIN, seen);
            const int64_t from = j == k ? k + 1 : 0, to = j == k ? agents : k + 1;
            for (int64_t i = from; i < to; i++) {
                float *sum = out + (b * agents + i) * joint;
                if (keep[(i * batch + b) * n->senders + k] != 0.0f) add(width, seen, sum);
                else if (!n->masks_actions) add(width, unseen, sum);
            }
        }
        weight += n->observation * width, acted += n->action * width;
    }
    for (int64_t row = 0; row < batch * agents; row++)
        for (float *x = out + row * joint; x < out + row * joint + width; x++)
            *x = *x < 0.0f ? 0.0f : *x; /* NaN stays */
}

/* The gradient of that; grad [B, N, joint]. */
static void spread_others(const Net *n, const Scratch *s, int64_t batch, const float *action,
                          const float *keep, const float *grad)
{
    const int64_t width = n->g1.outputs, joint = n->h1.inputs, agents = n->agents;
    float *weight = s->g1.weight, *acted = weight + n->senders * n->observation * width;
    float *all = s->part, *kept = s->part + width;
    for (int64_t k = 0; k < n->senders; k++) {
        for (int64_t row = 0; row < 2 * batch; row++) {
            const int64_t b = row / 2, j = k + row % 2, at = b * agents + j;
            const int64_t from = j == k ? k + 1 : 0, to = j == k ? agents : k + 1;
            memset(s->part, 0, (size_t)(2 * width) * sizeof(float));
            for (int64_t i = from; i < to; i++) {
                const float *each = grad + (b * agents + i) * joint;
                const int passes = keep[(i * batch + b) * n->senders + k] != 0.0f;
                add(width, each, passes ? kept : all);
            }
            spread(observation_of(s, at), weight, width, kept);
            add(width, kept, all);
            spread(action_of(n, action, at), acted, width, n->masks_actions ? kept : all);
        }
        weight += n->observation * width, acted += n->action * width;
    }
}

/* Dense layers. */

static void dense(const Layer *l, const float *flat, int64_t r, const float *in, int64_t in_row,
                  int64_t rows, float *out, int64_t out_row)
{
    const Product p = {in, in_row, 1, weight_of(l, flat, r), l->outputs, l->inputs};
    product(p, rows, l->outputs, bias_of(l, flat, r), RELU, NULL, out, out_row);
}

/* A last layer has few outputs: its weight is widened to LANES; out [rows, LANES]. */
static void last_layer(const Layer *l, const Scratch *s, const float *flat, int64_t r,
                       const float *in, int64_t rows, float *out)
{
    const size_t size = (size_t)l->outputs * sizeof(float);
    const float *weight = weight_of(l, flat, r), *start = s->last + l->inputs * LANES;
    memset(s->last, 0, (size_t)((l->inputs + 1) * LANES) * sizeof(float));
    for (int64_t k = 0; k < l->inputs; k++)
        memcpy(s->last + k * LANES, weight + k * l->outputs, size);
    memcpy(s->last + l->inputs * LANES, bias_of(l, flat, r), size);
    const Product p = {in, l->inputs, 1, s->last, LANES, l->inputs};
    product(p, rows, LANES, start, PLAIN, NULL, out, LANES);
}

/* c [rows, inputs] = a [rows, outputs] times the transposed weight, where gate > 0. */
static void back(const Layer *l, const Scratch *s, const float *flat, int64_t r, int64_t inputs,
                 const float *a, int64_t a_row, int64_t rows, const float *gate, float *c,
                 int64_t c_row)
{
    const float *weight = weight_of(l, flat, r);
    for (int64_t o = 0; o < l->outputs; o++)
        for (int64_t i = 0; i < inputs; i++)
            s->turned[o * inputs + i] = weight[i * l->outputs + o];
    const Product p = {a, a_row, 1, s->turned, inputs, l->outputs};
    product(p, rows, inputs, NULL, THROUGH_RELU, gate, c, c_row);
}

static void add_bias(const Layer *l, Gradient to, const float *grad, int64_t grad_row, int64_t rows)
{
    for (int64_t b = 0; b < rows; b++) add(l->outputs, grad + b * grad_row, to.bias);
}

/* Gradients of a layer: in^T grad, and the sum of grad. */
static void gradients(const Layer *l, Gradient to, const float *in, int64_t in_row,
                      const float *grad, int64_t grad_row, int64_t rows)
{
    const Product p = {in, 1, in_row, grad, grad_row, rows};
    product(p, l->inputs, l->outputs, NULL, PLAIN, NULL, to.weight, l->outputs);
    add_bias(l, to, grad, grad_row, rows);
}

static void last_gradients(const Layer *l, const Scratch *s, Gradient to, const float *in,
                           const float *grad, int64_t rows)
{
    const Product p = {in, 1, l->inputs, grad, LANES, rows};
    product(p, l->inputs, LANES, NULL, PLAIN, NULL, s->last, LANES);
    for (int64_t k = 0; k < l->inputs; k++)
        memcpy(to.weight + k * l->outputs, s->last + k * LANES, (size_t)l->outputs * sizeof(float));
    add_bias(l, to, grad, LANES, rows);
}

/* Actor and critic; observations t on. */

static void act(const Net *n, const Scratch *s, const float *flat, int64_t r, int64_t t,
                int64_t rows, float *action)
{
    const int64_t units = n->a1.outputs;
    const float *weight = weight_of(&n->a1, flat, r), *bias = bias_of(&n->a1, flat, r);
    for (int64_t row = 0; row < rows; row++)
        add_up(observation_of(s, t + row), weight, NOTHING, weight, units, bias, RELU,
               s->hidden + row * units);
    last_layer(&n->a2, s, flat, r, s->hidden, rows, s->numbers);
    for (int64_t row = 0; row < rows; row++)
        for (int64_t a = 0; a < n->action; a++)
            *action++ = tanhf(s->numbers[row * LANES + a]);
}

static void judge(const Net *n, const Scratch *s, const float *flat, int64_t r, int64_t batch,
                  int64_t t, const float *action, const float *own, const float *keep,
                  const Pass *pass)
{
    const int64_t rows = batch * n->agents, first = n->f1.outputs, wide = n->f2.inputs;
    const int64_t second = n->f2.outputs, joint = n->h1.inputs;
    const float *weight = weight_of(&n->f1, flat, r), *bias = bias_of(&n->f1, flat, r);
    const float *acted = weight + n->observation * first;
    for (int64_t row = 0; row < rows; row++) {
        float *f1 = pass->f1 + row * wide;
        add_up(observation_of(s, t + row), weight, action_of(n, own, row), acted, first, bias, RELU,
               f1);
        memcpy(f1 + first, own + row * n->action, (size_t)n->action * sizeof(float));
    }
    dense(&n->f2, flat, r, pass->f1, wide, rows, pass->joint, joint);
    if (n->senders) add_others(n, s, flat, r, batch, t, action, keep, pass->joint + second);
    dense(&n->h1, flat, r, pass->joint, joint, rows, pass->h1, n->h1.outputs);
    last_layer(&n->h2, s, flat, r, pass->h1, rows, pass->q);
}

/* Follows grad_last through h and f; of the joint features as many as are asked for. */
static void follow_back(const Net *n, const Scratch *s, const float *flat, int64_t r, int64_t rows,
                        int64_t features)
{
    const int64_t first = n->f1.outputs, joint = n->h1.inputs, h = n->h1.outputs;
    const int64_t wide = n->f2.inputs;
    back(&n->h2, s, flat, r, h, s->grad_last, LANES, rows, s->online.h1, s->grad_h1, h);
    back(&n->h1, s, flat, r, features, s->grad_h1, h, rows, s->online.joint, s->grad_joint, joint);
    back(&n->f2, s, flat, r, first, s->grad_joint, joint, rows, s->online.f1, s->grad_f1, wide);
}

/* Adam with the gradients from `grad` on, as long as they are, then the target follows. */
static void move(const Adam *adam, const Rule *rule, float factor, const Numbers *t, int64_t at,
                 const float *grad, int64_t count)
{
    float part[5][LANES] = {{0}}, *all[4] = {t->weights, t->exp_avg, t->exp_avg_sq, t->target};
    float *to[4];
    for (int64_t k = 0; k < count; k += LANES) {
        const int64_t left = count - k < LANES ? count - k : LANES;
        for (int i = 0; i < 4; i++) {
            to[i] = all[i] + at + k;
            if (left < LANES) to[i] = memcpy(part[i], to[i], (size_t)left * sizeof(float));
        }
        adam_step(*adam, to[0], to[1], to[2], factor * READ(grad + k));
        AT(to[3]) += rule->tau * (READ(to[0]) - READ(to[3]));
        for (int i = 0; left < LANES && i < 4; i++)
            memcpy(all[i] + at + k, part[i], (size_t)left * sizeof(float));
    }
}

/* The factor that brings a gradient to at most `limit`; 0 does not clip, NaN goes through. */
static float clip(const float *grad, const float *end, float limit)
{
    Vec sums[4] = {{0}};
    float total = 0.0f;
    for (int64_t k = 0; grad < end; grad += LANES, k++) sums[k % 4] += READ(grad) * READ(grad);
    const Vec sum = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    for (int i = 0; i < LANES; i++) total += sum[i];
    const float norm = sqrtf(total), factor = limit / (norm < 1e-12f ? 1e-12f : norm);
    return limit > 0.0f ? factor > 1.0f ? 1.0f : factor : 1.0f;
}

/* Adam and the targets of layers whose gradients lie between the first one's and `end`. */
static void move_all(const Rule *rule, const Adam *adam, const Numbers *t, int64_t r, int layers,
                     const Layer *const *layer, const Gradient *const *grad, const float *end)
{
    const float factor = clip(grad[0]->weight, end, rule->max_norm);
    for (int i = 0; i < layers; i++) {
        const int64_t outputs = layer[i]->outputs, count = layer[i]->inputs * outputs;
        move(adam, rule, factor, t, layer[i]->weight + r * count, grad[i]->weight, count);
        move(adam, rule, factor, t, layer[i]->bias + r * outputs, grad[i]->bias, outputs);
    }
}

/* The critic's loss on its own actions and the target's, and its step (l. 273). */
static void improve_critic(const Net *n, const Scratch *s, const Rule *rule, const Numbers *critic,
                           const Batch *batch, int64_t r, int64_t size)
{
    const int64_t rows = size * n->agents, h = n->h1.outputs, joint = n->h1.inputs;
    const int64_t first = n->f1.outputs, second = n->f2.outputs, wide = n->f2.inputs;
    memset(s->grad_last, 0, (size_t)(rows * LANES) * sizeof(float));
    for (int64_t row = 0; row < rows; row++) {
        const float q = s->online.q[row * LANES], after = s->target.q[row * LANES];
        const float discount = batch->discount[row / n->agents];
        const float error = q - (batch->reward[row] + rule->gamma * discount * after);
        batch->q[row] = q;
        batch->loss[row] = error * error;
        s->grad_last[row * LANES] = 2.0f * error / (float)rows;
    }
    follow_back(n, s, critic->weights, r, rows, joint);
    memset(s->f1.weight, 0, (size_t)(s->end - s->f1.weight) * sizeof(float));
    const float *grad_f1 = s->grad_f1, *action = batch->action;
    for (int64_t row = 0; row < rows; row++, grad_f1 += wide) {
        spread(observation_of(s, row), s->f1.weight, first, grad_f1);
        spread(action_of(n, action, row), s->f1.weight + n->observation * first, first, grad_f1);
    }
    add_bias(&n->f1, s->f1, s->grad_f1, wide, rows);
    gradients(&n->f2, s->f2, s->online.f1, wide, s->grad_joint, joint, rows);
    if (n->senders) {
        spread_others(n, s, size, action, batch->keep, s->grad_joint + second);
        add_bias(&n->g1, s->g1, s->grad_joint + second, joint, rows);
    }
    gradients(&n->h1, s->h1, s->online.joint, joint, s->grad_h1, h, rows);
    last_gradients(&n->h2, s, s->h2, s->online.h1, s->grad_last, rows);
    const Layer *layers[5] = {&n->f1, &n->f2, &n->h1, &n->h2, &n->g1};
    const Gradient *grads[5] = {&s->f1, &s->f2, &s->h1, &s->h2, &s->g1};
    move_all(rule, &rule->critic, critic, r, n->senders ? 5 : 4, layers, grads, s->end);
}

/* The gradient of -Q by the own action, through both places where it enters: [rows, LANES]. */
static void by_action(const Net *n, const Scratch *s, const float *flat, int64_t r, int64_t rows)
{
    const int64_t first = n->f1.outputs, second = n->f2.outputs, wide = n->f2.inputs;
    const float *late = weight_of(&n->f2, flat, r) + first * second;
    const float *early = weight_of(&n->f1, flat, r) + n->observation * first;
    memset(s->last, 0, (size_t)((first + second) * LANES) * sizeof(float));
    for (int64_t a = 0; a < n->action; a++) {
        for (int64_t k = 0; k < first; k++) s->last[k * LANES + a] = early[a * first + k];
        for (int64_t k = 0; k < second; k++)
            s->last[(first + k) * LANES + a] = late[a * second + k];
    }
    const Product through_f1 = {s->grad_f1, wide, 1, s->last, LANES, first};
    const Product at_f2 = {s->grad_joint, n->h1.inputs, 1, s->last + first * LANES, LANES, second};
    product(through_f1, rows, LANES, NULL, PLAIN, NULL, s->grad_own, LANES);
    product(at_f2, rows, LANES, NULL, PLAIN, NULL, s->grad_last, LANES);
    add(rows * LANES, s->grad_last, s->grad_own);
}

/* The policy gradient (l. 277): own action from the actor, the rest as replayed. */
static void improve_actor(const Net *n, const Scratch *s, const Rule *rule, const Numbers *actor,
                          const float *critic, const Batch *batch, int64_t r, int64_t size)
{
    const int64_t rows = size * n->agents, units = n->a1.outputs;
    act(n, s, actor->weights, r, 0, rows, s->own);
    judge(n, s, critic, r, size, 0, batch->action, s->own, batch->keep, &s->online);
    memset(s->grad_last, 0, (size_t)(rows * LANES) * sizeof(float));
    for (int64_t row = 0; row < rows; row++) s->grad_last[row * LANES] = -1.0f / (float)rows;
    follow_back(n, s, critic, r, rows, n->f2.outputs);
    by_action(n, s, critic, r, rows);
    for (int64_t row = 0; row < rows; row++)
        for (int64_t a = 0; a < n->action; a++) {
            const float action = s->own[row * n->action + a];
            s->grad_own[row * LANES + a] *= 1.0f - action * action;
        }
    memset(s->a1.weight, 0, (size_t)(s->f1.weight - s->a1.weight) * sizeof(float));
    back(&n->a2, s, actor->weights, r, units, s->grad_own, LANES, rows, s->hidden, s->grad_hidden,
         units);
    for (int64_t row = 0; row < rows; row++)
        spread(observation_of(s, row), s->a1.weight, units, s->grad_hidden + row * units);
    add_bias(&n->a1, s->a1, s->grad_hidden, units, rows);
    last_gradients(&n->a2, s, s->a2, s->hidden, s->grad_own, rows);
    const Layer *layers[2] = {&n->a1, &n->a2};
    const Gradient *grads[2] = {&s->a1, &s->a2};
    move_all(rule, &rule->actor, actor, r, 2, layers, grads, s->f1.weight);
}

/* What Python calls. */

/* Puts the buffers for minibatches of `batch` into `memory`; returns the bytes that they take. */
static int64_t lay_out(const Net *n, int64_t batch, char *memory, Scratch *s)
{
    const int64_t rows = batch * n->agents, h = n->h1.outputs, joint = n->h1.inputs;
    const int64_t wide = n->f2.inputs, found = 2 * rows * n->observation + LANES;
    const int64_t first = n->f1.outputs, units = n->a1.outputs;
    int64_t at = 0, most = joint * h;
    if (wide * n->f2.outputs > most) most = wide * n->f2.outputs;
    if (LANES * units > most) most = LANES * units;
#define TAKE(pointer, count)                                          \
    (pointer) = (void *)(memory + at);                                \
    at += ((count) * (int64_t)sizeof(*(pointer)) + 63) / 64 * 64
    const Layer *layers[7] = {&n->a1, &n->a2, &n->f1, &n->f2, &n->g1, &n->h1, &n->h2};
    Gradient *grads[7] = {&s->a1, &s->a2, &s->f1, &s->f2, &s->g1, &s->h1, &s->h2};
    for (int i = 0; i < 7; i++) {
        TAKE(grads[i]->weight, layers[i]->inputs * layers[i]->outputs);
        TAKE(grads[i]->bias, layers[i]->outputs);
    }
    TAKE(s->end, 0);
    Pass *passes[2] = {&s->online, &s->target};
    for (int i = 0; i < 2; i++) {
        TAKE(passes[i]->f1, rows * wide);
        TAKE(passes[i]->joint, rows * joint);
        TAKE(passes[i]->h1, rows * h);
        TAKE(passes[i]->q, rows * LANES);
    }
    TAKE(s->places, 2 * batch);
    TAKE(s->action, rows * n->action);
    TAKE(s->reward, rows);
    TAKE(s->discount, batch);
    TAKE(s->own, rows * n->action);
    TAKE(s->hidden, rows * units);
    TAKE(s->numbers, rows * LANES);
    TAKE(s->part, 2 * n->g1.outputs);
    TAKE(s->turned, most);
    TAKE(s->last, (first + joint + h + units + 1) * LANES);
    TAKE(s->grad_last, rows * LANES);
    TAKE(s->grad_hidden, rows * units);
    TAKE(s->grad_h1, rows * h);
    TAKE(s->grad_joint, rows * joint);
    TAKE(s->grad_f1, rows * wide);
    TAKE(s->grad_own, rows * LANES);
    TAKE(s->start, 2 * rows + 1);
    TAKE(s->unit, found); /* whole vectors are written */
    TAKE(s->value, found);
    return at;
}

int64_t scratch_bytes(const Net *n, int64_t batch)
{
    Scratch s;
    return lay_out(n, batch, NULL, &s);
}

/* One update of every run on `size` joint samples; keep [R, N, B, S], loss and q [R, B, N]. */
void update(const Net *n, const Numbers *actor, const Numbers *critic, const Memory *memory,
            const float *keep, const Rule *rule, int64_t size, int64_t improves_actor,
            char *scratch, float *loss, float *q)
{
    Scratch s;
    const int64_t rows = size * n->agents;
    lay_out(n, size, scratch, &s);
    for (int64_t r = 0; r < n->runs; r++) {
        const Batch batch = {s.action, s.reward, s.discount, keep + r * rows * n->senders,
                             loss + r * rows, q + r * rows};
        take(n, memory, r, size, &s, &batch);
        act(n, &s, actor->target, r, rows, rows, s.own);
        judge(n, &s, critic->target, r, size, rows, s.own, s.own, batch.keep, &s.target);
        judge(n, &s, critic->weights, r, size, 0, s.action, s.action, batch.keep, &s.online);
        improve_critic(n, &s, rule, critic, &batch, r, size);
        if (improves_actor) improve_actor(n, &s, rule, actor, critic->weights, &batch, r, size);
    }
}

/* The actions [R, games, N, A] of the actors for observations in order. */
void actions(const Net *n, const float *actor, const float *obs, int64_t games, int64_t size,
             char *scratch, float *action)
{
    Scratch s;
    lay_out(n, size, scratch, &s);
    for (int64_t r = 0; r < n->runs; r++)
        for (int64_t b = 0; b < games; b += size) {
            const int64_t count = games - b < size ? games - b : size, rows = count * n->agents;
            list(n, obs, NULL, count, &s);
            act(n, &s, actor, r, 0, rows, action);
            obs += rows * n->observation, action += rows * n->action;
        }
}
