/* Types for one vector of floats, one of ints and one of masks, with the operations that kernels need. The same source
 * is compiled once per instruction set: SIMD_AVX512 (16 lanes), SIMD_AVX2 (8), SIMD_SSE42 (4), or none of them. Without
 * a define it is plain C with the compiler's generic vectors (4 lanes), which is the reference and runs on any machine.
 *
 * Arithmetic (+ - * /) and comparison are the compiler's own operations on vector types. All of them are exact in the
 * sense of IEEE and never fused (-ffp-contract=off), so that the results are bit-identical for all instruction sets.
 * The exceptions are vf_muladd(), which is fused if the hardware supports that, and vf_diff_of_products(), which has
 * two implementations, each with an error of at most 1.5 units in the last place.
 *
 * GNU C has no vector ?: outside C++, hence vf_select(). Masks are 16 bits on AVX-512, and integer lanes of 0 and -1
 * otherwise: always use the vm_* functions. */
#ifndef BASE_SIMD_H
#define BASE_SIMD_H

#include <stdint.h>
#include <string.h>

#if defined(SIMD_AVX512) || defined(SIMD_AVX2) || defined(SIMD_SSE42)
#include <immintrin.h>
#endif

#if defined(SIMD_AVX512)
#define SIMD_WIDTH 16
#elif defined(SIMD_AVX2)
#define SIMD_WIDTH 8
#else
#define SIMD_WIDTH 4
#endif

#define SIMD_INLINE static inline __attribute__((always_inline))

typedef float vf __attribute__((vector_size(SIMD_WIDTH * 4), may_alias));
typedef int32_t vi __attribute__((vector_size(SIMD_WIDTH * 4), may_alias));

#if defined(SIMD_AVX512)
typedef __mmask16 vm;
#else
typedef vi vm;
#endif

/* Returns a vector with x in all lanes. The expression (vf){0} + x would be wrong, because this addition turns -0 into
 * 0, and compilers may therefore not remove it. */
SIMD_INLINE vf vf_set(float x)
{
#if defined(SIMD_AVX512)
    return (vf)_mm512_set1_ps(x);
#elif defined(SIMD_AVX2)
    return (vf)_mm256_set1_ps(x);
#else
    return (vf){x, x, x, x};
#endif
}
SIMD_INLINE vi vi_set(int32_t x)
{
    return (vi){0} + x;
}

