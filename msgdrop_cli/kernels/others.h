/* What a layer of maddpg.c sees of the others: their observations, if kept, and their actions.
 *
 * Slot k of agent i holds agent k, or agent k + 1 from i = k on. So the products of a slot with
 * these two serve all agents.
 */
#pragma once
#include "maddpg.h"

/* The agents in whose slot k agent j stands: from `first` to `end` - 1. */
typedef struct { int64_t first, end; } Listeners;

static Listeners listeners(const Net *n, int64_t k, int64_t j)
{
    return j == k ? (Listeners){k + 1, n->agents} : (Listeners){0, k + 1};
}

/* out [rows, width] += the others of observations t on, which act so, times weight
 * [S * O + S * A, width] */
static void add_others(const Work *w, const float *weight, int64_t width, int64_t t,
                       const float *action, Matrix out)
{
    const Net *n = w->net;
    const float *acted = weight + n->senders * n->observation * width;
    float *unseen = w->part, *seen = w->part + width;
    for (int64_t k = 0; k < n->senders; k++) {
        const Matrix slot = {(float *)weight + k * n->observation * width, width};
        const Matrix action_slot = {(float *)acted + k * n->action * width, width};
        for (int64_t row = 0; row < 2 * w->batch; row++) {
            const int64_t b = row / 2, j = k + row % 2, at = b * n->agents + j;
            add_rows(action_of(w, action, at), ONE, action_slot, width, (Ending){0}, unseen);
            add_rows(observation_of(w, t + at), ONE, slot, width, (Ending){.start = unseen}, seen);
            const Listeners who = listeners(n, k, j);
            for (int64_t i = who.first; i < who.end; i++) {
                float *sum = out.at + (b * n->agents + i) * out.row;
                if (w->keep[(i * w->batch + b) * n->senders + k] != 0.0f) add(width, seen, sum);
                else if (!n->masks_actions) add(width, unseen, sum);
            }
        }
    }
}

/* The gradient of that, of replayed actions: gradient [S * O + S * A, width] += ...; grad [rows,
 * width] */
static void spread_others(const Work *w, Matrix grad, int64_t width, float *gradient)
{
    const Net *n = w->net;
    float *acted = gradient + n->senders * n->observation * width;
    float *all = w->part, *kept = w->part + width;
    for (int64_t k = 0; k < n->senders; k++) {
        const Matrix slot = {gradient + k * n->observation * width, width};
        const Matrix action_slot = {acted + k * n->action * width, width};
        for (int64_t row = 0; row < 2 * w->batch; row++) {
            const int64_t b = row / 2, j = k + row % 2, at = b * n->agents + j;
            memset(w->part, 0, (size_t)(2 * width) * sizeof(float));
            const Listeners who = listeners(n, k, j);
            for (int64_t i = who.first; i < who.end; i++) {
                const float *each = grad.at + (b * n->agents + i) * grad.row;
                const int passes = w->keep[(i * w->batch + b) * n->senders + k] != 0.0f;
                add(width, each, passes ? kept : all);
            }
            spread_rows(observation_of(w, at), ONE, kept, width, slot);
            add(width, kept, all);
            spread_rows(action_of(w, w->action, at), ONE, n->masks_actions ? kept : all, width,
                        action_slot);
        }
    }
}

/* x [rows, width] = relu(x); NaN stays */
static void relu_rows(Matrix x, int64_t rows, int64_t width)
{
    for (int64_t row = 0; row < rows; row++)
        for (int64_t h = 0; h < width; h++) {
            float *number = x.at + row * x.row + h;
            *number = *number < 0.0f ? 0.0f : *number;
        }
}
