/* Sines and cosines by additions and multiplications alone: within 1 ulp for |angle| <= 1e5 as double and for every angle
 * as float, the same bits on every machine. Line by line what the module `trigonometry` of the file in Rust does. */

#ifdef NAME_FLOAT

/* sin r = r + r^3 * (...), cos r = 1 - r^2/2 + r^4 * (...) for |r| <= pi/4, interpolated at Chebyshev points. */
static real sine_series(real z)
{
    const real square = z * z;
    return ((real)-0.1666666716337204 + (z * (real)0.008333331905305386))
        + (square * ((real)-0.00019840082677546889 + (z * (real)2.7249313916399842e-06)));
}

static real cosine_series(real z)
{
    const real square = z * z;
    return ((real)0.0416666641831398 + (z * (real)-0.0013888300163671374)) + (square * (real)2.4547436623834074e-05);
}

/* 2/pi in binary, after a word of zeros. */
static const uint32_t two_over_pi[8] = {
    0x0U, 0xa2f9836eU, 0x4e441529U, 0xfc2757d1U, 0xf534ddc0U, 0xdb629599U, 0x3c439041U, 0xfe5163abU
};

/* A float and its bits. */
typedef union {
    float number;
    uint32_t bits;
} float_bits;

/* 32 bits of 2/pi from a bit of a word on. */
static uint64_t window(uint32_t word, uint32_t shift)
{
    const uint64_t first = two_over_pi[word & 7U];
    const uint64_t second = two_over_pi[(word + 1U) & 7U];
    return (((first << 32U) | second) << shift) >> 32U;
}

static uint32_t leading_zeros(uint64_t number)
{
    uint64_t left = number;
    uint32_t zeros = 0U;
    uint32_t step;
    for (step = 32U; step > 0U; step /= 2U) {
        const uint32_t below = 64U - step;
        if ((left >> below) == 0U) {
            left <<= step;
            zeros += step;
        }
    }
    return zeros;
}

/* Quarter turns, -2 ... 1, and what is left of an angle from pi/4 on in two parts, by integers: exact for every float
 * (Payne and Hanek). */
static void reduce_by_integers(real angle, real *turns, real *r, real *tail)
{
    float_bits given;
    uint32_t size;
    given.number = angle;
    size = given.bits & 0x7fffffffU;
    *turns = 0.0F;
    *r = angle;
    *tail = 0.0F;
    if (size >= 0x7f800000U) {
        /* No number. */
        *r = angle - angle;
    }
    if ((size >= 0x3f490fdbU) && (size < 0x7f800000U)) {
        /* angle = mantissa * 2^(exponent - 150): 96 bits of 2/pi from the first on that matters modulo four. */
        const uint64_t mantissa = (given.bits & 0x007fffffU) | 0x00800000U;
        const uint32_t exponent = size >> 23U;
        const uint32_t word = (exponent - 120U) >> 5U;
        const uint32_t shift = (exponent - 120U) & 31U;
        /* Two bits of quarter turns, 62 of their fraction. */
        const uint64_t product = ((mantissa * window(word, shift)) << 32U) + (mantissa * window(word + 1U, shift))
            + ((mantissa * window(word + 2U, shift)) >> 32U);
        const uint64_t quarters = (product + ((uint64_t)1U << 61U)) >> 62U;
        const uint64_t fraction = product - (quarters << 62U);
        const uint64_t is_below = fraction >> 63U;
        const uint64_t distance = (is_below != 0U) ? ((uint64_t)0U - fraction) : fraction;
        /* Times pi/2, with 32 bits of each: 24 bits for r, the next 32 for its tail. */
        const uint32_t zeros = leading_zeros(distance);
        const uint64_t rest = ((distance << zeros) >> 32U) * 0xc90fdaa2U;
        const real way = (angle < 0.0F) ? -1.0F : 1.0F;
        const real side = (is_below != 0U) ? -way : way;
        const uint64_t turned = (quarters + 1U) & 3U;
        float_bits unit;
        unit.bits = (106U - zeros) << 23U;
        *turns = ((real)turned - 1.0F) * way;
        *r = (real)(uint32_t)(rest >> 40U) * unit.number * side;
        *tail = (real)(uint32_t)((rest >> 8U) & 0xffffffffU) * (unit.number * 2.3283064e-10F) * side;
    }
}