/* Returns the vector of lane numbers: 0, 1, 2 and so on. */
SIMD_INLINE vi vi_lanes(void)
{
    static const int32_t numbers[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    vi v;
    memcpy(&v, numbers, sizeof v);
    return v;
}

SIMD_INLINE vf vf_load(const float *p)
{
    vf v;
    memcpy(&v, p, sizeof v);
    return v;
}
SIMD_INLINE void vf_store(float *p, vf v)
{
    memcpy(p, &v, sizeof v);
}
SIMD_INLINE vi vi_from_bits(vf v)
{
    return (vi)v;
}
SIMD_INLINE vf vf_from_bits(vi v)
{
    return (vf)v;
}

/* Converts to integers, rounding towards zero. */
SIMD_INLINE vi vi_from_vf(vf v)
{
    return __builtin_convertvector(v, vi);
}
SIMD_INLINE vf vf_from_vi(vi v)
{
    return __builtin_convertvector(v, vf);
}

#if defined(SIMD_AVX512)

SIMD_INLINE vm vf_lt(vf a, vf b)
{
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LT_OQ);
}
SIMD_INLINE vm vf_le(vf a, vf b)
{
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LE_OQ);
}
SIMD_INLINE vm vf_eq(vf a, vf b)
{
    return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_EQ_OQ);
}
SIMD_INLINE vm vm_and(vm a, vm b)
{
    return (vm)(a & b);
}
SIMD_INLINE vm vm_or(vm a, vm b)
{
    return (vm)(a | b);
}
SIMD_INLINE vm vm_xor(vm a, vm b)
{
    return (vm)(a ^ b);
}
/* Returns the lanes in a that are not in b. */
SIMD_INLINE vm vm_andnot(vm a, vm b)
{
    return (vm)(a & ~b);
}
SIMD_INLINE vm vm_none(void)
{
    return 0;
}
SIMD_INLINE unsigned vm_bits(vm m)
{
    return m;
}
SIMD_INLINE vm vm_from_bits(unsigned bits)
{
    return (vm)bits;
}
SIMD_INLINE int vm_any(vm m)
{
    return m != 0;
}
SIMD_INLINE vf vf_select(vm m, vf a, vf b)
{
    return (vf)_mm512_mask_blend_ps(m, (__m512)b, (__m512)a);
}
SIMD_INLINE vf vf_min(vf a, vf b)
{
    return (vf)_mm512_min_ps((__m512)a, (__m512)b);
}
SIMD_INLINE vf vf_max(vf a, vf b)
{
    return (vf)_mm512_max_ps((__m512)a, (__m512)b);
}
SIMD_INLINE vf vf_sqrt(vf a)
{
    return (vf)_mm512_sqrt_ps((__m512)a);
}
SIMD_INLINE vf vf_floor(vf a)
{
    return (vf)_mm512_roundscale_ps((__m512)a, _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC);
}
SIMD_INLINE vf vf_gather(const float *base, vi index)
{
    return (vf)_mm512_i32gather_ps((__m512i)index, base, 4);
}
SIMD_INLINE float vf_reduce_min(vf a)
{
    return _mm512_reduce_min_ps((__m512)a);
}
SIMD_INLINE float vf_reduce_max(vf a)
{
    return _mm512_reduce_max_ps((__m512)a);
}

#else

SIMD_INLINE vm vf_lt(vf a, vf b)
{
    return (vm)(a < b);
}
SIMD_INLINE vm vf_le(vf a, vf b)
{
    return (vm)(a <= b);
}
SIMD_INLINE vm vf_eq(vf a, vf b)
{
    return (vm)(a == b);
}
SIMD_INLINE vm vm_and(vm a, vm b)
{
    return a & b;
}
SIMD_INLINE vm vm_or(vm a, vm b)
{
    return a | b;
}
SIMD_INLINE vm vm_xor(vm a, vm b)
{
    return a ^ b;
}
SIMD_INLINE vm vm_andnot(vm a, vm b)
{
    return a & ~b;
}
SIMD_INLINE vm vm_none(void)
{
    return vi_set(0);
}

SIMD_INLINE vm vm_from_bits(unsigned bits)
{
    vi lane;
    for (int i = 0; i < SIMD_WIDTH; i++) lane[i] = (bits >> i & 1u) ? -1 : 0;
    return lane;
}

#if defined(SIMD_AVX2)

SIMD_INLINE unsigned vm_bits(vm m)
{
    return (unsigned)_mm256_movemask_ps((__m256)m);
}
SIMD_INLINE int vm_any(vm m)
{
    return !_mm256_testz_si256((__m256i)m, (__m256i)m);
}
SIMD_INLINE vf vf_select(vm m, vf a, vf b)
{
    return (vf)_mm256_blendv_ps((__m256)b, (__m256)a, (__m256)m);
}
SIMD_INLINE vf vf_min(vf a, vf b)
{
    return (vf)_mm256_min_ps((__m256)a, (__m256)b);
}
SIMD_INLINE vf vf_max(vf a, vf b)
{
    return (vf)_mm256_max_ps((__m256)a, (__m256)b);
}
SIMD_INLINE vf vf_sqrt(vf a)
{
    return (vf)_mm256_sqrt_ps((__m256)a);
}
SIMD_INLINE vf vf_floor(vf a)
{
    return (vf)_mm256_floor_ps((__m256)a);
}
SIMD_INLINE vf vf_gather(const float *base, vi index)
{
    return (vf)_mm256_i32gather_ps(base, (__m256i)index, 4);
}

#elif defined(SIMD_SSE42)

