/* One update of algorithms/maddpg.py for networks that all agents of a run share, and its actions.
 *
 * The rule is that of MADDPG, which is its oracle (tests/test_kernel_maddpg.py): the target
 * (l. 273), the critic's loss, its step, and every second time the policy gradient (l. 277) through
 * the critic as it is by then. A gradient is clipped as a whole, so it is stored, and each step is
 * followed by the target's.
 */
#include "others.h"

/* Forward: actor and critic; observations t on. */

/* action [rows, A] = tanh of the actor's numbers */
static void act(const Work *w, float *flat, int64_t t, float *action)
{
    const Dense a1 = dense_of(&w->net->a1, flat, w->r), a2 = dense_of(&w->net->a2, flat, w->r);
    const Matrix weight = {a1.weight, a1.outputs};
    for (int64_t row = 0; row < w->rows; row++)
        add_rows(observation_of(w, t + row), ONE, weight, a1.outputs,
                 (Ending){.start = a1.bias, .after = RELU}, w->hidden.at + row * w->hidden.row);
    forward_dense(widened(a2, w->padded), w->hidden, w->rows, PLAIN, w->numbers);
    for (int64_t row = 0; row < w->rows; row++)
        for (int64_t a = 0; a < w->net->action; a++)
            *action++ = tanhf(w->numbers.at[row * LANES + a]);
}

/* f1 [rows, units] of (o, own a); vanilla MADDPG's sees the others, too, and what they do. */
static void forward_f1(const Work *w, float *flat, int64_t t, const float *action,
                       const float *own, Matrix out)
{
    const Net *n = w->net;
    const Dense f1 = dense_of(&n->f1, flat, w->r);
    const int sees_others = n->senders && !n->g1.outputs;
    const Ending ending = {.start = f1.bias, .after = sees_others ? PLAIN : RELU};
    list_own_actions(w, t, own);
    for (int64_t row = 0; row < w->rows; row++) {
        float *sum = out.at + row * out.row;
        add_rows(with_own_action(w, t + row), ONE, (Matrix){f1.weight, f1.outputs}, f1.outputs,
                 ending, sum);
        if (out.row > f1.outputs) /* the action enters f again (l. 770) */
            memcpy(sum + f1.outputs, own + row * n->action, (size_t)n->action * sizeof(float));
    }
    if (!sees_others) return;
    const float *weight = f1.weight + (n->observation + n->action) * f1.outputs;
    add_others(w, weight, f1.outputs, t, action, out);
    relu_rows(out, w->rows, f1.outputs);
}

/* Q of own actions and of what the others do, both [rows, A], into pass->q [rows, LANES]. */
static void judge(const Work *w, float *flat, int64_t t, const float *action, const float *own,
                  const Pass *pass)
{
    const Net *n = w->net;
    forward_f1(w, flat, t, action, own, pass->f1);
    forward_dense(dense_of(&n->f2, flat, w->r), pass->f1, w->rows, RELU, pass->joint);
    if (n->g1.outputs) {
        const Dense g1 = dense_of(&n->g1, flat, w->r);
        const Matrix out = {pass->joint.at + n->f2.outputs, pass->joint.row};
        for (int64_t row = 0; row < w->rows; row++)
            memcpy(out.at + row * out.row, g1.bias, (size_t)g1.outputs * sizeof(float));
        add_others(w, g1.weight, g1.outputs, t, action, out);
        relu_rows(out, w->rows, g1.outputs);
    }
    forward_dense(dense_of(&n->h1, flat, w->r), pass->joint, w->rows, RELU, pass->h1);
    forward_dense(widened(dense_of(&n->h2, flat, w->r), w->padded), pass->h1, w->rows, PLAIN,
                  pass->q);
}

/* Backward. */

