/* An FMU for co-simulation, FMI 3.0, around the C that `host-fit codegen --lang c --precision double` writes: flow.c, beside
 * this file. make_fmu.py makes the archive.
 *
 * y at a communication point is the reading for the inputs that are set there. A step is a whole number of sample periods,
 * during which the inputs are constant. A run begins at rest.
 */
#include "flow.c"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

#ifndef MODEL_CHANNELS
#define MODEL_CHANNELS 0u
#endif

/* Value references: time, u, the channels, y. */
#define T 0u
#define U 1u
#define FIRST 2u
#define Y (FIRST + MODEL_CHANNELS)

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status;
typedef void (*Log)(void *environment, Status status, const char *category, const char *message);

/* The state of a run. */
struct progress {
    struct model model;
    double inputs[FIRST + MODEL_CHANNELS]; /* by value reference; the first is not used */
    double start;                          /* s */
    uint64_t samples;
};

struct instance {
    struct progress now;
    void *environment;
    Log log;
};

static Status refuse(const struct instance *i, const char *why)
{
    if (i != NULL && i->log != NULL) {
        i->log(i->environment, ERROR, "logStatusError", why);
    }
    return ERROR;
}

/* Returns the reading at this sample and advances the model of `p`. */
static double moved_on(struct progress *p)
{
    double reading;
    the_model = p->model;
    begun = 1;
    reading = model_step(p->inputs[U], MODEL_CHANNELS > 0u ? p->inputs + FIRST : NULL);
    p->model = the_model;
    return reading;
}

static double reading(const struct progress *p)
{
    struct progress copy = *p;
    return moved_on(&copy);
}

static void at_start(struct instance *i)
{
    memset(&i->now, 0, sizeof i->now);
    model_reset();
    i->now.model = the_model;
    i->now.inputs[U] = OFF;
#if MODEL_CHANNELS > 0
    memcpy(i->now.inputs + FIRST, USUAL, sizeof USUAL);
#endif
}

/* For make_fmu.py. */
EXPORT double describe_period(void) { return PERIOD; }
EXPORT unsigned describe_channels(void) { return MODEL_CHANNELS; }
#if MODEL_CHANNELS > 0
EXPORT const char *describe_channel(unsigned n) { return model_channels[n]; }
EXPORT double describe_usual(unsigned n) { return USUAL[n]; }
#endif

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT Status fmi3SetDebugLogging(struct instance *i, bool on, size_t n, const char *const categories[])
{
    return OK;
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
    bool events, bool early, const uint32_t intermediate[], size_t n, void *environment, Log log, void *update)
{
    struct instance *i = calloc(1, sizeof *i);
    if (i == NULL) {
        return NULL;
    }
    i->environment = environment;
    i->log = log;
    if (token == NULL || strcmp(token, TOKEN) != 0) {
        (void)refuse(i, "the instantiation token is that of another FMU");
        free(i);
        return NULL;
    }
    at_start(i);
    return i;
}

EXPORT void fmi3FreeInstance(struct instance *i) { free(i); }

EXPORT Status fmi3EnterInitializationMode(struct instance *i, bool tolerant, double tolerance, double start, bool ends, double stop)
{
    i->now.start = start;
    return OK;
}

EXPORT Status fmi3ExitInitializationMode(struct instance *i) { return OK; }
EXPORT Status fmi3Terminate(struct instance *i) { return OK; }
EXPORT Status fmi3Reset(struct instance *i) { at_start(i); return OK; }

static double now(const struct progress *p) { return p->start + (double)p->samples * PERIOD; }

EXPORT Status fmi3GetFloat64(struct instance *i, const uint32_t references[], size_t n, double values[], size_t n_values)
{
    size_t k;
    if (n != n_values) {
        return refuse(i, "every variable has one value");
    }
    for (k = 0; k < n; k++) {
        if (references[k] == T) {
            values[k] = now(&i->now);
        } else if (references[k] < Y) {
            values[k] = i->now.inputs[references[k]];
        } else if (references[k] == Y) {
            values[k] = reading(&i->now);
        } else {
            return refuse(i, "there is no variable of this value reference");
        }
    }
    return OK;
}

EXPORT Status fmi3SetFloat64(struct instance *i, const uint32_t references[], size_t n, const double values[], size_t n_values)
{
    size_t k;
    if (n != n_values) {
        return refuse(i, "every variable has one value");
    }
    for (k = 0; k < n; k++) {
        if (references[k] == T || references[k] >= Y) {
            return refuse(i, "only u and the channels can be set");
        }
        i->now.inputs[references[k]] = values[k];
    }
    return OK;
}

EXPORT Status fmi3EnterStepMode(struct instance *i) { return OK; }

EXPORT Status fmi3DoStep(struct instance *i, double point, double size, bool final, bool *event, bool *terminate, bool *early,
    double *last)
{
    const double periods = size / PERIOD;
    const double whole = floor(periods + 0.5);
    double k;
    *event = *terminate = *early = false;
    *last = now(&i->now);
    if (!(whole >= 1.0 && fabs(periods - whole) <= 1e-6 * whole)) {
        return refuse(i, "a communication step has to be a whole number of sample periods");
    }
    for (k = 0.0; k < whole; k += 1.0) {
        (void)moved_on(&i->now);
        i->now.samples++;
    }
    *last = now(&i->now);
    return OK;
}

EXPORT Status fmi3GetFMUState(struct instance *i, void **state)
{
    if (*state == NULL) {
        *state = malloc(sizeof i->now);
    }
    if (*state == NULL) {
        return refuse(i, "there is no memory for a state");
    }
    memcpy(*state, &i->now, sizeof i->now);
    return OK;
}