SIMD_INLINE unsigned vm_bits(vm m)
{
    return (unsigned)_mm_movemask_ps((__m128)m);
}
SIMD_INLINE int vm_any(vm m)
{
    return !_mm_testz_si128((__m128i)m, (__m128i)m);
}
SIMD_INLINE vf vf_select(vm m, vf a, vf b)
{
    return (vf)_mm_blendv_ps((__m128)b, (__m128)a, (__m128)m);
}
SIMD_INLINE vf vf_min(vf a, vf b)
{
    return (vf)_mm_min_ps((__m128)a, (__m128)b);
}
SIMD_INLINE vf vf_max(vf a, vf b)
{
    return (vf)_mm_max_ps((__m128)a, (__m128)b);
}
SIMD_INLINE vf vf_sqrt(vf a)
{
    return (vf)_mm_sqrt_ps((__m128)a);
}
SIMD_INLINE vf vf_floor(vf a)
{
    return (vf)_mm_floor_ps((__m128)a);
}

#else

SIMD_INLINE unsigned vm_bits(vm m)
{
    unsigned bits = 0;
    for (int i = 0; i < SIMD_WIDTH; i++) bits |= (m[i] ? 1u : 0u) << i;
    return bits;
}
SIMD_INLINE int vm_any(vm m)
{
    return (m[0] | m[1] | m[2] | m[3]) != 0;
}
SIMD_INLINE vf vf_select(vm m, vf a, vf b)
{
    return (vf)(((vi)a & m) | ((vi)b & ~m));
}
/* vf_min() and vf_max() return b if either value is NaN, like the instructions of x86. */
SIMD_INLINE vf vf_min(vf a, vf b)
{
    return vf_select(vf_lt(a, b), a, b);
}
SIMD_INLINE vf vf_max(vf a, vf b)
{
    return vf_select(vf_lt(b, a), a, b);
}
SIMD_INLINE vf vf_sqrt(vf a)
{
    for (int i = 0; i < SIMD_WIDTH; i++) a[i] = __builtin_sqrtf(a[i]);
    return a;
}
SIMD_INLINE vf vf_floor(vf a)
{
    for (int i = 0; i < SIMD_WIDTH; i++) a[i] = __builtin_floorf(a[i]);
    return a;
}

#endif

#if !defined(SIMD_AVX2)
/* Returns base[index] per lane. The elements are copied by memcpy(), because some callers gather arrays of integers,
 * and interpret the bits of the result as integers again. The vector is not loaded from the array v: compilers would
 * store v by parts of another size, and the load would wait until these stores have reached the cache. */
SIMD_INLINE vf vf_gather(const float *base, vi index)
{
    float v[4];
    for (int i = 0; i < 4; i++) memcpy(v + i, base + index[i], sizeof *v);
    return (vf){v[0], v[1], v[2], v[3]};
}
#endif

SIMD_INLINE float vf_reduce_min(vf a)
{
    float least = a[0];
    for (int i = 1; i < SIMD_WIDTH; i++) least = a[i] < least ? a[i] : least;
    return least;
}
SIMD_INLINE float vf_reduce_max(vf a)
{
    float most = a[0];
    for (int i = 1; i < SIMD_WIDTH; i++) most = a[i] > most ? a[i] : most;
    return most;
}

#endif

SIMD_INLINE void vm_set_lane(vm *m, int lane)
{
#if defined(SIMD_AVX512)
    *m |= (vm)(1u << lane);
#else
    (*m)[lane] = -1;
#endif
}

/* Returns v[index] per lane; each index must be below SIMD_WIDTH. */
SIMD_INLINE vf vf_permute(vf v, vi index)
{
#if defined(SIMD_AVX512)
    return (vf)_mm512_permutexvar_ps((__m512i)index, (__m512)v);
#elif defined(SIMD_AVX2)
    return (vf)_mm256_permutevar8x32_ps((__m256)v, (__m256i)index);
#elif defined(SIMD_SSE42)
    return (vf)_mm_shuffle_epi8((__m128i)v, (__m128i)(index * 0x04040404 + 0x03020100));
#else
    vf out;
    for (int i = 0; i < SIMD_WIDTH; i++) out[i] = v[index[i]];
    return out;
#endif
}

