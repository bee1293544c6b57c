/* The whole update of dcc.py, agent after agent, while an agent's numbers are in the cache.
 *
 * The rule is that of DCC._minimise, which is its oracle (tests/test_compiled.py): two online
 * passes and one of the target, label eq:5's target, the loss, backward, Adam. Q = h(f, g) serves
 * all three networks: FDC's and Concat's perceptron is f and h, and its g sees no block. Widths are
 * multiples of LANES. Every sum has one order whatever the stack: a run's bits are its own.
 * It is one long file, since the compiler has to see the passes and Adam as one thing.
 *
 * Bytes are mostly zeros (pursuit: 8% ones). Their first layer adds up the weights' rows of the
 * ones, block by block, so that a block's rows stay in the nearest caches. Their gradient is made
 * and used up block by block, too.
 */
#include <stdint.h>
#include <string.h>
#ifdef __AVX512VBMI2__
#include <immintrin.h>
#endif

#include "../networks/products.h"

enum { AHEAD = 4 };

typedef struct {
    int64_t networks, blocks, own_blocks, units, bytes, factors;
    Layer f1, f2, g1, h1, h2;
} Net;
typedef struct { /* memories of runs, of `agents` networks each; Drawn in protocol.py */
    const void *obs;
    const int32_t *next_row;
    const uint8_t *action;
    const float *reward, *discount;
    const int64_t *rows, *shown;              /* rows NULL: all of a run's observations in order */
    int64_t agents, obs_blocks, obs_rows, run_rows; /* blocks in a row of obs; rows of a run */
} Memory;
typedef struct { const float *values; int64_t network, row; } Factor; /* strides */
typedef struct { float gamma, huber; Adam adam; } Rule;
typedef struct { float *x, *f1, *joint, *h1, *q; } Pass;
typedef struct {
    Pass online, target;
    float *last, *grad_q, *grad_h1, *grad_joint, *grad_f1, *gradient, *turned;
    int64_t *row;   /* [rows] of obs */
    int32_t *start; /* [rows, blocks + 1]: a block's first one */
    uint16_t *unit; /* of each one */
    uint8_t *value;
} Scratch;

/* The first layer over bytes. */

/* sum[0..vecs) += factor * value * weight row, over the ones `from` to `to` of one block. */
INLINE void add_rows(int vecs, float *sum, const float *w, int64_t width, const Scratch *s,
                     int32_t from, int32_t to, const float *f, int64_t f_step)
{
    Vec acc[8];
    for (int v = 0; v < vecs; v++) acc[v] = READ(sum + v * LANES);
    for (int32_t e = from; e < to; e++) {
        const int64_t unit = s->unit[e];
        const float share = (float)s->value[e] * f[unit * f_step];
        const float *row = w + unit * width;
        __asm__("" : "+r"(row)); /* one address for all of them; gcc makes one for each */
        for (int v = 0; v < vecs; v++) acc[v] += share * READ(row + v * LANES);
    }
    for (int v = 0; v < vecs; v++) AT(sum + v * LANES) = acc[v];
}

/* The transposed of that: gradient row of each one += factor * value * grad_out. */
INLINE void spread_rows(int vecs, float *gradient, const float *grad_out, int64_t width,
                        const Scratch *s, int32_t from, int32_t to, const float *f, int64_t f_step)
{
    Vec grad[8];
    for (int v = 0; v < vecs; v++) grad[v] = READ(grad_out + v * LANES);
    for (int32_t e = from; e < to; e++) {
        const int64_t unit = s->unit[e];
        const float share = (float)s->value[e] * f[unit * f_step];
        float *row = gradient + unit * width;
        __asm__("" : "+r"(row));
        for (int v = 0; v < vecs; v++) AT(row + v * LANES) += share * grad[v];
    }
}

#define BY_VECS(n, CALL)                              \
    switch (n) {                                      \
        case 1: CALL(1); break; case 2: CALL(2); break; \
        case 3: CALL(3); break; case 4: CALL(4); break; \
        case 5: CALL(5); break; case 6: CALL(6); break; \
        case 7: CALL(7); break; default: CALL(8);       \
    }

