
/* ---- the law: it holds the flow at a reference with an on/off valve ---- */

static struct {
    struct model model;      /* in the estimated present state */
    real predictions[LAW_LEAD + 1u]; /* of the flow, LAW_LEAD samples ahead */
    uint32_t newest;
    real bias, missed, integral, share, learned, reference;
    uint32_t age, lost, since, switches, air;
    int on, begun;
} law;

static struct model ahead; /* the same, for the prediction */

static uint32_t add(uint32_t x, uint32_t y) { return x > UINT32_MAX - y ? UINT32_MAX : x + y; }

static uint32_t take(uint32_t x, uint32_t y) { return x > y ? x - y : 0u; }

static uint32_t lesser(uint32_t x, uint32_t y) { return x < y ? x : y; }

static real limited(real x, real limit) { return at_least(at_most(x, limit), -limit); }

void law_reset(void)
{
    static const struct model at_rest_model;
    uint32_t i;
    law.model = at_rest_model;
    at_rest(&law.model);
    for (i = 0u; i <= LAW_LEAD; i++) {
        law.predictions[i] = ZERO;
    }
    law.newest = 0u;
    law.bias = ZERO;
    law.missed = ZERO;
    law.integral = ZERO;
    law.share = ONE;
    law.learned = ZERO;
    law.reference = ZERO;
    law.age = 0u;
    law.lost = 0u;
    law.since = UINT32_MAX;
    law.switches = LAW_SWITCHES_CAPACITY;
    law.air = LAW_AIR_CAPACITY;
    law.on = 0;
    law.begun = 1;
}

struct look {
    real foreseen, at_lead;
    uint32_t delay;
};

/* Predicts the flow with the valve at `on` from now, until the anticipation after the arrival of `on`. */
static struct look look_ahead(int on, const real *channels)
{
    struct look look;
    const uint32_t halves = on != 0 ? LAW_HALF_SAMPLES_ON : LAW_HALF_SAMPLES_OFF;
    const uint32_t valve = on != 0 ? LAW_OPENING : LAW_CLOSING;
    const uint32_t near = valve + halves / 2u;
    const uint32_t far = valve + (halves + 1u) / 2u;
    uint32_t i, arrived_for = 0u;
    int arrived = 0, enough = 0;
    ahead = law.model;
    look.foreseen = back(ahead.y, OUTPUTS, ahead.y_newest, 0u);
    look.at_lead = look.foreseen;
    look.delay = 0u;
    for (i = 0u; i < LAW_LOOK_AHEAD && enough == 0; i++) {
        const struct seen seen = observe(&ahead, on != 0 ? ONE : ZERO, channels, 1);
        arrived = arrived != 0 || seen.nearest <= i;
        foresee(&ahead, seen.flow, seen.next);
        if (i + 1u == LAW_LEAD) {
            look.at_lead = seen.next;
        }
        if (arrived == 0) {
            look.foreseen = seen.next;
            look.delay = i + 1u;
        } else {
            arrived_for += 1u;
            if (arrived_for <= near) {
                look.foreseen = seen.next;
            } else if (near == 0u && arrived_for == 1u) {
                look.foreseen = seen.flow;
            } else {
                /* predicted already */
            }
            enough = arrived_for >= far && i + 1u >= LAW_LEAD;
            if (enough != 0 && far > near) {
                look.foreseen = (look.foreseen + seen.next) / (ONE + ONE);
            }
        }
    }
    return look;
}

/* The wanted position, limited by the budgets of switches and air. */
static int allowed(int wanted)
{
    int yes = wanted;
    if (law.on == 0 && wanted != 0) {
        const int switches = LAW_SAMPLES_PER_SWITCH == 0u || law.switches / 2u >= LAW_SAMPLES_PER_SWITCH;
        const int air = LAW_AIR_CAPACITY == 0u || law.air >= lesser(LAW_AIR_FIRST, LAW_AIR_CAPACITY);
        yes = switches != 0 && air != 0;
    } else if (law.on != 0 && wanted != 0) {
        yes = LAW_AIR_CAPACITY == 0u || law.air >= LAW_AIR_DRAIN;
    } else {
        /* closed */
    }
    return yes;
}

