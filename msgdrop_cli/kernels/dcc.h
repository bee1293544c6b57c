/* What dcc.c works on: shapes, memories, buffers, and the inputs.
 *
 * Letters: G networks, B samples, `rows` samples of a pass; `blocks`: the own observation of
 * `units` numbers, then messages of `message` numbers: others' observations, unless they lie
 * `apart`. What is not 0 in blocks of bytes is listed; the other blocks are multiplied out.
 */
#pragma once
#include "layers.h"
#include "nonzeros.h"

enum { AHEAD = 4, ASKED = 8 }; /* rows: within a list; of the next network, a layer */

typedef struct {
    int64_t networks, blocks, own_blocks, units, message, bytes, apart;
    Layer f1, f2, g1, h1, h2;
} Net;
typedef struct { /* memories of runs, of `agents` networks each; Drawn in protocol.py */
    const void *obs;
    const int32_t *next_row;
    const uint8_t *action;
    const float *reward, *discount;
    const int64_t *rows, *shown;              /* rows NULL: all of a run's observations in order */
    const float *messages;                    /* NULL: the observations */
    int64_t agents, obs_blocks, obs_rows, run_rows; /* blocks in a row of obs; rows of a run */
} Memory;
typedef struct { /* of the inputs, [G, rows, blocks, 1 or units], and the strides */
    const float *values;
    int64_t network, row, block, unit;
} Factors;
typedef struct { float gamma, huber; Adam adam; int64_t batch_size; } Rule;

typedef struct { Matrix x, f1, joint, h1, q; } Pass; /* [rows, units of the layer] each */
typedef struct {
    const Net *net;
    const Memory *memory;
    int64_t g;            /* the network */
    Factors mask, scale;  /* its own: of the first `masked` rows, of those after them */
    int64_t masked;
    Pass online, target;
    Matrix grad_q, grad_h1, grad_joint, grad_f1;
    float *padded, *gradient, *turned;
    int64_t *row;   /* [rows] of obs */
    int64_t *asked; /* how many of the next network's rows were asked for */
    int32_t *start; /* [rows, listed + 1]: a block's first entry of the list */
    List list;
} Work;

/* The inputs. */

/* The first blocks, as many as are listed. */
static int64_t listed(const Net *n) { return !n->bytes ? 0 : n->apart ? 1 : n->blocks; }

/* The numbers of all blocks before block j. */
static int64_t units_before(const Net *n, int64_t j)
{
    return j == 0 ? 0 : n->units + (j - 1) * n->message;
}

/* Where block j stands in a row of x, which begins after the listed ones. */
static int64_t place_in_x(const Net *n, int64_t j)
{
    return units_before(n, j) - units_before(n, listed(n));
}

static const void *block_at(const Work *w, int64_t b, int64_t j)
{
    const Memory *m = w->memory;
    const int64_t shown = m->shown[w->g % m->agents * w->net->blocks + j];
    const int64_t block = w->row[b] * m->obs_blocks + shown;
    if (w->net->apart && j > 0) return m->messages + block * w->net->message;
    const int64_t at = block * w->net->units;
    return (const char *)m->obs + at * (w->net->bytes ? 1 : (int64_t)sizeof(float));
}

/* The row of obs that sample b sees: the observations, then the next ones. */
static int64_t row_seen(const Work *w, int64_t b)
{
    const Memory *m = w->memory;
    const int64_t run = w->g / m->agents, size = w->masked;
    const int64_t row = m->rows[w->g * size + b % size];
    return run * m->obs_rows + (b < size ? row : m->next_row[run * m->run_rows + row]);
}

/* Asks for some numbers of the next network: they lie anywhere in memory, and all at once they
 * would wait for each other. */
static void ask_ahead(const Work *w)
{
    int64_t row;
    Work next = *w;
    next.g++, next.row = &row;
    if (w->net->bytes || next.g == w->net->networks) return;
    for (int i = 0; i < ASKED && *w->asked < 2 * w->masked; i++) {
        row = row_seen(&next, (*w->asked)++);
        for (int64_t j = 0; j < w->net->blocks; j++) {
            const float *later = block_at(&next, 0, j);
            const int64_t units = j == 0 ? w->net->units : w->net->message;
            for (int64_t k = 0; k < units; k += LANES) __builtin_prefetch(later + k, 0, 2);
        }
    }
}

