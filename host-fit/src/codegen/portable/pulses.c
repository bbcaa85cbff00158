
/* ---- the law: pulses in a period that repeats ---- */

static struct {
    uint32_t at, since;
    int on, begun;
} law;

void law_reset(void)
{
    law.at = 0u;
    law.since = UINT32_MAX;
    law.on = 0;
    law.begun = 1;
}

int law_step(void)
{
    uint32_t i;
    int wanted = 0;
    if (law.begun == 0) {
        law_reset();
    }
    for (i = 0u; i < LAW_PULSES; i++) {
        const uint32_t since = (law.at + LAW_PERIOD - LAW_FIRST[i] % LAW_PERIOD) % LAW_PERIOD;
        if (since < LAW_LENGTH[i]) {
            wanted = 1;
        }
    }
    law.at = law.at + 1u < LAW_PERIOD ? law.at + 1u : 0u;
    if (wanted != law.on && law.since >= (law.on != 0 ? LAW_HOLD_ON : LAW_HOLD_OFF)) {
        law.on = wanted;
        law.since = 1u;
    } else if (law.since < UINT32_MAX) {
        law.since += 1u;
    } else {
        /* a long time ago */
    }
    return law.on;
}