/* Follows grad_last through h and f; of the joint features as many as are asked for. */
static void backward_critic(const Work *w, float *flat, int64_t features)
{
    const Net *n = w->net;
    const Pass *o = &w->online;
    const Dense h2 = dense_of(&n->h2, flat, w->r);
    Dense h1 = dense_of(&n->h1, flat, w->r), f2 = dense_of(&n->f2, flat, w->r);
    h1.inputs = features;
    f2.inputs = n->f1.outputs; /* not down to the action */
    backward_dense(h2, w->grad_last, w->rows, o->h1.at, w->grad_h1, w->turned);
    backward_dense(h1, w->grad_h1, w->rows, o->joint.at, w->grad_joint, w->turned);
    backward_dense(f2, w->grad_joint, w->rows, o->f1.at, w->grad_f1, w->turned);
}

static void bias_gradient(const Work *w, const Layer *l, Matrix grad, float *bias)
{
    for (int64_t row = 0; row < w->rows; row++) add(l->outputs, grad.at + row * grad.row, bias);
}

static void gradients(const Work *w, const Layer *l, Matrix in, Matrix grad, Gradient to)
{
    weight_gradient(in, l->inputs, grad, l->outputs, w->rows, to.weight);
    bias_gradient(w, l, grad, to.bias);
}

/* A last layer has few outputs; grad [rows, LANES]. */
static void last_gradients(const Work *w, const Layer *l, Matrix in, Matrix grad, Gradient to)
{
    weight_gradient(in, l->inputs, grad, LANES, w->rows, w->padded);
    narrowed(w->padded, l->inputs, l->outputs);
    memcpy(to.weight, w->padded, (size_t)(l->inputs * l->outputs) * sizeof(float));
    bias_gradient(w, l, grad, to.bias);
}

/* The factor that brings a gradient to at most `limit`; 0 does not clip, NaN goes through. */
static float clip(const float *grad, const float *end, float limit)
{
    enum { SUMS = 4 * LANES / WIDTH };
    Vec sums[SUMS] = {{0}};
    for (int64_t k = 0; grad < end; grad += WIDTH, k++)
        sums[k % SUMS] = fused_square(READ(grad), sums[k % SUMS]);
    const float *s = (const float *)sums;
    float total = 0.0f;
    for (int i = 0; i < LANES; i++)
        total += (s[i] + s[i + LANES]) + (s[i + 2 * LANES] + s[i + 3 * LANES]);
    const float norm = sqrtf(total), factor = limit / (norm < 1e-12f ? 1e-12f : norm);
    return limit > 0.0f ? factor > 1.0f ? 1.0f : factor : 1.0f;
}

typedef struct { const Layer *layer; const Gradient *gradient; } Learnt;

/* Adam and the targets of layers whose gradients lie between the first one's and `end`. */
static void step(const Work *w, const Rule *rule, const Adam *adam, const Parameters *p,
                 const Learnt *learnt, int layers, const float *end)
{
    const float factor = clip(learnt[0].gradient->weight, end, rule->max_norm);
    for (int i = 0; i < layers; i++) {
        const Layer *l = learnt[i].layer;
        const int64_t outputs = l->outputs, count = l->inputs * outputs;
        const Gradient *g = learnt[i].gradient;
        adam_each(*adam, p, l->weight + w->r * count, g->weight, count, factor, rule->tau);
        adam_each(*adam, p, l->bias + w->r * outputs, g->bias, outputs, factor, rule->tau);
    }
}

/* The updates. */

/* The critic's squared error and its derivative by Q (l. 273); loss, q [rows]. */
static void critic_loss(const Work *w, const Rule *rule, float *loss, float *q)
{
    memset(w->grad_last.at, 0, (size_t)(w->rows * LANES) * sizeof(float));
    for (int64_t row = 0; row < w->rows; row++) {
        const float now = w->online.q.at[row * LANES], after = w->target.q.at[row * LANES];
        const float discount = w->discount[row / w->net->agents];
        const float error = now - (w->reward[row] + rule->gamma * discount * after);
        q[row] = now;
        loss[row] = error * error;
        w->grad_last.at[row * LANES] = 2.0f * error / (float)w->rows;
    }
}

