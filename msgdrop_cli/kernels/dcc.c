/* One update of algorithms/dcc.py, and Q_exec: agent after agent, while its numbers are near.
 *
 * The rule is that of DCC, which is its oracle (tests/test_kernel_dcc.py): two online passes, one of
 * the target, label eq:5's target, the loss, backward, Adam. Q = h(f, g) serves all three
 * networks: FDC's and Concat's perceptron is f and h, and its g sees no block. Widths are multiples
 * of LANES.
 *
 * A first layer over listed blocks goes block by block, so that a block's weights stay in the nearest
 * caches; their gradient is made and used up block by block, too.
 */
#include "dcc.h"

/* Forward. */

/* out [rows, outputs] of f1 or g1, which see the blocks j0 to j1; listed rows from `first` on. */
static void forward_first(const Work *w, Dense d, int64_t j0, int64_t j1, int64_t first,
                          int64_t rows, Matrix x, Matrix out)
{
    if (j0 >= listed(w->net)) {
        forward_dense(d, (Matrix){x.at + place_in_x(w->net, j0), x.row}, rows, RELU, out);
        return;
    }
    for (int64_t b = 0; b < rows; b++)
        memcpy(out.at + b * out.row, d.bias, (size_t)d.outputs * sizeof(float));
    for (int64_t j = j0; j < j1; j++) {
        const Matrix weight = {d.weight + (j - j0) * w->net->units * d.outputs, d.outputs};
        for (int64_t b = 0; b < rows; b++) {
            const Factor f = factor_of(w, b, j);
            const Row x = entries(w, first + b, j, f);
            float *sum = out.at + b * out.row;
            if (x.count) add_rows(x, f, weight, d.outputs, (Ending){sum, PLAIN, NULL}, sum);
        }
    }
    for (int64_t b = 0; b < rows; b++)
        for (int64_t h = 0; h < d.outputs; h += WIDTH) {
            float *sum = out.at + b * out.row + h;
            AT(sum) = relu(READ(sum));
        }
}

/* Q of `rows` rows, from listed row `first` on, into pass->q [rows, LANES]. */
static void forward(const Work *w, float *flat, int64_t first, int64_t rows, const Pass *pass)
{
    const Net *n = w->net;
    const Matrix g = {pass->joint.at + n->f2.outputs, pass->joint.row};
    forward_first(w, dense_of(&n->f1, flat, w->g), 0, n->own_blocks, first, rows, pass->x,
                  pass->f1);
    forward_dense(dense_of(&n->f2, flat, w->g), pass->f1, rows, RELU, pass->joint);
    if (n->g1.outputs)
        forward_first(w, dense_of(&n->g1, flat, w->g), n->own_blocks, n->blocks, first, rows,
                      pass->x, g);
    forward_dense(dense_of(&n->h1, flat, w->g), pass->joint, rows, RELU, pass->h1);
    const Dense last = widened(dense_of(&n->h2, flat, w->g), w->padded);
    forward_dense(last, pass->h1, rows, PLAIN, pass->q);
}

/* The loss and its derivative by Q. */

/* grad_q [B, LANES], loss [B]: label eq:5. */
static void loss_gradient(const Work *w, const Rule *r, float *loss)
{
    const Memory *m = w->memory;
    const int64_t size = r->batch_size;
    memset(w->grad_q.at, 0, (size_t)(size * LANES) * sizeof(float));
    for (int64_t b = 0; b < size; b++) {
        const float *q = w->online.q.at + b * LANES, *select = q + size * LANES;
        const float *next_q = w->target.q.at + b * LANES;
        const int64_t row = w->g / m->agents * m->run_rows + m->rows[w->g * size + b];
        const int64_t own = row * m->agents + w->g % m->agents, action = m->action[own];
        int64_t best = 0;
        for (int64_t a = 1; a < w->net->h2.outputs; a++) /* the first of the largest; NaN is it */
            if (!(select[a] <= select[best]) && select[best] == select[best]) best = a;
        const float target = m->reward[own] + r->gamma * m->discount[row] * next_q[best];
        const float error = q[action] - target;
        const float near = error > 1.0f ? 1.0f : error < -1.0f ? -1.0f : error;
        const float slope = r->huber ? near : 2.0f * error;
        loss[b] = r->huber ? near * (error - 0.5f * near) : error * error;
        w->grad_q.at[b * LANES + action] = slope / (float)size;
    }
}