/* Appends the units of x that are not zero, and their values, at `found`; returns the new end. */
static int32_t find_ones(const uint8_t *x, int64_t units, const Scratch *s, int32_t found)
{
    int64_t k = 0;
#ifdef __AVX512VBMI2__
    __m512i unit = _mm512_add_epi16(
        _mm512_set_epi16(31, 30, 29, 28, 27, 26, 25, 24, 23, 22, 21, 20, 19, 18, 17, 16, 15, 14, 13,
                         12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0), _mm512_setzero_si512());
    for (; k < units; k += 32, unit = _mm512_add_epi16(unit, _mm512_set1_epi16(32))) {
        const __mmask32 there = units - k < 32 ? (1u << (units - k)) - 1u : ~0u;
        const __m256i bytes = _mm256_maskz_loadu_epi8(there, x + k);
        const __mmask32 ones = _mm256_test_epi8_mask(bytes, bytes);
        _mm512_storeu_si512(s->unit + found, _mm512_maskz_compress_epi16(ones, unit));
        _mm256_storeu_si256((void *)(s->value + found), _mm256_maskz_compress_epi8(ones, bytes));
        found += __builtin_popcount(ones);
    }
#else
    for (; k < units; k++) { /* no branch to guess wrong */
        s->unit[found] = (uint16_t)k;
        s->value[found] = x[k];
        found += x[k] != 0;
    }
#endif
    return found;
}

/* out[rows, first.outputs] += x~ times the weights of blocks j0 to j1, x~ = bytes times factors. */
static void add_ones(const Net *n, const Scratch *s, const float *weight, int64_t width, int64_t j0,
                     int64_t j1, const float *f, int64_t f_row, int64_t row0, int64_t rows,
                     float *out, int64_t stride)
{
    for (int64_t j = j0; j < j1; j++) {
        const float *w = weight + (j - j0) * n->units * width;
        for (int64_t b = 0; b < rows; b++) {
            const float *fs = f + b * f_row + j * n->factors;
            if (n->factors == 1 && fs[0] == 0.0f) continue; /* a dropped message */
            const int32_t *start = s->start + (row0 + b) * (n->blocks + 1) + j;
            for (int64_t h = 0; h < width; h += 8 * LANES) {
                float *sum = out + b * stride + h;
                const int64_t vecs = (width - h) / LANES;
#define CALL(V) add_rows(V, sum, w + h, width, s, start[0], start[1], fs, n->factors > 1)
                BY_VECS(vecs, CALL)
#undef CALL
            }
        }
    }
}

/* Adam, layer by layer. */

static void adam_bias(Adam r, const Numbers *t, int64_t at, const float *rows,
                      int64_t stride, int64_t count, int64_t outputs, float *gradient)
{
    for (int64_t h = 0; h < outputs; h += LANES) {
        Vec sum = {0};
        for (int64_t b = 0; b < count; b++) sum += READ(rows + b * stride + h);
        AT(gradient + h) = sum;
    }
    adam(r, t, at, gradient, outputs);
}

/* The first layer's weights of blocks j0 to j1, from `at` on; rows are its grad_out. */
static void adam_ones(const Net *n, const Scratch *s, Adam r, const Numbers *t, int64_t at,
                      int64_t width, int64_t j0, int64_t j1, const float *f, int64_t f_row,
                      int64_t count, const float *rows, int64_t stride)
{
    const int64_t block = n->units * width;
    for (int64_t j = j0; j < j1; j++, at += block) {
        memset(s->gradient, 0, (size_t)block * sizeof(float));
        for (int64_t b = 0; b < count; b++) {
            const float *fs = f + b * f_row + j * n->factors;
            if (n->factors == 1 && fs[0] == 0.0f) continue;
            const int32_t *start = s->start + b * (n->blocks + 1) + j;
            for (int64_t h = 0; h < width; h += 8 * LANES) {
                const float *grad_out = rows + b * stride + h;
                float *gradient = s->gradient + h;
#define CALL(V) spread_rows(V, gradient, grad_out, width, s, start[0], start[1], fs, n->factors > 1)
                BY_VECS((width - h) / LANES, CALL)
#undef CALL
            }
        }
        adam(r, t, at, s->gradient, block);
    }
}

