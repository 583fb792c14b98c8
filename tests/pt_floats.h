/* pt_floats.h: numbers for tests of lanes. Include after pt_test.h. */

/* Numbers that are likely to meet where it hurts. */
static inline float hostile_float(pt_pcg32 *rng)
{
    static const float odd[12] = {0, -0.0f, 1, -1, 1e-38f, -1e-44f, 3.4e38f, -3.4e38f, HUGE_VALF, -HUGE_VALF, 1.5f, 0.1f};
    const unsigned k = pt_pcg32_next(rng) % 24;
    if (k < 12) return odd[k];
    if (k == 12) return HUGE_VALF - HUGE_VALF;
    return (float)((2 * pt_pcg32_double(rng) - 1) * pow(2, 60 * pt_pcg32_double(rng) - 30));
}

/* The same bits, or both are no numbers. */
static inline int same_float(float a, float b) { return memcmp(&a, &b, sizeof a) == 0 || (a != a && b != b); }
