/* What `splitmix64` of engine/randomness.py computes with torch, in one pass. It matters where
 * single elements are dropped: 141,120 numbers an update in pursuit N=6. */
#include <stdint.h>

/* out [runs, 2 * words]: the words from `first` on of the streams that begin at `keys`. */
void splitmix64(const uint64_t *keys, int64_t runs, uint64_t first, int64_t words, int64_t *out)
{
    for (int64_t r = 0; r < runs; r++)
        for (int64_t n = 0; n < words; n++, out += 2) {
            uint64_t z = keys[r] + (first + (uint64_t)n + 1) * 0x9E3779B97F4A7C15u;
            z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
            z = (z ^ z >> 27) * 0x94D049BB133111EBu;
            z ^= z >> 31;
            out[0] = (int64_t)(z >> 32);
            out[1] = (int64_t)(z & 0xFFFFFFFFu);
        }
}