/* One network's passes. */

static const void *block_at(const Net *n, const Memory *m, const Scratch *s, int64_t g, int64_t b,
                            int64_t j)
{
    const int64_t shown = m->shown[g % m->agents * n->blocks + j];
    const int64_t at = (s->row[b] * m->obs_blocks + shown) * n->units;
    return (const char *)m->obs + at * (n->bytes ? 1 : (int64_t)sizeof(float));
}

static void read_ones(const Net *n, const Memory *m, const Scratch *s, int64_t g, int64_t count)
{
    int32_t found = 0, *start = s->start;
    for (int64_t b = 0; b < count; b++) {
        for (int64_t j = 0; j < n->blocks; j++) {
            *start++ = found;
            if (b + AHEAD < count) { /* rows lie anywhere in memory: ask for them early */
                const char *later = block_at(n, m, s, g, b + AHEAD, j);
                for (int64_t k = 0; k < n->units; k += 64) __builtin_prefetch(later + k);
            }
            found = find_ones(block_at(n, m, s, g, b, j), n->units, s, found);
        }
        *start++ = found;
    }
}

static void multiply(const Net *n, const Memory *m, const Scratch *s, int64_t g, int64_t first,
                     int64_t count, const float *f, int64_t f_row, float *x)
{
    for (int64_t b = 0; b < count; b++)
        for (int64_t j = 0; j < n->blocks; j++) {
            const float *from = block_at(n, m, s, g, first + b, j);
            const float *fs = f + b * f_row + j * n->factors;
            if (n->factors == 1)
                for (int64_t k = 0; k < n->units; k++) *x++ = from[k] * fs[0];
            else
                for (int64_t k = 0; k < n->units; k++) *x++ = from[k] * fs[k];
        }
}

/* A first layer: f1 or g1, of blocks j0 to j1. Rows row0 on of the ones, or of x. */
static void first_layer(const Net *n, const Scratch *s, const Layer *l, const float *flat,
                        int64_t g, int64_t j0, int64_t j1, const float *f, int64_t f_row,
                        int64_t row0, int64_t rows, const float *x, float *out, int64_t stride)
{
    const float *weight = flat + l->weight + g * l->inputs * l->outputs;
    const float *bias = flat + l->bias + g * l->outputs;
    const int64_t width = l->outputs, x_row = n->blocks * n->units;
    if (!n->bytes) {
        const Product p = {x + j0 * n->units, x_row, 1, weight, width, l->inputs};
        product(p, rows, width, bias, RELU, NULL, out, stride);
        return;
    }
    for (int64_t b = 0; b < rows; b++)
        memcpy(out + b * stride, bias, (size_t)width * sizeof(float));
    add_ones(n, s, weight, width, j0, j1, f, f_row, row0, rows, out, stride);
    for (int64_t b = 0; b < rows; b++)
        for (int64_t h = 0; h < width; h += LANES) {
            const Vec v = READ(out + b * stride + h);
            AT(out + b * stride + h) = (Vec)((Mask)v & ~(v < 0.0f));
        }
}

static void dense(const Layer *l, const float *flat, int64_t g, const float *in, int64_t in_row,
                  int64_t rows, float *out, int64_t out_row)
{
    const float *weight = flat + l->weight + g * l->inputs * l->outputs;
    const Product p = {in, in_row, 1, weight, l->outputs, l->inputs};
    product(p, rows, l->outputs, flat + l->bias + g * l->outputs, RELU, NULL, out, out_row);
}

