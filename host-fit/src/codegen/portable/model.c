@if channels

const char *const model_channels[MODEL_CHANNELS] = { @channel_names@ };
static const real USUAL[MODEL_CHANNELS] = { @usual@ }; /* used if no channels are given */
@end

struct model {
    real y[2u * OUTPUTS]; /* flow states, each stored twice */
    uint32_t y_newest;
    real jets[2u * JETS];
    uint32_t jets_newest;
    @if average
    real sum, sum_low, fresh, fresh_low; /* sums over the window, each in two words */
    uint32_t in_block;
    @end
    @if clocked
    uint32_t lived, since_edge;
    real last_command;
    @end
    @memories@
};

/* All signals are 0 before the first sample. */
static void at_rest(struct model *s)
{
    static const struct model zero;
    *s = zero;
    @if clocked
    s->since_edge = 16777216u;
    @end
    @starts@
}
@if graded

/* The weight of the attached flow's rate. */
@if switched
static real share_of(real jet)
{
    const real half = ONE / (ONE + ONE);
    return at_most(at_least(half + (jet - half) * (real)50.0, ZERO), ONE);
}
@else
static real share_of(real jet) { return jet; }
@end

/* The flow at the next sample. Lags of at least `horizon` are summed first. */
static real next_flow(const struct model *s, const real *jets, uint32_t horizon)
{
    const real jet = jets[0];
    const real share = share_of(jet);
    real known = ZERO, known_gain = ZERO, free, past, gain = ZERO, past_gain, separated, attached;
    uint32_t i;
    for (i = 0u; i < N1; i++) {
        if (STATE_BACK[i] >= horizon) {
            known = known + A[i] * back(s->y, OUTPUTS, s->y_newest, STATE_BACK[i]);
        }
    }
    for (i = 0u; i < N2; i++) {
        if (PRODUCT_BACK[i] >= horizon) {
            known_gain = known_gain + C[0][i] * back(s->y, OUTPUTS, s->y_newest, PRODUCT_BACK[i]);
        }
    }
    free = CONSTANT;
    past = known;
    for (i = 0u; i < N1; i++) {
        if (STATE_BACK[i] < horizon) {
            const real term = A[i] * back(s->y, OUTPUTS, s->y_newest, STATE_BACK[i]);
            if (STATE_BACK[i] < ORDER) {
                free = free + term;
            } else {
                past = past + term;
            }
        }
    }
    past_gain = known_gain;
    for (i = 0u; i < N2; i++) {
        if (PRODUCT_BACK[i] < horizon) {
            const real term = C[0][i] * back(s->y, OUTPUTS, s->y_newest, PRODUCT_BACK[i]);
            if (PRODUCT_BACK[i] < ORDER) {
                gain = gain + term;
            } else {
                past_gain = past_gain + term;
            }
        }
    }
    if (jet == ZERO) {
        return free + past;
    }
    if (ORDER == UINT32_MAX) {
        free = free + past;
        gain = gain + past_gain;
        past = ZERO;
        past_gain = ZERO;
    }
    separated = past == ZERO ? ZERO : (ONE - jet) * past / RATE_OFF;
    attached = jet * (B[0] + past + past_gain) / RATE_ON;
    return free + gain * share + (RATE_OFF + (RATE_ON - RATE_OFF) * share) * (separated + attached);
}
@else
@if track

/* The flow at the next sample. Lags of at least `horizon` are summed first. */
static real next_flow(const struct model *s, const real *jets, uint32_t horizon)
{
    real next = CONSTANT;
    uint32_t i, l;
    real known = ZERO, known_gain = ZERO;
    if (horizon < UINT32_MAX) {
        for (i = 0u; i < N1; i++) {
            if (STATE_BACK[i] >= horizon) {
                known = known + A[i] * back(s->y, OUTPUTS, s->y_newest, STATE_BACK[i]);
            }
        }
        for (i = 0u; i < N2; i++) {
            if (PRODUCT_BACK[i] >= horizon) {
                known_gain = known_gain + C[0][i] * back(s->y, OUTPUTS, s->y_newest, PRODUCT_BACK[i]);
            }
        }
    }
    next = next + known;
    for (i = 0u; i < N1; i++) {
        if (STATE_BACK[i] < horizon) {
            next = next + A[i] * back(s->y, OUTPUTS, s->y_newest, STATE_BACK[i]);
        }
    }
    for (l = 0u; l < N3; l++) {
        if (jets[l] != ZERO) {
            const uint32_t nearer = l == 0u ? horizon : UINT32_MAX;
            real gain = l == 0u ? B[l] + known_gain : B[l];
            for (i = 0u; i < N2; i++) {
                if (PRODUCT_BACK[i] < nearer) {
                    gain = gain + C[l][i] * back(s->y, OUTPUTS, s->y_newest, PRODUCT_BACK[i]);
                }
            }
            next = next + gain * jets[l];
        }
    }
    return next;
}
@else

