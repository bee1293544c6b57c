/* Vectors, and products of small matrices, which all of the layers are made of.
 *
 * Every sum has one order, whatever else is computed: a network's bits are its own. They are the
 * same on every processor, too, since a sum's order does not depend on how wide its vectors are,
 * and since it is said where a product and a sum are rounded once.
 */
#pragma once
#include <math.h>
#include <stdint.h>
#include <string.h>

enum { LANES = 16 }; /* widths are padded to a multiple of it */
#if defined(__AVX512F__)
enum { WIDTH = 16, TILE_ROWS = 8 }; /* numbers in a register; rows of a tile that they can hold */
#elif defined(__AVX__)
enum { WIDTH = 8, TILE_ROWS = 4 };
#else
enum { WIDTH = 4, TILE_ROWS = 4 };
#endif
typedef float Vec __attribute__((vector_size(4 * WIDTH), aligned(4), may_alias));
typedef int32_t Mask __attribute__((vector_size(4 * WIDTH), aligned(4), may_alias));
#define UNROLLED _Pragma("GCC unroll 16") /* or what is summed would lie in memory */
#define INLINE static inline __attribute__((always_inline))
#define AT(pointer) (*(Vec *)(pointer))
#define READ(pointer) (*(const Vec *)(pointer))

typedef struct { float *at; int64_t row; } Matrix; /* number [i, k] is at[i * row + k] */
typedef enum { PLAIN, RELU, THROUGH_RELU } After;  /* the last: times (gate > 0) */

/* a * b + c, rounded once: an instruction, or as exact and slow where the processor has none. */
INLINE Vec fused(float a, Vec b, Vec c)
{
    UNROLLED for (int i = 0; i < WIDTH; i++) c[i] = __builtin_fmaf(a, b[i], c[i]);
    return c;
}

/* a * a + c, alike */
INLINE Vec fused_square(Vec a, Vec c)
{
    UNROLLED for (int i = 0; i < WIDTH; i++) c[i] = __builtin_fmaf(a[i], a[i], c[i]);
    return c;
}

/* NaN goes through both kinds of gate, as in torch. */
INLINE Vec relu(Vec x) { return (Vec)((Mask)x & ~(x < 0.0f)); }

INLINE Vec through_relu(Vec x, Vec gate)
{
    const Vec one = (Vec){0} + 1.0f;
    return x * (Vec)((Mask)one & (gate > 0.0f));
}

/* c[i, n] = after(start[n] + sum over k of a[i * ai + k * ak] * b[k, n]); the gate lies like c. */
typedef struct { const float *a; int64_t ai, ak; Matrix b; int64_t count; } Product;
typedef struct { const float *start; After after; const float *gate; } Ending;

INLINE void tile(int rows, int vecs, const Product *p, Ending e, Matrix c)
{
    Vec sum[TILE_ROWS][3];
    UNROLLED for (int i = 0; i < rows; i++)
        UNROLLED for (int v = 0; v < vecs; v++)
            sum[i][v] = e.start ? READ(e.start + v * WIDTH) : (Vec){0};
    for (int64_t k = 0; k < p->count; k++) {
        const float *a = p->a + k * p->ak, *b = p->b.at + k * p->b.row;
        UNROLLED for (int i = 0; i < rows; i++)
            UNROLLED for (int v = 0; v < vecs; v++)
                sum[i][v] = fused(a[i * p->ai], READ(b + v * WIDTH), sum[i][v]);
    }
    UNROLLED for (int i = 0; i < rows; i++)
        UNROLLED for (int v = 0; v < vecs; v++) {
            Vec x = sum[i][v];
            if (e.after == RELU) x = relu(x);
            if (e.after == THROUGH_RELU) x = through_relu(x, READ(e.gate + i * c.row + v * WIDTH));
            AT(c.at + i * c.row + v * WIDTH) = x;
        }
}

/* c [rows, outputs]. Outputs: a multiple of LANES, or at least three times LANES. What is left over
 * at the end is one vector that overlaps the one before it: the same numbers are written twice. */
static void product(Product p, int64_t rows, int64_t outputs, Ending e, Matrix c)
{
    for (int64_t next = 0, vecs; next < outputs; next += vecs * WIDTH) {
        const int64_t left = (outputs - next + WIDTH - 1) / WIDTH;
        vecs = left == 4 ? 2 : left < 3 ? left : 3;
        const int64_t end = next + vecs * WIDTH, n = end > outputs ? next - end + outputs : next;
        for (int64_t i = 0, step; i < rows; i += step) {
            const Product q = {p.a + i * p.ai, p.ai, p.ak, {p.b.at + n, p.b.row}, p.count};
            const Ending f = {e.start ? e.start + n : NULL, e.after,
                              e.gate ? e.gate + i * c.row + n : NULL};
            const Matrix to = {c.at + i * c.row + n, c.row};
            step = rows - i >= TILE_ROWS ? TILE_ROWS : rows - i >= 2 ? 2 : 1;
#define TILE(R, V) if (step == R && vecs == V) tile(R, V, &q, f, to)
            TILE(TILE_ROWS, 3); TILE(TILE_ROWS, 2); TILE(TILE_ROWS, 1);
            TILE(2, 3); TILE(2, 2); TILE(2, 1);
            TILE(1, 3); TILE(1, 2); TILE(1, 1);
#undef TILE
        }
    }
}

/* out [count] += x [count] */
static void add(int64_t count, const float *restrict x, float *restrict out)
{
    for (int64_t h = 0; h < count; h++) out[h] += x[h];
}