/* Q of `rows` rows of network g into pass->q [rows, LANES]; the ones, or x, are there. */
static void forward(const Net *n, const Scratch *s, const float *flat, int64_t g, const float *f,
                    int64_t f_row, int64_t row0, int64_t rows, const Pass *pass)
{
    const int64_t f2 = n->f2.outputs, joint = n->h1.inputs, h = n->h1.outputs;
    first_layer(n, s, &n->f1, flat, g, 0, n->own_blocks, f, f_row, row0, rows, pass->x, pass->f1,
                n->f1.outputs);
    dense(&n->f2, flat, g, pass->f1, n->f1.outputs, rows, pass->joint, joint);
    if (n->g1.outputs)
        first_layer(n, s, &n->g1, flat, g, n->own_blocks, n->blocks, f, f_row, row0, rows, pass->x,
                    pass->joint + f2, joint);
    dense(&n->h1, flat, g, pass->joint, joint, rows, pass->h1, h);
    const int64_t actions = n->h2.outputs;
    const float *weight = flat + n->h2.weight + g * h * actions;
    memset(s->last, 0, (size_t)((h + 1) * LANES) * sizeof(float)); /* padded to whole vectors */
    for (int64_t k = 0; k < h; k++)
        memcpy(s->last + k * LANES, weight + k * actions, (size_t)actions * sizeof(float));
    memcpy(s->last + h * LANES, flat + n->h2.bias + g * actions, (size_t)actions * sizeof(float));
    const Product p = {pass->h1, h, 1, s->last, LANES, h};
    product(p, rows, LANES, s->last + h * LANES, PLAIN, NULL, pass->q, LANES);
}

/* The derivative of the loss by Q, [B, LANES]: label eq:5. Also writes the losses. */
static void slopes(const Net *n, const Scratch *s, const Rule *r, const Memory *m, int64_t g,
                   int64_t size, float *loss)
{
    memset(s->grad_q, 0, (size_t)(size * LANES) * sizeof(float));
    for (int64_t b = 0; b < size; b++) {
        const float *select = s->online.q + (size + b) * LANES, *next_q = s->target.q + b * LANES;
        const int64_t row = g / m->agents * m->run_rows + m->rows[g * size + b];
        const int64_t own = row * m->agents + g % m->agents, action = m->action[own];
        int64_t best = 0;
        for (int64_t a = 1; a < n->h2.outputs; a++) /* the first of the largest; NaN is largest */
            if (!(select[a] <= select[best]) && select[best] == select[best]) best = a;
        const float target = m->reward[own] + r->gamma * m->discount[row] * next_q[best];
        const float error = s->online.q[b * LANES + action] - target;
        const float near = error > 1.0f ? 1.0f : error < -1.0f ? -1.0f : error;
        const float slope = r->huber ? near : 2.0f * error;
        loss[g * size + b] = r->huber ? near * (error - 0.5f * near) : error * error;
        s->grad_q[b * LANES + action] = slope / (float)size;
    }
}

/* c [rows, inputs] = a [rows, outputs] times the layer's weight transposed, where gate > 0. */
static void back(const Layer *l, const Scratch *s, const float *weight, int64_t w_row,
                 const float *a, int64_t a_row, int64_t rows, const float *gate, float *c)
{
    for (int64_t o = 0; o < l->outputs; o++)
        for (int64_t i = 0; i < l->inputs; i++)
            s->turned[o * l->inputs + i] = weight[i * w_row + o];
    const Product p = {a, a_row, 1, s->turned, l->inputs, l->outputs};
    product(p, rows, l->inputs, NULL, THROUGH_RELU, gate, c, l->inputs);
}

/* Adam for a layer with the gradient in^T grad_out, rows of `wide` numbers. */
static void adam_dense(const Layer *l, const Scratch *s, const Rule *r, const Numbers *t, int64_t g,
                       const float *in, int64_t in_row, const float *grad_out, int64_t wide,
                       int64_t out_row, int64_t rows)
{
    const Product p = {in, 1, in_row, grad_out, out_row, rows};
    product(p, l->inputs, wide, NULL, PLAIN, NULL, s->gradient, wide);
    if (wide != l->outputs)
        for (int64_t k = 1; k < l->inputs; k++)
            memmove(s->gradient + k * l->outputs, s->gradient + k * wide,
                    (size_t)l->outputs * sizeof(float));
    const int64_t count = l->inputs * l->outputs;
    adam(r->adam, t, l->weight + g * count, s->gradient, count);
}

