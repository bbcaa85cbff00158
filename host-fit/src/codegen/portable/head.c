/* An identified model. Generated; edit the model file instead.
 *
@header@
 *
 * model_step takes the command of a sample, returns the sensor's reading at that sample, and advances the model.
 * Bit-identical to the host with IEEE numbers and without fused multiply-add: -std=c99 -ffp-contract=off.
 */
#include <math.h>
#include <stddef.h>
#include <stdint.h>

typedef @real@ real;

/* Declarations for your header. */
@if channels
#define MODEL_CHANNELS @channel_count@u
extern const char *const model_channels[MODEL_CHANNELS];
@end
void model_reset(void);
void model_hold(real command, real reading, const real *channels);
real model_step(real command, const real *channels);
@if track
struct law_decision {
    int on;          /* the valve until the next sample */
    real reference;  /* reference now, y */
    real foreseen;   /* predicted flow at the arrival of the decision, y */
    uint32_t delay;  /* from now to that arrival, samples */
    real estimate;   /* flow now, y */
    real residual;   /* reading minus the model's output, y */
    real bias;       /* mean error of the predictions, y */
    uint32_t lost;   /* samples without a reading */
};
void law_reset(void);
/* A reading of NaN counts as missing. */
struct law_decision law_step(real reading, const real *channels);
@end
@if maximise
void law_reset(void);
int law_step(void);
@end

#define ZERO @nought@
#define ONE @one@
#define PERIOD @period@ /* s */
#define OUTPUTS @outputs@u /* stored flow states, samples */
#define JETS @jets@u /* stored jet strengths, samples */
#define WINDOW @window@u /* length of averages, samples */
#define HELD @held@u /* samples that model_hold simulates */
#define SENSOR_ZERO @zero@ /* y */
#define N1 @n1@u
#define N2 @n2@u
#define N3 @n3@u
@if graded
#define RATE_OFF @rate_off@ /* relaxation rate of the separated flow, 1/sample */
#define RATE_ON @rate_on@ /* relaxation rate of the attached flow */
#define ORDER @order@ /* lags below this count for the relaxation rates */
@else
@if drives
#define RATE_OFF @rate_off@
#define RATE_ON @rate_on@
@end
@end

static const real CONSTANT = @constant@; /* d */
/* Lags in samples behind the newest flow, y_k, and coefficients. */
static const uint32_t STATE_BACK[@size1@] = { @state_back@ };
static const real A[@size1@] = { @a@ };
static const uint32_t PRODUCT_BACK[@size2@] = { @product_back@ };
static const real B[@n3@] = { @b@ };
static const real C[@n3@][@size2@] = {
@c@
};
@if transport
static const real FACTORS[@n3@] = { @factors@ };
@else
static const uint32_t DELAYS[@n3@] = { @delays@ }; /* samples */
@end
@cards@

@derived@