/* The flow at the next sample. */
static real next_flow(const struct model *s, const real *jets, uint32_t horizon)
{
    real next = CONSTANT;
    uint32_t i, l;
    (void)horizon;
    for (i = 0u; i < N1; i++) {
        next = next + A[i] * back(s->y, OUTPUTS, s->y_newest, STATE_BACK[i]);
    }
    for (l = 0u; l < N3; l++) {
        if (jets[l] != ZERO) {
            real gain = B[l];
            for (i = 0u; i < N2; i++) {
                gain = gain + C[l][i] * back(s->y, OUTPUTS, s->y_newest, PRODUCT_BACK[i]);
            }
            next = next + gain * jets[l];
        }
    }
    return next;
}
@end
@end
@if average

static void add_to(real *high, real *low, real term)
{
    const real sum = *high + term;
    const real part = sum - *high;
    *low = *low + ((*high - (sum - part)) + (term - part));
    *high = sum;
}

/* Advances the window of the average by a sample. The sum of every block is computed anew, so it does not drift. */
static void slide(struct model *s, real entering, real leaving)
{
    add_to(&s->fresh, &s->fresh_low, entering);
    s->in_block += 1u;
    if (s->in_block >= WINDOW - 1u) {
        s->sum = s->fresh;
        s->sum_low = s->fresh_low;
        s->fresh = ZERO;
        s->fresh_low = ZERO;
        s->in_block = 0u;
    } else {
        add_to(&s->sum, &s->sum_low, entering);
        add_to(&s->sum, &s->sum_low, -leaving);
    }
}
@end
@if averaged

/* The mean of a window of jets, the newest of them `lag` samples back, eq. (13). */
static real mean_jet(const struct model *s, uint32_t lag)
{
    real sum = ZERO;
    uint32_t i;
    for (i = 0u; i < WINDOW; i++) {
        sum = sum + back(s->jets, JETS, s->jets_newest, lag + i);
    }
    return sum / (real)WINDOW;
}
@end

struct seen {
    real measured;     /* the sensor's reading */
    real flow;         /* the flow now */
    real next;         /* the flow at the next sample */
    uint32_t nearest;  /* the shortest input delay, samples */
};