/* Returns per lane first[index], or second[index - SIMD_WIDTH] if the index is SIMD_WIDTH or more. */
SIMD_INLINE vf vf_permute_pair(vf first, vf second, vi index)
{
#if defined(SIMD_AVX512)
    return (vf)_mm512_permutex2var_ps((__m512)first, (__m512i)index, (__m512)second);
#else
    vf out;
    for (int i = 0; i < SIMD_WIDTH; i++)
        out[i] = index[i] < SIMD_WIDTH ? first[index[i]] : second[index[i] - SIMD_WIDTH];
    return out;
#endif
}

/* Gathers base[index] into *first and base[index + 1] into *second. */
SIMD_INLINE void vf_gather_pair(const float *base, vi index, vf *first, vf *second)
{
#if defined(SIMD_AVX512)
    const __m512i i = (__m512i)index;
    const __m512 low = _mm512_castpd_ps(_mm512_i32gather_pd(_mm512_castsi512_si256(i), base, 4));
    const __m512 high = _mm512_castpd_ps(_mm512_i32gather_pd(_mm512_extracti64x4_epi64(i, 1), base, 4));
    const __m512i even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
    *first = (vf)_mm512_permutex2var_ps(low, even, high);
    *second = (vf)_mm512_permutex2var_ps(low, _mm512_add_epi32(even, _mm512_set1_epi32(1)), high);
#else
    *first = vf_gather(base, index);
    *second = vf_gather(base + 1, index);
#endif
}

/* Stores indices in an array for scalar loads. Without this function, compilers extract every index from the vector
 * separately, with two instructions per lane. */
SIMD_INLINE void vi_store(int32_t out[SIMD_WIDTH], vi a)
{
    memcpy(out, &a, sizeof a);
    __asm__("" : "+m"(*(int32_t(*)[SIMD_WIDTH])out));
}

/* Transposes SIMD_WIDTH / 4 matrices of 4 × 4 numbers. Row i of matrix k consists of lanes 4 k to 4 k + 3 of v[i]. */
SIMD_INLINE void vf_transpose(vf v[4])
{
#if defined(SIMD_AVX512)
    const __m512 a = _mm512_unpacklo_ps((__m512)v[0], (__m512)v[1]), b = _mm512_unpackhi_ps((__m512)v[0], (__m512)v[1]);
    const __m512 c = _mm512_unpacklo_ps((__m512)v[2], (__m512)v[3]), d = _mm512_unpackhi_ps((__m512)v[2], (__m512)v[3]);
    v[0] = (vf)_mm512_unpacklo_pd((__m512d)a, (__m512d)c);
    v[1] = (vf)_mm512_unpackhi_pd((__m512d)a, (__m512d)c);
    v[2] = (vf)_mm512_unpacklo_pd((__m512d)b, (__m512d)d);
    v[3] = (vf)_mm512_unpackhi_pd((__m512d)b, (__m512d)d);
#elif defined(SIMD_AVX2)
    const __m256 a = _mm256_unpacklo_ps((__m256)v[0], (__m256)v[1]), b = _mm256_unpackhi_ps((__m256)v[0], (__m256)v[1]);
    const __m256 c = _mm256_unpacklo_ps((__m256)v[2], (__m256)v[3]), d = _mm256_unpackhi_ps((__m256)v[2], (__m256)v[3]);
    v[0] = (vf)_mm256_unpacklo_pd((__m256d)a, (__m256d)c);
    v[1] = (vf)_mm256_unpackhi_pd((__m256d)a, (__m256d)c);
    v[2] = (vf)_mm256_unpacklo_pd((__m256d)b, (__m256d)d);
    v[3] = (vf)_mm256_unpackhi_pd((__m256d)b, (__m256d)d);
#elif defined(SIMD_SSE42)
    __m128 row[4];
    for (int i = 0; i < 4; i++) row[i] = (__m128)v[i];
    _MM_TRANSPOSE4_PS(row[0], row[1], row[2], row[3]);
    for (int i = 0; i < 4; i++) v[i] = (vf)row[i];
#else
    for (int n = 0; n < 4; n++)
        for (int i = 0; i < n; i++) {
            const float above = v[i][n];
            v[i][n] = v[n][i];
            v[n][i] = above;
        }
#endif
}