/* Backward, and Adam layer by layer. */

static void step(const Work *w, const Rule *r, const Parameters *p, int64_t at, int64_t count)
{
    ask_ahead(w);
    adam_each(r->adam, p, at, w->gradient, count, 1.0f, 0.0f);
}

static void step_dense(const Work *w, const Rule *r, const Parameters *p, const Layer *l, Matrix in,
                       Matrix grad_out)
{
    const int64_t outputs = l->outputs < LANES ? LANES : l->outputs; /* grad_q has LANES */
    weight_gradient(in, l->inputs, grad_out, outputs, r->batch_size, w->gradient);
    if (outputs != l->outputs) narrowed(w->gradient, l->inputs, l->outputs);
    const int64_t count = l->inputs * l->outputs;
    step(w, r, p, l->weight + w->g * count, count);
}

/* f1 or g1, which see the blocks j0 to j1. */
static void step_first(const Work *w, const Rule *r, const Parameters *p, const Layer *l,
                       int64_t j0, int64_t j1, Matrix grad_out)
{
    if (j0 >= listed(w->net)) {
        const Matrix x = w->online.x;
        step_dense(w, r, p, l, (Matrix){x.at + place_in_x(w->net, j0), x.row}, grad_out);
        return;
    }
    const int64_t block = w->net->units * l->outputs;
    int64_t at = l->weight + w->g * l->inputs * l->outputs;
    for (int64_t j = j0; j < j1; j++, at += block) {
        memset(w->gradient, 0, (size_t)block * sizeof(float));
        for (int64_t b = 0; b < r->batch_size; b++) {
            const Factor f = factor_of(w, b, j);
            const Row x = entries(w, b, j, f);
            const float *grad = grad_out.at + b * grad_out.row;
            if (x.count) spread_rows(x, f, grad, l->outputs, (Matrix){w->gradient, l->outputs});
        }
        step(w, r, p, at, block);
    }
}

static void step_bias(const Work *w, const Rule *r, const Parameters *p, const Layer *l,
                      Matrix grad_out)
{
    for (int64_t h = 0; h < l->outputs; h += WIDTH) {
        Vec sum = {0};
        for (int64_t b = 0; b < r->batch_size; b++) sum += READ(grad_out.at + b * grad_out.row + h);
        AT(w->gradient + h) = sum;
    }
    step(w, r, p, l->bias + w->g * l->outputs, l->outputs);
}

static void backward(const Work *w, const Rule *r, const Parameters *p)
{
    const Net *n = w->net;
    const Pass *o = &w->online;
    const int64_t size = r->batch_size;
    const Matrix grad_g = {w->grad_joint.at + n->f2.outputs, w->grad_joint.row};
    const Dense f2 = dense_of(&n->f2, p->weights, w->g), h1 = dense_of(&n->h1, p->weights, w->g);
    const Dense h2 = dense_of(&n->h2, p->weights, w->g);
    backward_dense(h2, w->grad_q, size, o->h1.at, w->grad_h1, w->turned);
    backward_dense(h1, w->grad_h1, size, o->joint.at, w->grad_joint, w->turned);
    backward_dense(f2, w->grad_joint, size, o->f1.at, w->grad_f1, w->turned);
    step_first(w, r, p, &n->f1, 0, n->own_blocks, w->grad_f1);
    if (n->g1.outputs) step_first(w, r, p, &n->g1, n->own_blocks, n->blocks, grad_g);
    step_dense(w, r, p, &n->f2, o->f1, w->grad_joint);
    step_dense(w, r, p, &n->h1, o->joint, w->grad_h1);
    step_dense(w, r, p, &n->h2, o->h1, w->grad_q);
    step_bias(w, r, p, &n->f1, w->grad_f1);
    step_bias(w, r, p, &n->f2, w->grad_joint);
    if (n->g1.outputs) step_bias(w, r, p, &n->g1, grad_g);
    step_bias(w, r, p, &n->h1, w->grad_h1);
    step_bias(w, r, p, &n->h2, w->grad_q);
}

