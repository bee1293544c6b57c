/* The first layer over observations that are mostly zeros, e.g. 8% ones in pursuit.
 *
 * x [G, B, J, O] bytes, f factors [G, B, J, U] with U = 1 (a factor a block) or U = O (an element),
 * weight [G, J0..J0+J) of all JW blocks, each O x H. The plain meaning, and the test's oracle, is
 *     out[g, b, h] = bias[g, h] + sum_{j, o} x[g, b, j, o] f[g, b, j, u] weight[g, j, o, h]
 * networks/inputs.py has it in torch. Strides are in elements. Nothing here is parallel: one
 * training process is one thread.
 */
#include <stdint.h>
#include <string.h>

typedef struct {
    int64_t networks, rows, blocks, units, factors, outputs;
    int64_t x_network, x_row, f_network, f_row; /* strides */
} Shape;

/* Calls ROW for each k with x[k] != 0, in order: 8 bytes at a look, and no branch for a zero. */
#define FOR_NONZERO(x, n, ROW)                                        \
    for (int64_t k0 = 0; k0 < (n); k0 += 8) {                         \
        const int64_t left = (n) - k0 < 8 ? (n) - k0 : 8;             \
        uint64_t word = 0;                                            \
        memcpy(&word, (x) + k0, (size_t)left);                        \
        while (word != 0) {                                           \
            const int shift = __builtin_ctzll(word) & ~7;             \
            const int64_t k = k0 + (shift >> 3); /* little-endian */  \
            word &= ~(0xFFULL << shift);                              \
            ROW                                                       \
        }                                                             \
    }

void first_layer(const Shape *s, const uint8_t *x, const float *f, const float *weight,
                 const float *bias, float *restrict out)
{
    const int64_t h_count = s->outputs, block = s->units * h_count;
    for (int64_t g = 0; g < s->networks; g++)
        for (int64_t b = 0; b < s->rows; b++) {
            float *restrict sum = out + (g * s->rows + b) * h_count;
            memcpy(sum, bias + g * h_count, (size_t)h_count * sizeof(float));
            for (int64_t j = 0; j < s->blocks; j++) {
                const uint8_t *xs = x + g * s->x_network + b * s->x_row + j * s->units;
                const float *fs = f + g * s->f_network + b * s->f_row + j * s->factors;
                const float *w = weight + (g * s->blocks + j) * block;
                if (s->factors == 1 && fs[0] == 0.0f) continue; /* a dropped message */
                FOR_NONZERO(xs, s->units, {
                    const float c = (float)xs[k] * fs[s->factors == 1 ? 0 : k];
                    if (c == 0.0f) continue;
                    const float *row = w + k * h_count;
                    for (int64_t h = 0; h < h_count; h++) sum[h] += c * row[h];
                })
            }
        }
}

/* grad_weight = x~ transposed times grad_out, summed over the rows. */
void first_layer_backward(const Shape *s, const uint8_t *x, const float *f, const float *grad_out,
                          float *restrict grad_weight)
{
    const int64_t h_count = s->outputs, block = s->units * h_count;
    memset(grad_weight, 0, (size_t)(s->networks * s->blocks * block) * sizeof(float));
    for (int64_t g = 0; g < s->networks; g++)
        for (int64_t b = 0; b < s->rows; b++) {
            const float *grad = grad_out + (g * s->rows + b) * h_count;
            for (int64_t j = 0; j < s->blocks; j++) {
                const uint8_t *xs = x + g * s->x_network + b * s->x_row + j * s->units;
                const float *fs = f + g * s->f_network + b * s->f_row + j * s->factors;
                float *restrict w = grad_weight + (g * s->blocks + j) * block;
                if (s->factors == 1 && fs[0] == 0.0f) continue;
                FOR_NONZERO(xs, s->units, {
                    const float c = (float)xs[k] * fs[s->factors == 1 ? 0 : k];
                    if (c == 0.0f) continue;
                    float *restrict row = w + k * h_count;
                    for (int64_t h = 0; h < h_count; h++) row[h] += c * grad[h];
                })
            }
        }
}