/* Loads four numbers from base + index[0] into the first four lanes, four from base + index[4] into the next four, and
 * so on. */
SIMD_INLINE vf vf_load_quarters(const float *base, const int32_t *index)
{
#if defined(SIMD_AVX512)
    __m512 row = _mm512_castps128_ps512(_mm_loadu_ps(base + index[0]));
    row = _mm512_insertf32x4(row, _mm_loadu_ps(base + index[4]), 1);
    row = _mm512_insertf32x4(row, _mm_loadu_ps(base + index[8]), 2);
    return (vf)_mm512_insertf32x4(row, _mm_loadu_ps(base + index[12]), 3);
#elif defined(SIMD_AVX2)
    const __m256 row = _mm256_castps128_ps256(_mm_loadu_ps(base + index[0]));
    return (vf)_mm256_insertf128_ps(row, _mm_loadu_ps(base + index[4]), 1);
#else
    return vf_load(base + index[0]);
#endif
}

/* Gathers base[index + n] into out[n], for n from 0 to 3. Loads each row of four floats with one instruction and
 * transposes the rows, because gathering the columns takes more instructions. */
SIMD_INLINE void vf_gather_rows(const float *base, const int32_t index[SIMD_WIDTH], vf out[4])
{
    for (int n = 0; n < 4; n++) out[n] = vf_load_quarters(base, index + n);
    vf_transpose(out);
}

/* A vector of doubles with half as many lanes as a vf, so that two such vectors correspond to one vf. */
typedef double vd __attribute__((vector_size(SIMD_WIDTH * 4)));

/* Gathers one double from the address base + index, counted in floats, for each lane of one half of `index`: the lower
 * half if `half` is 0, the upper half if it is 1. */
SIMD_INLINE vd vd_gather(const float *base, vi index, int half)
{
#if defined(SIMD_AVX512)
    const __m512i i = (__m512i)index;
    return (vd)_mm512_i32gather_pd(half ? _mm512_extracti64x4_epi64(i, 1) : _mm512_castsi512_si256(i), base, 4);
#elif defined(SIMD_AVX2)
    const __m256i i = (__m256i)index;
    const __m128i own = half ? _mm256_extracti128_si256(i, 1) : _mm256_castsi256_si128(i);
    return (vd)_mm256_i32gather_pd((const double *)(const void *)base, own, 4);
#else
    double v[2];
    for (int i = 0; i < 2; i++) memcpy(v + i, base + index[2 * half + i], sizeof *v);
    return (vd){v[0], v[1]};
#endif
}

#if defined(SIMD_AVX512)

SIMD_INLINE vm vd_lt(const vd a[2], const vd b[2])
{
    const __mmask8 low = _mm512_cmp_pd_mask((__m512d)a[0], (__m512d)b[0], _CMP_LT_OQ);
    return _mm512_kunpackb(_mm512_cmp_pd_mask((__m512d)a[1], (__m512d)b[1], _CMP_LT_OQ), low);
}
SIMD_INLINE vm vd_eq(const vd a[2], const vd b[2])
{
    const __mmask8 low = _mm512_cmp_pd_mask((__m512d)a[0], (__m512d)b[0], _CMP_EQ_OQ);
    return _mm512_kunpackb(_mm512_cmp_pd_mask((__m512d)a[1], (__m512d)b[1], _CMP_EQ_OQ), low);
}
SIMD_INLINE void vd_select(vm m, const vd a[2], const vd b[2], vd out[2])
{
    out[0] = (vd)_mm512_mask_blend_pd((__mmask8)m, (__m512d)b[0], (__m512d)a[0]);
    out[1] = (vd)_mm512_mask_blend_pd((__mmask8)(m >> 8), (__m512d)b[1], (__m512d)a[1]);
}

