
static void NAME_forget_row_MEMBER(NAME_learner_MEMBER *learner)
{
    size_t i;
    for (i = 0; i < TERMS; ++i) {
        learner->phi[i] = 0;
    }
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        learner->z[i] = 0;
    }
    learner->increments = 0;
}

/* Learning of member MEMBER from the newest sample; measured is the number of samples up to it without a missing value. */
static int NAME_learn_MEMBER(NAME_learner_MEMBER *learner, const REAL *x, REAL *weights, uint32_t measured)
{
    REAL increment[TERMS + UPPER_OUTPUTS];
    REAL f[TERMS];
    REAL gain[TERMS];
    REAL e[UPPER_OUTPUTS];
    REAL leverage[UPPER_OUTPUTS];
    REAL variance;
    REAL weight;
    size_t i;
    if (measured < NEEDED) {
        NAME_forget_row_MEMBER(learner);
        return UPPER_WAITING;
    }
    if ((measured - NEEDED) % STRIDE != 0U) {
        return UPPER_WAITING;
    }
    INCREMENT(x, increment);
    for (i = 0; i < TERMS; ++i) {
        learner->phi[i] += increment[i];
    }
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        learner->z[i] += increment[TERMS + i] / CLOCK;
    }
    ++learner->increments;
    if (learner->increments < ROW) {
        return UPPER_WAITING;
    }
    for (i = 0; i < TERMS; ++i) {
        learner->phi[i] *= SHARE;
    }
    for (i = 0; i < UPPER_OUTPUTS; ++i) {
        learner->z[i] *= SHARE;
    }
    weight = 0;
    if (NAME_finite(learner->phi, TERMS) && NAME_finite(learner->z, UPPER_OUTPUTS)) {
        variance = NAME_project(learner->u, learner->d, learner->phi, f, TERMS);
        for (i = 0; i < UPPER_OUTPUTS; ++i) {
            e[i] = learner->z[i] - NAME_expected(learner->phi, weights + i * TERMS, NAME_scale_MEMBER, TERMS);
            leverage[i] = variance;
        }
        weight = NAME_judge(&learner->noise, e, leverage, LONGEST, RATE);
    }
    if (weight > 0) {
        NAME_absorb(learner->u, learner->d, f, gain, (REAL)1 / (weight * AVERAGING), TERMS);
        for (i = 0; i < UPPER_OUTPUTS; ++i) {
            NAME_correct(weights + i * TERMS, gain, NAME_scale_MEMBER, e[i], TERMS);
        }
    }
    NAME_forget_row_MEMBER(learner);
    return (weight > 0) ? UPPER_LEARNED : UPPER_REJECTED;
}