EXPORT Status fmi3SetFMUState(struct instance *i, const void *state)
{
    memcpy(&i->now, state, sizeof i->now);
    return OK;
}

EXPORT Status fmi3FreeFMUState(struct instance *i, void **state)
{
    free(*state);
    *state = NULL;
    return OK;
}

EXPORT Status fmi3SerializedFMUStateSize(struct instance *i, void *state, size_t *size)
{
    *size = sizeof i->now;
    return OK;
}

EXPORT Status fmi3SerializeFMUState(struct instance *i, const void *state, uint8_t bytes[], size_t size)
{
    if (size != sizeof i->now) {
        return refuse(i, "a state has another size");
    }
    memcpy(bytes, state, size);
    return OK;
}

EXPORT Status fmi3DeserializeFMUState(struct instance *i, const uint8_t bytes[], size_t size, void **state)
{
    if (size != sizeof i->now) {
        return refuse(i, "a state has another size");
    }
    if (*state == NULL) {
        *state = malloc(size);
    }
    if (*state == NULL) {
        return refuse(i, "there is no memory for a state");
    }
    memcpy(*state, bytes, size);
    return OK;
}

/* Functions of the standard that this FMU does not provide: other types, clocks, derivatives, other interfaces. */
#define NONE(type, get)                                                                                                     \
    EXPORT Status fmi3Get##type(struct instance *i, const uint32_t r[], size_t n, get v[], size_t m)                        \
    {                                                                                                                       \
        return n == 0 ? OK : refuse(i, "there are no variables of type " #type);                                            \
    }                                                                                                                       \
    EXPORT Status fmi3Set##type(struct instance *i, const uint32_t r[], size_t n, const get v[], size_t m)                  \
    {                                                                                                                       \
        return n == 0 ? OK : refuse(i, "there are no variables of type " #type);                                            \
    }
NONE(Float32, float)
NONE(Int8, int8_t)
NONE(UInt8, uint8_t)
NONE(Int16, int16_t)
NONE(UInt16, uint16_t)
NONE(Int32, int32_t)
NONE(UInt32, uint32_t)
NONE(Int64, int64_t)
NONE(UInt64, uint64_t)
NONE(Boolean, bool)
typedef const char *String;
NONE(String, String)

#define NOT(name, ...)                                                                                                      \
    EXPORT Status fmi3##name(struct instance *i, __VA_ARGS__) { return refuse(i, "fmi3" #name " is not provided"); }
#define NOR(name)                                                                                                           \
    EXPORT Status fmi3##name(struct instance *i) { return refuse(i, "fmi3" #name " is not provided"); }
typedef const uint32_t *R;
typedef const uint8_t *Binary;
NOT(GetBinary, R r, size_t n, size_t s[], Binary v[], size_t m)
NOT(SetBinary, R r, size_t n, const size_t s[], const Binary v[], size_t m)
NOT(GetClock, R r, size_t n, bool v[])
NOT(SetClock, R r, size_t n, const bool v[])
NOT(GetNumberOfVariableDependencies, uint32_t r, size_t *n)
NOT(GetVariableDependencies, uint32_t r, size_t d[], uint32_t in[], size_t e[], int kinds[], size_t n)
NOT(GetDirectionalDerivative, R o, size_t n, R k, size_t m, const double s[], size_t p, double v[], size_t q)
NOT(GetAdjointDerivative, R o, size_t n, R k, size_t m, const double s[], size_t p, double v[], size_t q)
NOT(GetOutputDerivatives, R r, size_t n, const int32_t orders[], double v[], size_t m)
NOT(GetIntervalDecimal, R r, size_t n, double v[], int q[])
NOT(GetIntervalFraction, R r, size_t n, uint64_t c[], uint64_t s[], int q[])
NOT(GetShiftDecimal, R r, size_t n, double v[])
NOT(GetShiftFraction, R r, size_t n, uint64_t c[], uint64_t s[])
NOT(SetIntervalDecimal, R r, size_t n, const double v[])
NOT(SetIntervalFraction, R r, size_t n, const uint64_t c[], const uint64_t s[])
NOT(SetShiftDecimal, R r, size_t n, const double v[])
NOT(SetShiftFraction, R r, size_t n, const uint64_t c[], const uint64_t s[])
NOT(UpdateDiscreteStates, bool *a, bool *b, bool *c, bool *d, bool *e, double *t)
NOT(CompletedIntegratorStep, bool final, bool *event, bool *terminate)
NOT(SetTime, double t)
NOT(SetContinuousStates, const double x[], size_t n)
NOT(GetContinuousStateDerivatives, double x[], size_t n)
NOT(GetEventIndicators, double x[], size_t n)
NOT(GetContinuousStates, double x[], size_t n)
NOT(GetNominalsOfContinuousStates, double x[], size_t n)
NOT(GetNumberOfEventIndicators, size_t *n)
NOT(GetNumberOfContinuousStates, size_t *n)
NOT(ActivateModelPartition, uint32_t clock, double t)
NOR(EnterEventMode)
NOR(EnterConfigurationMode)
NOR(ExitConfigurationMode)
NOR(EvaluateDiscreteStates)
NOR(EnterContinuousTimeMode)

EXPORT void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible, bool logging,
    void *environment, Log log)
{
    return NULL;
}

EXPORT void *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources, bool visible,
    bool logging, void *environment, Log log, void *update, void *lock, void *unlock)
{
    return NULL;
}