/* What Python calls. */

int64_t dcc_scratch_bytes(const Net *n, int64_t rows)
{
    Work w;
    return lay_out(n, rows, NULL, &w);
}

/* q [G, rows, actions] of all networks, `chunk` rows at a time. */
void dcc_q_values(const Net *n, const Parameters *p, const Memory *m, const Factors *scale,
                  int64_t rows, int64_t chunk, char *scratch, float *q)
{
    Work w = {.net = n, .memory = m};
    lay_out(n, chunk, scratch, &w);
    for (w.g = 0; w.g < n->networks; w.g++)
        for (int64_t first = 0; first < rows; first += chunk) {
            const int64_t count = rows - first < chunk ? rows - first : chunk;
            w.scale = own_factors(scale, w.g, first);
            for (int64_t b = 0; b < count; b++) w.row[b] = w.g / m->agents * rows + first + b;
            list_inputs(&w, count);
            multiply_inputs(&w, 0, count, w.online.x.at);
            forward(&w, p->weights, 0, count, &w.online);
            for (int64_t i = 0; i < count; i++, q += n->h2.outputs)
                memcpy(q, w.online.q.at + i * LANES, (size_t)n->h2.outputs * sizeof(float));
        }
}

/* One update of every network; loss [G, B], q [G, 2B, actions] of the online networks before it.
 *
 * factors: three, of (o, m), of (o', m') for the target, and of (o', m') for Q_exec. */
void dcc_update(const Net *n, const Parameters *p, const Memory *m, const Factors *factors,
                const Rule *r, char *scratch, const Outcome *outcome)
{
    const int64_t size = r->batch_size;
    int64_t asked;
    Work w = {.net = n, .memory = m, .masked = size, .asked = &asked};
    float *q = outcome->q;
    lay_out(n, 2 * size, scratch, &w);
    for (w.g = 0; w.g < n->networks; w.g++) {
        asked = 0;
        w.mask = own_factors(&factors[1], w.g, 0);
        w.scale = own_factors(&factors[2], w.g, 0);
        for (int64_t b = 0; b < 2 * size; b++) w.row[b] = row_seen(&w, b);
        list_inputs(&w, 2 * size);
        multiply_inputs(&w, size, size, w.target.x.at);
        forward(&w, p->target, size, size, &w.target);
        w.mask = own_factors(&factors[0], w.g, 0);
        multiply_inputs(&w, 0, 2 * size, w.online.x.at);
        forward(&w, p->weights, 0, 2 * size, &w.online);
        loss_gradient(&w, r, outcome->loss + w.g * size);
        backward(&w, r, p);
        for (int64_t i = 0; i < 2 * size; i++, q += n->h2.outputs)
            memcpy(q, w.online.q.at + i * LANES, (size_t)n->h2.outputs * sizeof(float));
    }
}

const Field dcc_fields[] = {
    SHARED_FIELDS,
    STRUCT(Net), FIELD(Net, networks), FIELD(Net, blocks), FIELD(Net, own_blocks),
    FIELD(Net, units), FIELD(Net, message), FIELD(Net, bytes), FIELD(Net, apart),
    FIELD(Net, f1), FIELD(Net, f2), FIELD(Net, g1), FIELD(Net, h1), FIELD(Net, h2),
    STRUCT(Memory), FIELD(Memory, obs), FIELD(Memory, next_row), FIELD(Memory, action),
    FIELD(Memory, reward), FIELD(Memory, discount), FIELD(Memory, rows), FIELD(Memory, shown),
    FIELD(Memory, messages), FIELD(Memory, agents), FIELD(Memory, obs_blocks), FIELD(Memory, obs_rows),
    FIELD(Memory, run_rows),
    STRUCT(Factors), FIELD(Factors, values), FIELD(Factors, network), FIELD(Factors, row),
    FIELD(Factors, block), FIELD(Factors, unit),
    STRUCT(Rule), FIELD(Rule, gamma), FIELD(Rule, huber), FIELD(Rule, adam),
    FIELD(Rule, batch_size), {NULL, 0, 0}};