#else

typedef int64_t vd_mask __attribute__((vector_size(SIMD_WIDTH * 4)));
typedef int32_t vd_narrow_mask __attribute__((vector_size(SIMD_WIDTH * 2)));

SIMD_INLINE vm vm_of_halves(vd_mask first, vd_mask second)
{
    const vd_narrow_mask halves[2] = {__builtin_convertvector(first, vd_narrow_mask),
                                      __builtin_convertvector(second, vd_narrow_mask)};
    vm out;
    memcpy(&out, halves, sizeof out);
    return out;
}
SIMD_INLINE vm vd_lt(const vd a[2], const vd b[2])
{
    return vm_of_halves(a[0] < b[0], a[1] < b[1]);
}
SIMD_INLINE vm vd_eq(const vd a[2], const vd b[2])
{
    return vm_of_halves(a[0] == b[0], a[1] == b[1]);
}
SIMD_INLINE void vd_select(vm m, const vd a[2], const vd b[2], vd out[2])
{
    vd_narrow_mask halves[2];
    memcpy(halves, &m, sizeof m);
    for (int half = 0; half < 2; half++) {
        const vd_mask own = __builtin_convertvector(halves[half], vd_mask);
        out[half] = (vd)(((vd_mask)a[half] & own) | ((vd_mask)b[half] & ~own));
    }
}

#endif

#if defined(SIMD_AVX2) || defined(SIMD_SSE42)
/* vf_compress() for four lanes. bits: mask of the lanes that are stored. */
SIMD_INLINE int simd_compress_four(float *to, unsigned bits, __m128 v)
{
    /* for each mask, the indices of the bytes of the selected lanes, in the order in which these lanes are stored */
    enum { A = 0x03020100, B = 0x07060504, C = 0x0b0a0908, D = 0x0f0e0d0c };
    static const int32_t bytes[16][4] = {
        {A, A, A, A}, {A, A, A, A}, {B, A, A, A}, {A, B, A, A}, {C, A, A, A}, {A, C, A, A}, {B, C, A, A}, {A, B, C, A},
        {D, A, A, A}, {A, D, A, A}, {B, D, A, A}, {A, B, D, A}, {C, D, A, A}, {A, C, D, A}, {B, C, D, A}, {A, B, C, D}};
    const __m128i order = _mm_loadu_si128((const __m128i *)(const void *)bytes[bits]);
    _mm_storeu_ps(to, _mm_castsi128_ps(_mm_shuffle_epi8(_mm_castps_si128(v), order)));
    return __builtin_popcount(bits);
}
#endif

/* Stores the lanes of v that are set in m one after the other, and returns their number. `to` must have space for all
 * lanes. */
SIMD_INLINE int vf_compress(float *to, vm m, vf v)
{
#if defined(SIMD_AVX512)
    _mm512_storeu_ps(to, _mm512_maskz_compress_ps((__mmask16)m, (__m512)v));
    return __builtin_popcount(vm_bits(m));
#elif defined(SIMD_AVX2)
    const unsigned bits = vm_bits(m);
    const int count = simd_compress_four(to, bits & 15, _mm256_castps256_ps128((__m256)v));
    return count + simd_compress_four(to + count, bits >> 4, _mm256_extractf128_ps((__m256)v, 1));
#elif defined(SIMD_SSE42)
    return simd_compress_four(to, vm_bits(m), (__m128)v);
#else
    int count = 0;
    for (unsigned bits = vm_bits(m); bits; bits &= bits - 1) to[count++] = v[__builtin_ctz(bits)];
    return count;
#endif
}

