/* First layers over inputs that are mostly 0 (92% of pursuit's bytes, 94% of waterworld's numbers).
 *
 * What is not 0 is listed once; a row of a product then adds up the rows of the weight that it
 * needs, and its gradient is spread over them.
 */
#pragma once
#ifdef __AVX512VBMI2__
#include <immintrin.h>
#endif

#include "products.h"

typedef struct { uint16_t *unit; float *value; } List;                            /* of all rows */
typedef struct { const uint16_t *unit; const float *value; int64_t count; } Row; /* not 0 */
typedef struct { const float *of; int64_t step; } Factor; /* of unit k: of[k * step] */
enum { SPARE = 64 }; /* numbers that a list is longer than what it holds: whole vectors go there */

static Row row_of(List list, int64_t from, int64_t to)
{
    return (Row){list.unit + from, list.value + from, to - from};
}

/* Appends the units of x that are not 0, and their values, at `found`; returns the new end. */
static int64_t list_bytes(const uint8_t *x, int64_t units, List list, int64_t found)
{
    int64_t k = 0;
#ifdef __AVX512VBMI2__
    __m512i unit = _mm512_add_epi16(
        _mm512_set_epi16(31, 30, 29, 28, 27, 26, 25, 24, 23, 22, 21, 20, 19, 18, 17, 16, 15, 14, 13,
                         12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0), _mm512_setzero_si512());
    for (; k < units; k += 32, unit = _mm512_add_epi16(unit, _mm512_set1_epi16(32))) {
        const __mmask32 there = units - k < 32 ? (1u << (units - k)) - 1u : ~0u;
        const __m256i bytes = _mm256_maskz_loadu_epi8(there, x + k);
        const __mmask32 some = _mm256_test_epi8_mask(bytes, bytes);
        const __m256i packed = _mm256_maskz_compress_epi8(some, bytes);
        const __m128i first = _mm256_castsi256_si128(packed);
        const __m128i second = _mm256_extracti128_si256(packed, 1);
        _mm512_storeu_si512(list.unit + found, _mm512_maskz_compress_epi16(some, unit));
        _mm512_storeu_ps(list.value + found, _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(first)));
        _mm512_storeu_ps(list.value + found + 16, _mm512_cvtepi32_ps(_mm512_cvtepu8_epi32(second)));
        found += __builtin_popcount(some);
    }
#else
    for (; k < units; k++) { /* no branch to guess wrong */
        list.unit[found] = (uint16_t)k;
        list.value[found] = (float)x[k];
        found += x[k] != 0;
    }
#endif
    return found;
}

/* The same of numbers. */
static int64_t list_numbers(const float *x, int64_t units, List list, int64_t found)
{
    int64_t k = 0;
#ifdef __AVX512VBMI2__
    __m512i unit = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    for (; k < units; k += 16, unit = _mm512_add_epi32(unit, _mm512_set1_epi32(16))) {
        const __mmask16 there = units - k < 16 ? (__mmask16)((1u << (units - k)) - 1u) : 0xffff;
        const __m512 v = _mm512_maskz_loadu_ps(there, x + k);
        const __mmask16 some = _mm512_cmp_ps_mask(v, _mm512_setzero_ps(), _CMP_NEQ_UQ);
        const __m512i packed = _mm512_maskz_compress_epi32(some, unit);
        _mm256_storeu_si256((void *)(list.unit + found), _mm512_cvtepi32_epi16(packed));
        _mm512_storeu_ps(list.value + found, _mm512_maskz_compress_ps(some, v));
        found += __builtin_popcount(some);
    }
#else
    for (; k < units; k++) { /* no branch to guess wrong */
        list.unit[found] = (uint16_t)k;
        list.value[found] = x[k];
        found += x[k] != 0.0f;
    }
#endif
    return found;
}

/* The columns of a row, as many as registers hold; the last vector may overlap its neighbour. */
#define VEC(v) ((v) == vecs - 1 ? last : (v) * WIDTH)
#define BY_COLUMNS(width, CALL)                                                           \
    do {                                                                                  \
        const int64_t all = ((width) + WIDTH - 1) / WIDTH, parts = (all + 7) / 8;         \
        const int64_t most = (all + parts - 1) / parts;                                   \
        for (int64_t vecs = all - most * (parts - 1), h = 0; h < (width); vecs = most) {  \
            const int64_t next = h + vecs * WIDTH;                                        \
            const int64_t last = (next < (width) ? next : (width)) - WIDTH - h;           \
            switch (vecs) {                                                               \
                case 1: CALL(1); break; case 2: CALL(2); break; case 3: CALL(3); break;   \
                case 4: CALL(4); break; case 5: CALL(5); break; case 6: CALL(6); break;   \
                case 7: CALL(7); break; default: CALL(8);                                 \
            }                                                                             \
            h = next;                                                                     \
        }                                                                                 \
    } while (0)

INLINE void add_columns(int vecs, int64_t last, Row x, Factor f, Matrix weight, Ending e,
                        float *out)
{
    Vec sum[8];
    UNROLLED for (int v = 0; v < vecs; v++) sum[v] = e.start ? READ(e.start + VEC(v)) : (Vec){0};
    for (int64_t n = 0; n < x.count; n++) {
        const float share = x.value[n] * f.of[x.unit[n] * f.step];
        const float *row = weight.at + x.unit[n] * weight.row;
        __asm__("" : "+r"(row)); /* one address for all of them; gcc makes one for each */
        UNROLLED for (int v = 0; v < vecs; v++) sum[v] = fused(share, READ(row + VEC(v)), sum[v]);
    }
    UNROLLED for (int v = 0; v < vecs; v++) AT(out + VEC(v)) = e.after == RELU ? relu(sum[v]) : sum[v];
}

/* out [width] = after(start [width] + (factors times x) times weight [units, width]) */
static void add_rows(Row x, Factor f, Matrix weight, int64_t width, Ending e, float *out)
{
#define CALL(V) add_columns(V, last, x, f, (Matrix){weight.at + h, weight.row}, \
                            (Ending){e.start ? e.start + h : NULL, e.after, NULL}, out + h)
    BY_COLUMNS(width, CALL);
#undef CALL
}

INLINE void spread_columns(int vecs, int64_t last, Row x, Factor f, const float *grad,
                           Matrix gradient)
{
    Vec slope[8], sum[8];
    UNROLLED for (int v = 0; v < vecs; v++) slope[v] = READ(grad + VEC(v));
    for (int64_t n = 0; n < x.count; n++) {
        const float share = x.value[n] * f.of[x.unit[n] * f.step];
        float *row = gradient.at + x.unit[n] * gradient.row;
        __asm__("" : "+r"(row));
        UNROLLED for (int v = 0; v < vecs; v++) sum[v] = fused(share, slope[v], READ(row + VEC(v)));
        UNROLLED for (int v = 0; v < vecs; v++) AT(row + VEC(v)) = sum[v]; /* all are read by now: overlap */
    }
}

/* gradient [units, width] += (factors times x) transposed times grad [width] */
static void spread_rows(Row x, Factor f, const float *grad, int64_t width, Matrix gradient)
{
#define CALL(V) \
    spread_columns(V, last, x, f, grad + h, (Matrix){gradient.at + h, gradient.row})
    BY_COLUMNS(width, CALL);
#undef CALL
}