/* Computes one sample without advancing the flow. If the law `looks` ahead, the sensor is not evaluated. */
static struct seen observe(struct model *s, real u, const real *channels, int looks)
{
    struct seen seen;
    const real y = back(s->y, OUTPUTS, s->y_newest, 0u);
    real jet = u, arriving[N3], arrived, present = ZERO;
    const uint32_t horizon = looks != 0 ? @near@u : UINT32_MAX;
    uint32_t l;
    (void)channels;
    @if clocked
    s->lived = s->lived < UINT32_MAX ? s->lived + 1u : s->lived;
    s->since_edge = u != s->last_command ? 0u : (s->since_edge < 16777216u ? s->since_edge + 1u : s->since_edge);
    s->last_command = u;
    @end
    seen.nearest = UINT32_MAX;
    @command@
    @jet_effects@
    push(s->jets, JETS, &s->jets_newest, jet);
    {
        @if transport
        @if average
        /* The mean of the preceding flow states, eq. (1). */
        @end
        @delay@
        @end
        for (l = 0u; l < N3; l++) {
            @if transport
            @if rounded
            uint32_t whole = rounded(FACTORS[l] * delay);
            @else
            const real exact = at_least(FACTORS[l] * delay, ZERO);
            uint32_t whole = below(exact);
            const real fraction = exact - (real)whole;
            real older;
            @end
            @else
            uint32_t whole = DELAYS[l];
            @end
            if (whole > JETS - 2u) {
                whole = JETS - 2u;
            }
            if (whole < seen.nearest) {
                seen.nearest = whole;
            }
            @if averaged
            arriving[l] = mean_jet(s, whole);
            @else
            arriving[l] = back(s->jets, JETS, s->jets_newest, whole);
            @end
            @if interpolated
            @if averaged
            older = fraction != ZERO ? mean_jet(s, whole + 1u) : arriving[l];
            @else
            older = fraction != ZERO ? back(s->jets, JETS, s->jets_newest, whole + 1u) : arriving[l];
            @end
            if (l == 0u) {
                present = older;
            }
            if (fraction != ZERO) {
                arriving[l] = arriving[l] + fraction * (older - arriving[l]);
            }
            @else
            @if shows_present
            if (l == 0u) {
                present = arriving[0];
            }
            @end
            @end
        }
    }
    arrived = arriving[0];
    (void)arrived;
    (void)present;
    seen.flow = y;
    seen.measured = y;
    if (looks == 0) {
        @sensor_effects@
    }
    seen.next = next_flow(s, arriving, horizon);
    @if drives
    { /* effects of the flow: each uses the motion with the preceding effects */
        static const real NO_JETS[N3] = { ZERO };
        const real before = back(s->y, OUTPUTS, s->y_newest, 1u);
        const real part = @share@;
        const real relaxation = RATE_OFF + (RATE_ON - RATE_OFF) * part;
        const real separated = (part == ZERO || part == ONE || relaxation == ZERO) ? ONE - part : (ONE - part) * RATE_OFF / relaxation;
        @if proportional
        const real motion = arrived != ZERO && arrived != ONE ? (ONE - arrived) * (next_flow(s, NO_JETS, horizon) - y) : separated * (seen.next - y);
        @else
        const real motion = separated * (seen.next - y);
        @end
        real sum = ZERO;
        (void)NO_JETS;
        (void)before;
        (void)motion;
        @for flow_effects
        {
            const real next_y = seen.next + sum;
            const real released = motion + separated * sum;
            (void)next_y;
            (void)released;
            @effect@
        }
        @end
        seen.next = seen.next + sum;
    }
    @end
    return seen;
}

/* Stores `flow` as the newest flow state. */
static void advance(struct model *s, real flow)
{
    @if average
    slide(s, back(s->y, OUTPUTS, s->y_newest, 0u), back(s->y, OUTPUTS, s->y_newest, WINDOW - 1u));
    @end
    push(s->y, OUTPUTS, &s->y_newest, flow);
}
@if track

/* Stores a flow state that the law predicts, with a less accurate average. */
static void foresee(struct model *s, real flow, real next)
{
    @if average
    s->sum_low = s->sum_low + (flow - back(s->y, OUTPUTS, s->y_newest, WINDOW - 1u));
    @else
    (void)flow;
    @end
    push(s->y, OUTPUTS, &s->y_newest, next);
}
@end

static struct model the_model;
static int begun;

/* Restarts at the first sample; all signals before it are 0. */
void model_reset(void)
{
    at_rest(&the_model);
    begun = 1;
}

/* Restarts with a constant command and reading before the first sample. */
void model_hold(real command, real reading, const real *channels)
{
    uint32_t i;
    model_reset();
    for (i = 0u; i < HELD; i++) {
        advance(&the_model, reading - SENSOR_ZERO);
        (void)observe(&the_model, @jet@, channels != NULL ? channels : @usual_channels@, 0);
    }
    advance(&the_model, reading - SENSOR_ZERO);
}

/* Returns the reading at this sample and advances the model; the command@range@ holds until the next sample. */
real model_step(real command, const real *channels)
{
    struct seen seen;
    if (begun == 0) {
        model_reset();
    }
    seen = observe(&the_model, @jet@, channels != NULL ? channels : @usual_channels@, 0);
    advance(&the_model, seen.next);
    return seen.measured;
}
@if track

/* Times in samples. */
@law_constants@
#define REAL_MAX @real_max@
@end
@if maximise

/* Times in samples. */
#define LAW_PERIOD @law_period@u
#define LAW_PULSES @law_pulses@u
#define LAW_HOLD_ON @law_on@u
#define LAW_HOLD_OFF @law_off@u
static const uint32_t LAW_FIRST[LAW_PULSES] = { @law_first@ };
static const uint32_t LAW_LENGTH[LAW_PULSES] = { @law_length@ };
@end
