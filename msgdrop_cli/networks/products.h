/* Products of small matrices and Adam, for the updates in C (algorithms/dcc.c, maddpg.c).
 *
 * Every sum has one order, whatever else is computed: a network's bits are its own.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

enum { LANES = 16 };
typedef float Vec __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
typedef int32_t Mask __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
#define INLINE static inline __attribute__((always_inline))
#define AT(pointer) (*(Vec *)(pointer))
#define READ(pointer) (*(const Vec *)(pointer))

typedef struct { int64_t inputs, outputs, weight, bias; } Layer; /* offsets in a flat Stacked */
typedef struct { float *weights, *exp_avg, *exp_avg_sq, *target; } Numbers;
typedef struct { float step_size, root_scale, beta1, beta2, epsilon; } Adam;

/* Products of small matrices: c[i, n] = after(start[n] + sum_k a[i * ai + k * ak] b[k * bk + n]). */

typedef struct { const float *a; int64_t ai, ak; const float *b; int64_t bk, count; } Product;
typedef enum { PLAIN, RELU, THROUGH_RELU } After; /* the last: times (gate > 0) */

INLINE void tile(int rows, int vecs, const Product *p, const float *start, After after,
                 const float *gate, float *c, int64_t ci)
{
    Vec sum[8][3];
    for (int i = 0; i < rows; i++)
        for (int v = 0; v < vecs; v++) sum[i][v] = start ? READ(start + v * LANES) : (Vec){0};
    for (int64_t k = 0; k < p->count; k++) {
        const float *a = p->a + k * p->ak, *b = p->b + k * p->bk;
        for (int i = 0; i < rows; i++)
            for (int v = 0; v < vecs; v++) sum[i][v] += a[i * p->ai] * READ(b + v * LANES);
    }
    const Vec one = (Vec){0} + 1.0f;
    for (int i = 0; i < rows; i++)
        for (int v = 0; v < vecs; v++) {
            Vec x = sum[i][v]; /* NaN goes through both kinds of gate, as in torch */
            if (after == RELU) x = (Vec)((Mask)x & ~(x < 0.0f));
            if (after == THROUGH_RELU)
                x *= (Vec)((Mask)one & (READ(gate + i * ci + v * LANES) > 0.0f));
            AT(c + i * ci + v * LANES) = x;
        }
}

/* Outputs: a multiple of LANES, or at least three times LANES. What is left over at the end is one
 * vector that overlaps the one before it: the same numbers are written twice. */
static void product(Product p, int64_t rows, int64_t outputs, const float *start, After after,
                    const float *gate, float *c, int64_t ci)
{
    for (int64_t next = 0, vecs; next < outputs; next += vecs * LANES) {
        const int64_t left = (outputs - next + LANES - 1) / LANES;
        vecs = left == 4 ? 2 : left < 3 ? left : 3;
        const int64_t end = next + vecs * LANES, n = end > outputs ? next - end + outputs : next;
        for (int64_t i = 0, step; i < rows; i += step) {
            const Product q = {p.a + i * p.ai, p.ai, p.ak, p.b + n, p.bk, p.count};
            const float *s = start ? start + n : NULL, *g = gate ? gate + i * ci + n : NULL;
            float *to = c + i * ci + n;
            step = rows - i >= 8 ? 8 : rows - i >= 2 ? 2 : 1;
#define TILE(R, V) if (step == R && vecs == V) tile(R, V, &q, s, after, g, to, ci)
            TILE(8, 3); TILE(8, 2); TILE(8, 1);
            TILE(2, 3); TILE(2, 2); TILE(2, 1);
            TILE(1, 3); TILE(1, 2); TILE(1, 1);
#undef TILE
        }
    }
}

/* Adam. */

INLINE void adam_step(Adam r, float *weight, float *exp_avg, float *exp_avg_sq, Vec grad)
{
    const Vec m = AT(exp_avg) + (1.0f - r.beta1) * (grad - AT(exp_avg));
    const Vec v = r.beta2 * AT(exp_avg_sq) + (1.0f - r.beta2) * (grad * grad);
    AT(exp_avg) = m;
    AT(exp_avg_sq) = v;
    Vec root;
    for (int i = 0; i < LANES; i++) root[i] = sqrtf(v[i]);
    AT(weight) -= r.step_size * m / (r.root_scale * root + r.epsilon);
}

static void adam(Adam r, const Numbers *t, int64_t at, const float *grad, int64_t count)
{
    int64_t k = 0;
    for (; k + LANES <= count; k += LANES)
        adam_step(r, t->weights + at + k, t->exp_avg + at + k, t->exp_avg_sq + at + k,
                  READ(grad + k));
    const int64_t left = count - k;
    if (left == 0) return;
    float part[4][LANES] = {{0}};
    float *from[3] = {t->weights + at + k, t->exp_avg + at + k, t->exp_avg_sq + at + k};
    for (int i = 0; i < 3; i++) memcpy(part[i], from[i], (size_t)left * sizeof(float));
    memcpy(part[3], grad + k, (size_t)left * sizeof(float));
    adam_step(r, part[0], part[1], part[2], READ(part[3]));
    for (int i = 0; i < 3; i++) memcpy(from[i], part[i], (size_t)left * sizeof(float));
}