/* Quarter turns, -2 ... 2, and what is left of an angle in two parts: up to 800 products with the first two parts of pi/2
 * are exact (Cody and Waite). */
static void reduce(real angle, real *turns, real *r, real *tail)
{
    if (fabsf(angle) <= 800.0F) {
        /* Added and taken away again, they leave the nearest whole number, and the nearest multiple of four. */
        const real whole = 12582912.0F;
        const real fours = 50331648.0F;
        const real quarters = ((angle * 0.63661977236758134308F) + whole) - whole;
        const real near = angle - (quarters * 1.57080078125F);
        const real part = quarters * -4.4545158743858337402e-6F;
        *r = near - part;
        *tail = ((near - *r) - part) - (quarters * 6.0771006282767103812e-11F);
        *turns = quarters - ((quarters + fours) - fours);
    } else {
        reduce_by_integers(angle, turns, r, tail);
    }
}

#else

/* sin r = r + r^3 * (...), cos r = 1 - r^2/2 + r^4 * (...) for |r| <= pi/4 (Sun's fdlibm). */
static real sine_series(real z)
{
    const real square = z * z;
    const real last = -2.50507602534068634195e-08 + (z * 1.58969099521155010221e-10);
    const real middle = (-1.98412698298579493134e-04 + (z * 2.75573137070700676789e-06)) + (square * last);
    return (-1.66666666666666324348e-01 + (z * 8.33333333332248946124e-03)) + (square * middle);
}

static real cosine_series(real z)
{
    const real square = z * z;
    const real last = 2.08757232129817482790e-09 + (z * -1.13596475577881948265e-11);
    const real middle = (2.48015872894767294178e-05 + (z * -2.75573143513906633035e-07)) + (square * last);
    return (4.16666666666666019037e-02 + (z * -1.38888888888741095749e-03)) + (square * middle);
}

/* Quarter turns, -2 ... 2, and what is left of an angle up to 1e5 in two parts: products with the first two parts of pi/2
 * are exact (Cody and Waite). */
static void reduce(real angle, real *turns, real *r, real *tail)
{
    /* Added and taken away again, they leave the nearest whole number, and the nearest multiple of four. */
    const real whole = 6755399441055744.0;
    const real fours = 27021597764222976.0;
    const real quarters = ((angle * 0.63661977236758134308) + whole) - whole;
    const real near = angle - (quarters * 1.5707963267923333);
    const real part = quarters * 2.5633441515839558e-12;
    *r = near - part;
    *tail = ((near - *r) - part) - (quarters * 1.0562999066987428e-23);
    *turns = quarters - ((quarters + fours) - fours);
}

#endif

static void sin_cos(real angle, real *sine, real *cosine)
{
    const real one = (real)1.0;
    real turns;
    real r;
    real tail;
    reduce(angle, &turns, &r, &tail);
    {
        const real z = r * r;
        const real half = (real)0.5 * z;
        const real near = one - half;
        const real s = r + ((tail * near) + ((z * r) * sine_series(z)));
        const real c = near + (((one - near) - half) + (((z * z) * cosine_series(z)) - (r * tail)));
        /* Products and sums with whole quarter turns are exact. */
        const real along = one - ((turns < (real)0.0) ? -turns : turns);
        const real across = turns + (turns * along);
        *sine = (s * along) + (c * across);
        *cosine = (c * along) - (s * across);
    }
#ifndef NAME_FLOAT
    /* The machine's own; also in Rust. */
    if (fabs(angle) > 1e5) {
        *sine = sin(angle);
        *cosine = cos(angle);
    }
#endif
}