static void list_inputs(const Work *w, int64_t rows)
{
    const Net *n = w->net;
    const int64_t blocks = listed(n);
    int64_t found = 0;
    int32_t *start = w->start;
    for (int64_t b = 0; b < rows; b++) {
        for (int64_t j = 0; j < blocks; j++) {
            *start++ = (int32_t)found;
            if (b + AHEAD < rows) { /* rows lie anywhere in memory: ask for them early */
                const char *later = block_at(w, b + AHEAD, j);
                for (int64_t k = 0; k < n->units; k += 64) __builtin_prefetch(later + k);
            }
            found = list_bytes(block_at(w, b, j), n->units, w->list, found);
        }
        *start++ = (int32_t)found;
    }
}

/* Those of network g, from row `first` on. */
static Factors own_factors(const Factors *f, int64_t g, int64_t first)
{
    Factors own = *f;
    own.values += g * f->network + first * f->row;
    return own;
}

static Factor factor_of(const Work *w, int64_t b, int64_t j)
{
    const Factors *f = b < w->masked ? &w->mask : &w->scale;
    const int64_t row = b < w->masked ? b : b - w->masked;
    return (Factor){f->values + row * f->row + j * f->block, f->unit};
}

/* x [rows, units of the blocks that are not listed] = those of rows `first` on times the factors
 * from row 0 on */
static void multiply_inputs(const Work *w, int64_t first, int64_t rows, float *x)
{
    const Net *n = w->net;
    for (int64_t b = 0; b < rows; b++)
        for (int64_t j = listed(n); j < n->blocks; j++) {
            const float *from = block_at(w, first + b, j);
            const Factor f = factor_of(w, b, j);
            const int64_t units = j == 0 ? n->units : n->message;
            if (f.step == 0)
                for (int64_t k = 0; k < units; k++) *x++ = from[k] * f.of[0];
            else
                for (int64_t k = 0; k < units; k++) *x++ = from[k] * f.of[k];
        }
}

/* The entries of row b's block j that are not dropped; f: its factors. */
static Row entries(const Work *w, int64_t b, int64_t j, Factor f)
{
    const int32_t *start = w->start + b * (listed(w->net) + 1) + j;
    if (f.step == 0 && f.of[0] == 0.0f) return (Row){0}; /* a dropped message */
    return row_of(w->list, start[0], start[1]);
}

/* The buffers. */

static Matrix taken(Arena *a, int64_t rows, int64_t units)
{
    return (Matrix){floats(a, rows * units), units};
}

/* Puts the buffers for `rows` rows into `memory`; returns the bytes that they take. */
static int64_t lay_out(const Net *n, int64_t rows, char *memory, Work *w)
{
    const int64_t inputs = place_in_x(n, n->blocks), blocks = listed(n);
    const int64_t entries = blocks ? rows * blocks * n->units + SPARE : 0;
    const int64_t f1 = n->f1.outputs, joint = n->h1.inputs, h = n->h1.outputs;
    Arena a = {memory, 0};
    int64_t most = LANES * h;
    const Layer *layers[4] = {&n->f1, &n->f2, &n->g1, &n->h1}; /* of bytes: a block at a time */
    for (int i = 0; i < 4; i++) {
        const int64_t sees_list = i == 0 ? blocks > 0 : i == 2 && blocks > 1;
        const int64_t seen = sees_list ? n->units : layers[i]->inputs;
        if (seen * layers[i]->outputs > most) most = seen * layers[i]->outputs;
    }
    Pass *passes[2] = {&w->online, &w->target};
    for (int i = 0; i < 2; i++) {
        passes[i]->x = taken(&a, rows, inputs);
        passes[i]->f1 = taken(&a, rows, f1);
        passes[i]->joint = taken(&a, rows, joint);
        passes[i]->h1 = taken(&a, rows, h);
        passes[i]->q = taken(&a, rows, LANES);
    }
    w->padded = floats(&a, (h + 1) * LANES);
    w->grad_q = taken(&a, rows, LANES);
    w->grad_h1 = taken(&a, rows, h);
    w->grad_joint = taken(&a, rows, joint);
    w->grad_f1 = taken(&a, rows, f1);
    w->gradient = floats(&a, most);
    w->turned = floats(&a, most);
    w->row = take(&a, rows * (int64_t)sizeof(int64_t));
    w->start = take(&a, rows * (blocks + 1) * (int64_t)sizeof(int32_t));
    w->list.unit = take(&a, entries * (int64_t)sizeof(uint16_t));
    w->list.value = floats(&a, entries);
    return a.taken;
}