/* Stores SIMD_WIDTH rows of four numbers. Row i consists of lane i of each of the four vectors. */
SIMD_INLINE void vf_store_rows(float *to, const vf v[4])
{
    vf rows[4] = {v[0], v[1], v[2], v[3]};
    vf_transpose(rows);
    for (int n = 0; n < 4; n++) {
#if defined(SIMD_AVX512)
        _mm_storeu_ps(to + 4 * n, _mm512_extractf32x4_ps((__m512)rows[n], 0));
        _mm_storeu_ps(to + 4 * n + 16, _mm512_extractf32x4_ps((__m512)rows[n], 1));
        _mm_storeu_ps(to + 4 * n + 32, _mm512_extractf32x4_ps((__m512)rows[n], 2));
        _mm_storeu_ps(to + 4 * n + 48, _mm512_extractf32x4_ps((__m512)rows[n], 3));
#else
        for (int i = 0; i < SIMD_WIDTH; i += 4)
            memcpy(to + 4 * (n + i), (const float *)&rows[n] + i, 4 * sizeof(float));
#endif
    }
}

/* Computes a b - c d with an error of at most 1.5 units in the last place. The result has the correct sign, and is zero
 * only if the exact value is zero. The function uses Kahan's two fused steps if the hardware supports them, else
 * double, in which products of floats are exact. */
SIMD_INLINE vf vf_diff_of_products(vf a, vf b, vf c, vf d)
{
#if defined(SIMD_AVX512)
    const __m512 cd = _mm512_mul_ps((__m512)c, (__m512)d);
    const __m512 error = _mm512_fnmadd_ps((__m512)c, (__m512)d, cd);
    return (vf)_mm512_add_ps(_mm512_fmsub_ps((__m512)a, (__m512)b, cd), error);
#elif defined(SIMD_AVX2)
    const __m256 cd = _mm256_mul_ps((__m256)c, (__m256)d);
    const __m256 error = _mm256_fnmadd_ps((__m256)c, (__m256)d, cd);
    return (vf)_mm256_add_ps(_mm256_fmsub_ps((__m256)a, (__m256)b, cd), error);
#else
    typedef double vd __attribute__((vector_size(SIMD_WIDTH * 8)));
    const vd difference = __builtin_convertvector(a, vd) * __builtin_convertvector(b, vd) -
                          __builtin_convertvector(c, vd) * __builtin_convertvector(d, vd);
    return __builtin_convertvector(difference, vf);
#endif
}

/* Computes a b + c with one rounding if multiply and add are fused, else with two. */
SIMD_INLINE vf vf_muladd(vf a, vf b, vf c)
{
#if defined(SIMD_AVX512)
    return (vf)_mm512_fmadd_ps((__m512)a, (__m512)b, (__m512)c);
#elif defined(SIMD_AVX2)
    return (vf)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c);
#else
    return a * b + c;
#endif
}

/* Returns the lanes whose sign bit is set, including that of -0. */
SIMD_INLINE vm vm_sign(vi a)
{
#if defined(SIMD_AVX512)
    return _mm512_movepi32_mask((__m512i)a);
#else
    return (vm)(a >> 31);
#endif
}

/* simd_min() and simd_max() return the minimum and maximum of two numbers by the rule of vf_min() and vf_max(): b if
 * either number is NaN. fminf() is not used, because it treats NaN differently and takes more than one instruction. */
SIMD_INLINE float simd_min(float a, float b)
{
    return a < b ? a : b;
}
SIMD_INLINE float simd_max(float a, float b)
{
    return b < a ? a : b;
}
SIMD_INLINE vi vi_select(vm m, vi a, vi b)
{
    return vi_from_bits(vf_select(m, vf_from_bits(a), vf_from_bits(b)));
}
SIMD_INLINE vf vf_abs(vf a)
{
    return vf_from_bits(vi_from_bits(a) & vi_set(0x7fffffff));
}
SIMD_INLINE vf vf_clamp(vf a, vf low, vf high)
{
    return vf_min(vf_max(a, low), high);
}
SIMD_INLINE vm vm_all_lanes(void)
{
    return vm_from_bits((1u << SIMD_WIDTH) - 1u);
}
SIMD_INLINE vm vm_not(vm m)
{
    return vm_andnot(vm_all_lanes(), m);
}

#endif