static void correct(real estimate, int has_reading, real residual, real at_lead)
{
    const real law_reference = law.reference;
    real flow, error, missed, bias;
    law.newest = law.newest < LAW_LEAD ? law.newest + 1u : 0u;
    law.predictions[law.newest] = at_lead;
    law.age = add(law.age, 1u);
    if (has_reading == 0) {
        law.lost = add(law.lost, 1u);
        return;
    }
    law.lost = 0u;
    if (law.age <= LAW_LEAD) {
        return;
    }
    flow = estimate + residual;
    /* The oldest one is overwritten by the next. */
    missed = flow - law.predictions[law.newest < LAW_LEAD ? law.newest + 1u : 0u];
    if (law_reference != law.learned) {
        law.learned = law_reference;
        law.share = ONE;
    }
    error = law_reference - flow;
    {
        const real integral_rate = law.share * LAW_INTEGRAL_RATE;
        law.missed = limited(law.missed + LAW_BIAS_RATE * (missed - law.missed), LAW_CORRECTION_LIMIT);
        bias = at_most(at_least(law.bias, law.missed - LAW_PLAY), law.missed + LAW_PLAY);
        if (bias != law.bias) {
            law.bias = bias;
            law.share = ONE;
        }
        if (!(law.since >= 4u * LAW_LEAD && (error > ZERO) == (law.on != 0))) {
            const real integral = law.integral + integral_rate * error;
            law.integral = limited(integral, LAW_CORRECTION_LIMIT);
            law.share = law.share - LAW_INTEGRAL_RATE * (law.share * law.share - LAW_SETTLED * LAW_SETTLED);
        }
    }
}

struct law_decision law_step(real reading, const real *channels)
{
    struct law_decision decision;
    struct look look;
    struct seen seen;
    real target, next;
    int may_switch, wanted, was_on, looks, has_reading;
    if (law.begun == 0) {
        law_reset();
    }
    looks = law.age > 0u;
    was_on = law.on;
    if (LAW_SLOPE > ZERO) {
        law.reference = at_least(at_most(LAW_REFERENCE, law.reference + LAW_SLOPE), law.reference - LAW_SLOPE);
    } else {
        law.reference = LAW_REFERENCE;
    }
    target = law.reference + law.integral - law.bias;
    may_switch = law.since >= (was_on != 0 ? LAW_HOLD_ON : LAW_HOLD_OFF);
    if (looks != 0) {
        look = look_ahead((was_on != 0) != (may_switch != 0), channels);
    } else {
        look.foreseen = back(law.model.y, OUTPUTS, law.model.y_newest, 0u);
        look.at_lead = look.foreseen;
        look.delay = 0u;
    }
    if (may_switch == 0 || looks == 0) {
        wanted = was_on;
    } else if (was_on != 0) {
        wanted = look.foreseen <= target;
    } else {
        wanted = look.foreseen < target;
    }
    wanted = allowed(wanted);
    if (wanted != law.on && may_switch != 0) {
        law.on = wanted;
        law.since = 1u;
    } else {
        law.since = add(law.since, 1u);
    }
    if (LAW_SAMPLES_PER_SWITCH > 0u) {
        const uint32_t spent = was_on == law.on ? 0u : LAW_SAMPLES_PER_SWITCH;
        law.switches = take(lesser(add(law.switches, 1u), LAW_SWITCHES_CAPACITY), spent);
    }
    if (LAW_AIR_CAPACITY > 0u) {
        if (law.on != 0) {
            law.air = take(law.air, LAW_AIR_DRAIN);
        } else {
            law.air = lesser(add(law.air, LAW_AIR_PER_MILLE), LAW_AIR_CAPACITY);
        }
    }
    seen = observe(&law.model, law.on != 0 ? ONE : ZERO, channels, 0);
    /* NaN, or far out of range: counts as missing. */
    has_reading = reading < REAL_MAX && reading > -REAL_MAX;
    decision.residual = has_reading != 0 ? limited(reading - seen.measured, LAW_RESIDUAL_LIMIT) : ZERO;
    correct(seen.flow, has_reading, decision.residual, look.at_lead);
    next = seen.next + LAW_OBSERVER * decision.residual;
    advance(&law.model, next);
    decision.on = law.on;
    decision.reference = law.reference;
    decision.foreseen = look.foreseen + law.bias - law.integral;
    decision.delay = look.delay;
    decision.estimate = seen.flow;
    decision.bias = law.bias;
    decision.lost = law.lost;
    return decision;
}