/* The critic's step, on the replayed actions. */
static void improve_critic(const Work *w, const Rule *rule, const Parameters *critic)
{
    const Net *n = w->net;
    const Matrix grad_g = {w->grad_joint.at + n->f2.outputs, w->grad_joint.row};
    const int64_t first = n->f1.outputs;
    backward_critic(w, critic->weights, n->h1.inputs);
    memset(w->f1.weight, 0, (size_t)(w->end - w->f1.weight) * sizeof(float));
    for (int64_t row = 0; row < w->rows; row++)
        spread_rows(with_own_action(w, row), ONE, w->grad_f1.at + row * w->grad_f1.row, first,
                    (Matrix){w->f1.weight, first});
    bias_gradient(w, &n->f1, w->grad_f1, w->f1.bias);
    gradients(w, &n->f2, w->online.f1, w->grad_joint, w->f2);
    if (n->g1.outputs) {
        spread_others(w, grad_g, n->g1.outputs, w->g1.weight);
        bias_gradient(w, &n->g1, grad_g, w->g1.bias);
    } else if (n->senders) {
        spread_others(w, w->grad_f1, first, w->f1.weight + (n->observation + n->action) * first);
    }
    gradients(w, &n->h1, w->online.joint, w->grad_h1, w->h1);
    last_gradients(w, &n->h2, w->online.h1, w->grad_last, w->h2);
    const Learnt learnt[5] = {{&n->f1, &w->f1}, {&n->f2, &w->f2}, {&n->h1, &w->h1},
                              {&n->h2, &w->h2}, {&n->g1, &w->g1}};
    step(w, rule, &rule->critic, critic, learnt, n->g1.outputs ? 5 : 4, w->end);
}

/* grad_own [rows, LANES]: the gradient of -Q by the own action, wherever it enters. */
static void action_gradient(const Work *w, float *flat)
{
    const Net *n = w->net;
    const Dense f1 = dense_of(&n->f1, flat, w->r), f2 = dense_of(&n->f2, flat, w->r);
    const float *early = f1.weight + n->observation * f1.outputs;
    const float *late = f2.weight + f1.outputs * f2.outputs;
    const int enters_twice = f2.inputs > f1.outputs;
    float *turned = w->padded;
    memset(turned, 0, (size_t)((f1.outputs + f2.outputs) * LANES) * sizeof(float));
    for (int64_t a = 0; a < n->action; a++) {
        for (int64_t k = 0; k < f1.outputs; k++)
            turned[k * LANES + a] = early[a * f1.outputs + k];
        for (int64_t k = 0; enters_twice && k < f2.outputs; k++)
            turned[(f1.outputs + k) * LANES + a] = late[a * f2.outputs + k];
    }
    const Product at_f1 = {w->grad_f1.at, w->grad_f1.row, 1, {turned, LANES}, f1.outputs};
    product(at_f1, w->rows, LANES, (Ending){0}, w->grad_own);
    if (!enters_twice) return;
    const Matrix second = {turned + f1.outputs * LANES, LANES};
    const Product at_f2 = {w->grad_joint.at, w->grad_joint.row, 1, second, f2.outputs};
    product(at_f2, w->rows, LANES, (Ending){0}, w->grad_last);
    add(w->rows * LANES, w->grad_last.at, w->grad_own.at);
}

