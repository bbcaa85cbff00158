/* Times a free run of an exported model of SAMPLES samples; prints the seconds and the last reading. */
#include "model.c"
#include <stdio.h>
#include <time.h>

int main(void)
{
    real last = ZERO;
    clock_t before;
    long k;
    model_reset();
    before = clock();
    for (k = 0; k < SAMPLES; k++) {
        last = model_step(k / 90 % 2 == 1 ? (real)FULL : (real)OFF, NULL);
    }
    printf("%.6f %.17g\n", (double)(clock() - before) / CLOCKS_PER_SEC, (double)last);
    return 0;
}
