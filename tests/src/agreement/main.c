/* Plays test vectors through an exported model: main COMMANDS READINGS. Prints four lists, each after a `=`: readings
 * from rest, readings from another initial state, the law's estimates, its decisions. On a board a fifth: the
 * instructions of a sample. `case.h` says what is played. */
#include "model.c"
#include "case.h"
#include <stdio.h>

#ifdef BOARD
/* SysTick, 25 MHz: under `-icount shift=5` a tick is 1.25 instructions. */
static volatile uint32_t *const systick = (volatile uint32_t *)0xE000E010u;
static double ticks, samples;

static uint32_t now(void) { return systick[2]; }

static uint32_t since(uint32_t before) { return (before - now()) & 0xFFFFFFu; }
#endif

static real played(real command, const real *channels)
{
#ifdef BOARD
    const uint32_t none = since(now()), before = now();
    const real reading = model_step(command, channels);
    ticks += since(before) - none;
    samples += 1.0;
    return reading;
#else
    return model_step(command, channels);
#endif
}

static void run(const char *commands, int held)
{
    FILE *file = fopen(commands, "r");
    double row[WIDTH];
    real channels[WIDTH];
    int begun = 0;
    printf("=\n");
    for (;;) {
        int n;
        for (n = 0; n < WIDTH && fscanf(file, "%lf", &row[n]) == 1; n++) {
            channels[n > 0 ? n - 1 : 0] = (real)row[n];
        }
        if (n < WIDTH) {
            break;
        }
        if (begun == 0 && held != 0) {
            model_hold(U_BEFORE, Y_BEFORE, channels);
        } else if (begun == 0) {
            model_reset();
        }
        begun = 1;
        printf("%.17g\n", (double)played((real)row[0], WIDTH > 1 ? channels : NULL));
    }
    fclose(file);
}

#ifdef TRACKS
static void decide(const char *readings, int estimates)
{
    FILE *file = fopen(readings, "r");
    double reading;
    printf("=\n");
    law_reset();
    while (fscanf(file, "%lf", &reading) == 1) {
        const struct law_decision said = law_step((real)reading, NULL);
        printf("%.17g\n", estimates != 0 ? (double)said.estimate : (double)said.on);
    }
    fclose(file);
}
#endif

#ifdef PULSES
static void decide(int estimates)
{
    int i;
    printf("=\n");
    law_reset();
    for (i = 0; i < PULSES; i++) {
        printf("%d\n", estimates != 0 ? 0 : law_step());
    }
}
#endif

int main(int argc, char **argv)
{
    if (argc < 3) {
        return 2;
    }
#ifdef BOARD
    systick[1] = 0xFFFFFFu;
    systick[2] = 0u;
    systick[0] = 5u;
#endif
    run(argv[1], 0);
    run(argv[1], 1);
#if defined(TRACKS)
    decide(argv[2], 1);
    decide(argv[2], 0);
#elif defined(PULSES)
    decide(1);
    decide(0);
#else
    printf("=\n=\n");
#endif
#ifdef BOARD
    printf("=\n%.17g\n", 1.25 * ticks / samples);
#endif
    return 0;
}