/* The policy gradient (l. 277): own action from the actor, the rest as replayed. */
static void improve_actor(const Work *w, const Rule *rule, const Parameters *actor, float *critic)
{
    const Net *n = w->net;
    const Dense a2 = dense_of(&n->a2, actor->weights, w->r);
    act(w, actor->weights, 0, w->own);
    judge(w, critic, 0, w->action, w->own, &w->online);
    memset(w->grad_last.at, 0, (size_t)(w->rows * LANES) * sizeof(float));
    for (int64_t row = 0; row < w->rows; row++)
        w->grad_last.at[row * LANES] = -1.0f / (float)w->rows;
    backward_critic(w, critic, n->f2.outputs);
    action_gradient(w, critic);
    for (int64_t row = 0; row < w->rows; row++)
        for (int64_t a = 0; a < n->action; a++) {
            const float action = w->own[row * n->action + a];
            w->grad_own.at[row * LANES + a] *= 1.0f - action * action;
        }
    memset(w->a1.weight, 0, (size_t)(w->f1.weight - w->a1.weight) * sizeof(float));
    backward_dense(a2, w->grad_own, w->rows, w->hidden.at, w->grad_hidden, w->turned);
    for (int64_t row = 0; row < w->rows; row++)
        spread_rows(observation_of(w, row), ONE, w->grad_hidden.at + row * w->grad_hidden.row,
                    n->a1.outputs, (Matrix){w->a1.weight, n->a1.outputs});
    bias_gradient(w, &n->a1, w->grad_hidden, w->a1.bias);
    last_gradients(w, &n->a2, w->hidden, w->grad_own, w->a2);
    const Learnt learnt[2] = {{&n->a1, &w->a1}, {&n->a2, &w->a2}};
    step(w, rule, &rule->actor, actor, learnt, 2, w->f1.weight);
}

/* What Python calls. */

int64_t maddpg_scratch_bytes(const Net *n, int64_t batch)
{
    Work w;
    return lay_out(n, batch, NULL, &w);
}

/* One update of every run; keep [R, N, B, S], loss and q [R, B, N]. */
void maddpg_update(const Net *n, const Parameters *actor, const Parameters *critic,
                   const Memory *memory, const float *keep, const Rule *rule, char *scratch,
                   const Outcome *outcome)
{
    Work w;
    lay_out(n, rule->batch_size, scratch, &w);
    for (w.r = 0; w.r < n->runs; w.r++) {
        const int64_t at = w.r * w.rows;
        w.keep = keep + at * n->senders;
        take_batch(&w, memory);
        act(&w, actor->target, w.rows, w.own);
        judge(&w, critic->target, w.rows, w.own, w.own, &w.target);
        judge(&w, critic->weights, 0, w.action, w.action, &w.online);
        critic_loss(&w, rule, outcome->loss + at, outcome->q + at);
        improve_critic(&w, rule, critic);
        if (rule->improves_actor) improve_actor(&w, rule, actor, critic->weights);
    }
}

/* The actions [R, games, N, A] of the actors for observations in order, `batch` games at a time. */
void maddpg_actions(const Net *n, const Parameters *actor, const float *obs, int64_t games,
                    int64_t batch, char *scratch, float *action)
{
    Work w;
    lay_out(n, batch, scratch, &w);
    for (w.r = 0; w.r < n->runs; w.r++)
        for (int64_t b = 0; b < games; b += batch) {
            const int64_t count = games - b < batch ? games - b : batch;
            w.rows = count * n->agents;
            list_inputs(&w, obs, NULL, count);
            act(&w, actor->weights, 0, action);
            obs += w.rows * n->observation, action += w.rows * n->action;
        }
}

const Field maddpg_fields[] = {
    SHARED_FIELDS,
    STRUCT(Net), FIELD(Net, runs), FIELD(Net, agents), FIELD(Net, observation),
    FIELD(Net, action), FIELD(Net, senders), FIELD(Net, masks_actions), FIELD(Net, a1),
    FIELD(Net, a2), FIELD(Net, f1), FIELD(Net, f2), FIELD(Net, g1), FIELD(Net, h1),
    FIELD(Net, h2),
    STRUCT(Memory), FIELD(Memory, obs), FIELD(Memory, next_row), FIELD(Memory, action),
    FIELD(Memory, reward), FIELD(Memory, discount), FIELD(Memory, rows),
    FIELD(Memory, obs_rows), FIELD(Memory, run_rows),
    STRUCT(Rule), FIELD(Rule, gamma), FIELD(Rule, tau), FIELD(Rule, max_norm),
    FIELD(Rule, critic), FIELD(Rule, actor), FIELD(Rule, batch_size),
    FIELD(Rule, improves_actor), {NULL, 0, 0}};
