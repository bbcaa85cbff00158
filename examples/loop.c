/* The exported law controls the exported model: gcc -std=c99 -ffp-contract=off loop.c -lm, with flow.c beside it. */
#include "flow.c"
#include <stdio.h>

int main(void)
{
    real command = 0.0f, mean = 0.0f;
    uint32_t k;
    for (k = 0u; k < 6000u; k++) {
        const real reading = model_step(command, NULL);
        command = law_step(reading, NULL).on != 0 ? 1.0f : 0.0f;
        if (k >= 3000u) {
            mean += reading / 3000.0f;
        }
    }
    printf("mean %.3f, reference %.3f\n", (double)mean, (double)LAW_REFERENCE);
    return 0;
}
