/* A dense layer over rows that are mostly 0, and its weights' gradient.
 *
 * Waterworld's sensors see nothing most of the time: 94% of an observation is 0. So a row adds up
 * the few rows of the weights that count. For each network g, with its own x, weight and bias:
 *   out[r, h] = bias[h] + sum over k of x[r, k] * weight[k, h]
 * Networks are done one by one, so a network's bits do not depend on how many there are.
 */
#include <stdint.h>
#include <string.h>

enum { LANES = 16 };
/* Sixteen numbers side by side, wherever they lie; the compiler splits what is too wide. */
typedef float wide __attribute__((vector_size(4 * LANES), aligned(4), may_alias));

typedef struct {
    int64_t networks, rows, units, outputs;
} shape;

static int64_t nonzero(const float *restrict x, int64_t units, int32_t *restrict at)
{
    int64_t count = 0, k = 0;
    for (; k + 8 <= units; k += 8) {
        int any = 0;
        for (int64_t j = 0; j < 8; j++) any |= x[k + j] != 0.0f; /* one comparison of eight */
        if (!any) continue;
        for (int64_t j = k; j < k + 8; j++) {
            at[count] = (int32_t)j;
            count += x[j] != 0.0f;
        }
    }
    for (; k < units; k++) {
        at[count] = (int32_t)k;
        count += x[k] != 0.0f;
    }
    return count;
}

/* out[h] += sum over the count of x * weight, a stretch of outputs in registers at a time. */
static void add_rows(int64_t count, const int32_t *restrict at, const float *restrict x,
                     const float *restrict weight, int64_t h_count, float *restrict out)
{
    int64_t h = 0;
    for (; h + 4 * LANES <= h_count; h += 4 * LANES) {
        wide *o = (wide *)(out + h), a = o[0], b = o[1], c = o[2], d = o[3];
        for (int64_t n = 0; n < count; n++) {
            const wide *row = (const wide *)(weight + at[n] * h_count + h);
            const float factor = x[at[n]];
            a += factor * row[0], b += factor * row[1], c += factor * row[2], d += factor * row[3];
        }
        o[0] = a, o[1] = b, o[2] = c, o[3] = d;
    }
    for (; h + LANES <= h_count; h += LANES) {
        wide *o = (wide *)(out + h), a = o[0];
        for (int64_t n = 0; n < count; n++)
            a += x[at[n]] * *(const wide *)(weight + at[n] * h_count + h);
        o[0] = a;
    }
    for (; h < h_count; h++)
        for (int64_t n = 0; n < count; n++) out[h] += x[at[n]] * weight[at[n] * h_count + h];
}

void sparse_rows(const shape *s, const float *x, const float *weight, const float *bias,
                 float *restrict out)
{
    const int64_t h_count = s->outputs;
    int32_t at[s->units + 1]; /* one is written to before it is known to count */
    for (int64_t g = 0; g < s->networks; g++, weight += s->units * h_count)
        for (int64_t r = 0; r < s->rows; r++, x += s->units, out += h_count) {
            if (bias) memcpy(out, bias + g * h_count, (size_t)h_count * sizeof(float));
            else memset(out, 0, (size_t)h_count * sizeof(float));
            const int64_t count = nonzero(x, s->units, at);
            add_rows(count, at, x, weight, h_count, out);
        }
}

void sparse_rows_backward(const shape *s, const float *x, const float *grad_out,
                          float *restrict grad_weight)
{
    const int64_t h_count = s->outputs, size = s->units * h_count;
    int32_t at[s->units + 1]; /* one is written to before it is known to count */
    memset(grad_weight, 0, (size_t)(s->networks * size) * sizeof(float));
    for (int64_t g = 0; g < s->networks; g++, grad_weight += size)
        for (int64_t r = 0; r < s->rows; r++, x += s->units, grad_out += h_count) {
            const int64_t count = nonzero(x, s->units, at);
            for (int64_t n = 0; n < count; n++) {
                const float c = x[at[n]];
                float *restrict row = grad_weight + at[n] * h_count;
                for (int64_t h = 0; h < h_count; h++) row[h] += c * grad_out[h];
            }
        }
}