static void first_adam(const Net *n, const Layer *l, const Scratch *s, const Rule *r,
                       const Numbers *t, int64_t g, int64_t j0, int64_t j1, const float *f,
                       int64_t f_row, const float *grad_out, int64_t out_row, int64_t size)
{
    if (n->bytes)
        adam_ones(n, s, r->adam, t, l->weight + g * l->inputs * l->outputs, l->outputs, j0, j1, f,
                  f_row, size, grad_out, out_row);
    else
        adam_dense(l, s, r, t, g, s->online.x + j0 * n->units, n->blocks * n->units, grad_out,
                   l->outputs, out_row, size);
}

static void step(const Net *n, const Scratch *s, const Rule *r, const Numbers *t, int64_t g,
                 const float *f, int64_t f_row, int64_t size)
{
    const int64_t f1 = n->f1.outputs, f2 = n->f2.outputs, joint = n->h1.inputs;
    const int64_t h = n->h1.outputs;
    const Pass *o = &s->online;
    const Layer *layers[5] = {&n->f1, &n->f2, &n->g1, &n->h1, &n->h2};
    const float *grads[5] = {s->grad_f1, s->grad_joint, s->grad_joint + f2, s->grad_h1, s->grad_q};
    const int64_t strides[5] = {f1, joint, joint, h, LANES};
    const float *w = t->weights;
    back(&n->h2, s, w + n->h2.weight + g * h * n->h2.outputs, n->h2.outputs, s->grad_q, LANES, size,
         o->h1, s->grad_h1);
    back(&n->h1, s, w + n->h1.weight + g * joint * h, h, s->grad_h1, h, size, o->joint,
         s->grad_joint);
    back(&n->f2, s, w + n->f2.weight + g * f1 * f2, f2, s->grad_joint, joint, size, o->f1,
         s->grad_f1);
    first_adam(n, &n->f1, s, r, t, g, 0, n->own_blocks, f, f_row, s->grad_f1, f1, size);
    if (n->g1.outputs)
        first_adam(n, &n->g1, s, r, t, g, n->own_blocks, n->blocks, f, f_row, s->grad_joint + f2,
                   joint, size);
    adam_dense(&n->f2, s, r, t, g, o->f1, f1, s->grad_joint, f2, joint, size);
    adam_dense(&n->h1, s, r, t, g, o->joint, joint, s->grad_h1, h, h, size);
    adam_dense(&n->h2, s, r, t, g, o->h1, h, s->grad_q, LANES, LANES, size);
    for (int i = 0; i < 5; i++)
        if (layers[i]->outputs) {
            const int64_t outputs = layers[i]->outputs;
            adam_bias(r->adam, t, layers[i]->bias + g * outputs, grads[i], strides[i], size,
                      outputs, s->gradient);
        }
}

/* What Python calls. */

/* Puts the buffers for `rows` rows into `memory`; returns the bytes that they take. */
static int64_t lay_out(const Net *n, int64_t rows, char *memory, Scratch *s)
{
    const int64_t f1 = n->f1.outputs, joint = n->h1.inputs, h = n->h1.outputs;
    const int64_t inputs = n->blocks * n->units, ones = n->bytes ? rows * inputs : 0;
    int64_t most = LANES * h, at = 0;
    const Layer *layers[4] = {&n->f1, &n->f2, &n->g1, &n->h1}; /* of bytes: a block at a time */
    for (int i = 0; i < 4; i++) {
        const int64_t inputs = n->bytes && i % 2 == 0 ? n->units : layers[i]->inputs;
        if (inputs * layers[i]->outputs > most) most = inputs * layers[i]->outputs;
    }
#define TAKE(pointer, count)                                          \
    (pointer) = (void *)(memory + at);                                \
    at += ((count) * (int64_t)sizeof(*(pointer)) + 63) / 64 * 64
    Pass *passes[2] = {&s->online, &s->target};
    for (int i = 0; i < 2; i++) {
        TAKE(passes[i]->x, n->bytes ? 0 : rows * inputs);
        TAKE(passes[i]->f1, rows * f1);
        TAKE(passes[i]->joint, rows * joint);
        TAKE(passes[i]->h1, rows * h);
        TAKE(passes[i]->q, rows * LANES);
    }
    TAKE(s->last, (h + 1) * LANES);
    TAKE(s->grad_q, rows * LANES);
    TAKE(s->grad_h1, rows * h);
    TAKE(s->grad_joint, rows * joint);
    TAKE(s->grad_f1, rows * f1);
    TAKE(s->gradient, most);
    TAKE(s->turned, most);
    TAKE(s->row, rows);
    TAKE(s->start, rows * (n->blocks + 1));
    TAKE(s->unit, ones + 32); /* whole vectors are written */
    TAKE(s->value, ones + 32);
    return at;
}

int64_t scratch_bytes(const Net *n, int64_t rows)
{
    Scratch s;
    return lay_out(n, rows, NULL, &s);
}

/* q [G, rows, actions] of all networks, `chunk` rows at a time. */
void q_values(const Net *n, const Numbers *numbers, const Memory *m, const Factor *factor,
              int64_t rows, int64_t chunk, char *memory, float *q)
{
    Scratch s;
    lay_out(n, chunk, memory, &s);
    for (int64_t g = 0; g < n->networks; g++)
        for (int64_t first = 0; first < rows; first += chunk) {
            const int64_t count = rows - first < chunk ? rows - first : chunk;
            const float *f = factor->values + g * factor->network + first * factor->row;
            for (int64_t b = 0; b < count; b++) s.row[b] = g / m->agents * rows + first + b;
            if (n->bytes)
                read_ones(n, m, &s, g, count);
            else
                multiply(n, m, &s, g, 0, count, f, factor->row, s.online.x);
            forward(n, &s, numbers->weights, g, f, factor->row, 0, count, &s.online);
            for (int64_t i = 0; i < count; i++, q += n->h2.outputs)
                memcpy(q, s.online.q + i * LANES, (size_t)n->h2.outputs * sizeof(float));
        }
}

/* One update of every network on `size` samples; loss [G, size], q [G, 2 size, actions]. */
void update(const Net *n, const Numbers *numbers, const Memory *m, const Factor *factor,
            const Rule *rule, int64_t size, char *memory, float *loss, float *q)
{
    Scratch s;
    lay_out(n, 2 * size, memory, &s);
    for (int64_t g = 0; g < n->networks; g++) {
        const float *f = factor->values + g * factor->network;
        const int64_t run = g / m->agents;
        for (int64_t b = 0; b < size; b++) { /* the observations, then the next ones */
            const int64_t row = m->rows[g * size + b];
            s.row[b] = run * m->obs_rows + row;
            s.row[size + b] = run * m->obs_rows + m->next_row[run * m->run_rows + row];
        }
        if (n->bytes) {
            read_ones(n, m, &s, g, 2 * size);
        } else {
            multiply(n, m, &s, g, 0, 2 * size, f, factor->row, s.online.x);
            multiply(n, m, &s, g, size, size, f, factor->row, s.target.x);
        }
        forward(n, &s, numbers->weights, g, f, factor->row, 0, 2 * size, &s.online);
        forward(n, &s, numbers->target, g, f, factor->row, size, size, &s.target); /* same mask */
        slopes(n, &s, rule, m, g, size, loss);
        step(n, &s, rule, numbers, g, f, factor->row, size);
        for (int64_t i = 0; i < 2 * size; i++, q += n->h2.outputs)
            memcpy(q, s.online.q + i * LANES, (size_t)n->h2.outputs * sizeof(float));
    }
}
