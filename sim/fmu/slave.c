/* The interface of FMI 2.0.4 for co-simulation, in front of the kernel: valve_rest and valve_respond of valve.o.
 *
 * The generated valve.h gives GUID, PARAMETERS, STATE (sizes of theta and state), STEP_S, TOLERANCE, COULOMB, STATIC
 * and the tables START, LEAST, MOST, ABOVE_ZERO of theta. Names and types are those of the standard.
 */

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "valve.h"

#define API __attribute__((visibility("default")))

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef void (*Logger)(void *, const char *, Status, const char *, const char *, ...);

typedef struct {
    Logger log;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, Status);
    void *environment;
} Callbacks;

enum { INPUT, INDICATED, POSITION, VELOCITY, PRESSURE, FIRST_POSITION, FIRST_COMMAND, FIRST_PARAMETER };
enum { ROW_T, ROW_P, ROW_X, ROW_V, ROW_INDICATED, ROWS };
#define VARIABLES (FIRST_PARAMETER + PARAMETERS)

typedef struct {
    double values[VARIABLES];
    double state[STATE];
    double start_time;
    int initialized;
} Valve;

typedef struct {
    Valve valve;
    char *name;
    Callbacks calls;
} Instance;

/* The kernel's functions, in numba's convention: where a result and an exception would go, then the arguments, an array
 * as its address and its shape. */
int32_t valve_rest(void **, void **, double *theta, intptr_t parameters, double *state, intptr_t size, double time,
                   double position, double command);
int32_t valve_respond(void **, void **, double *theta, intptr_t parameters, double *state, intptr_t size,
                      double *command, intptr_t commands, double *period, intptr_t periods, double longest,
                      double tolerance, double *path, intptr_t rows, intptr_t columns);

/* What the kernel's text names of numba's run time and never comes to: its arrays are ours, nothing is freed. */
void NRT_MemInfo_call_dtor(void *memory) { (void)memory; }
void NRT_Free(void *memory) { (void)memory; }

static Status said(const Instance *it, Status status, const char *text, double value) {
    if (it->calls.log) it->calls.log(it->calls.environment, it->name, status, "logStatusError", text, value);
    return status;
}

static void begin(Valve *valve) {
    memset(valve, 0, sizeof *valve);
    memcpy(valve->values + FIRST_PARAMETER, START, sizeof START);
}

/* Refuse what is not physical, as a valve file would be. */
static Status check(const Instance *it) {
    const double *theta = it->valve.values + FIRST_PARAMETER;
    for (int i = 0; i < PARAMETERS; i++) {
        if (!(theta[i] >= LEAST[i] && theta[i] <= MOST[i]) || (ABOVE_ZERO[i] && theta[i] == 0.0))
            return said(it, ERROR, NAMES[i], theta[i]);
    }
    if (theta[STATIC] < theta[COULOMB]) return said(it, ERROR, "static_n is below coulomb_n: %g", theta[STATIC]);
    return OK;
}

static void show(Valve *valve, const double *path) {
    valve->values[INDICATED] = path[2 * ROW_INDICATED + 1];
    valve->values[POSITION] = path[2 * ROW_X + 1];
    valve->values[VELOCITY] = path[2 * ROW_V + 1];
    valve->values[PRESSURE] = path[2 * ROW_P + 1];
}

static Status rest(Instance *it) {
    Valve *valve = &it->valve;
    double path[2 * ROWS] = {0};
    void *result = NULL, *exception = NULL;
    Status status = check(it);
    if (status != OK) return status;
    if (!isfinite(valve->values[FIRST_POSITION]) || !isfinite(valve->values[FIRST_COMMAND]))
        return said(it, ERROR, "initial position or command is not finite: %g", valve->values[FIRST_POSITION]);
    memset(valve->state, 0, sizeof valve->state);
    if (valve_rest(&result, &exception, valve->values + FIRST_PARAMETER, PARAMETERS, valve->state, STATE,
                   valve->start_time, valve->values[FIRST_POSITION], valve->values[FIRST_COMMAND]))
        return said(it, ERROR, "an effect cannot be at rest at %g m", valve->values[FIRST_POSITION]);
    /* The state begins with time, position, velocity, pressure, mode, direction, indicated position. */
    path[2 * ROW_X + 1] = valve->state[1];
    path[2 * ROW_V + 1] = valve->state[2];
    path[2 * ROW_P + 1] = valve->state[3];
    path[2 * ROW_INDICATED + 1] = valve->state[6];
    show(valve, path);
    return OK;
}

API const char *fmi2GetTypesPlatform(void) { return "default"; }
API const char *fmi2GetVersion(void) { return "2.0"; }
API Status fmi2SetDebugLogging(void *c, int on, size_t n, const char *const categories[]) {
    (void)c, (void)on, (void)n, (void)categories;
    return OK;
}

API void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const Callbacks *calls,
                          int visible, int logging) {
    (void)resources, (void)visible, (void)logging;
    if (type != 1 || strcmp(guid, GUID) != 0) {
        if (calls->log) calls->log(calls->environment, name, ERROR, "logStatusError", "co-simulation with GUID " GUID " only");
        return NULL;
    }
    Instance *it = malloc(sizeof *it);
    if (!it) return NULL;
    begin(&it->valve);
    it->calls = *calls;
    it->name = malloc(strlen(name) + 1);
    if (!it->name) {
        free(it);
        return NULL;
    }
    strcpy(it->name, name);
    return it;
}

API void fmi2FreeInstance(void *c) {
    if (!c) return;
    free(((Instance *)c)->name);
    free(c);
}

API Status fmi2SetupExperiment(void *c, int defined, double tolerance, double start, int stop_defined, double stop) {
    (void)defined, (void)tolerance, (void)stop_defined, (void)stop;
    ((Instance *)c)->valve.start_time = start;
    return OK;
}

API Status fmi2EnterInitializationMode(void *c) { return rest(c); }
API Status fmi2ExitInitializationMode(void *c) {
    Status status = rest(c);
    ((Instance *)c)->valve.initialized = status == OK;
    return status;
}
API Status fmi2Terminate(void *c) {
    (void)c;
    return OK;
}
API Status fmi2Reset(void *c) {
    begin(&((Instance *)c)->valve);
    return OK;
}

API Status fmi2GetReal(void *c, const unsigned reference[], size_t n, double value[]) {
    Instance *it = c;
    for (size_t i = 0; i < n; i++) {
        if (reference[i] >= VARIABLES) return said(it, ERROR, "no variable %g", reference[i]);
        /* What rests follows where it is put to rest. */
        if (!it->valve.initialized && reference[i] >= INDICATED && reference[i] <= PRESSURE && rest(it) != OK) return ERROR;
        value[i] = it->valve.values[reference[i]];
    }
    return OK;
}

API Status fmi2SetReal(void *c, const unsigned reference[], size_t n, const double value[]) {
    Instance *it = c;
    for (size_t i = 0; i < n; i++) {
        unsigned r = reference[i];
        int fixed = r >= INDICATED && r <= PRESSURE;
        if (r >= VARIABLES || fixed || (it->valve.initialized && (r == FIRST_POSITION || r == FIRST_COMMAND)))
            return said(it, ERROR, "variable %g cannot be set now", r);
        it->valve.values[r] = value[i];
    }
    return OK;
}

API Status fmi2DoStep(void *c, double now, double duration, int no_return) {
    Instance *it = c;
    double path[2 * ROWS];
    void *result = NULL, *exception = NULL;
    (void)now, (void)no_return;
    if (!it->valve.initialized) return said(it, ERROR, "not initialized at %g s", now);
    if (!isfinite(it->valve.values[INPUT])) return said(it, ERROR, "the command is not finite: %g", it->valve.values[INPUT]);
    if (duration == 0.0) return OK;
    if (!(duration > 0.0 && isfinite(duration))) return said(it, ERROR, "cannot step over %g s", duration);
    Status status = check(it);
    if (status != OK) return status;
    if (valve_respond(&result, &exception, it->valve.values + FIRST_PARAMETER, PARAMETERS, it->valve.state, STATE,
                      &it->valve.values[INPUT], 1, &duration, 1, STEP_S, TOLERANCE, path, ROWS, 2))
        return said(it, ERROR, "an effect failed in the step from %g s", now);
    show(&it->valve, path);
    return OK;
}

API Status fmi2GetFMUstate(void *c, void **kept) {
    if (!*kept && !(*kept = malloc(sizeof(Valve)))) return ERROR;
    memcpy(*kept, &((Instance *)c)->valve, sizeof(Valve));
    return OK;
}
API Status fmi2SetFMUstate(void *c, void *kept) {
    memcpy(&((Instance *)c)->valve, kept, sizeof(Valve));
    return OK;
}
API Status fmi2FreeFMUstate(void *c, void **kept) {
    (void)c;
    free(*kept);
    *kept = NULL;
    return OK;
}

/* What this unit has not: no integers, booleans or texts, no derivatives, no serialized state, no step under way. */
#define NONE(name, ...) \
    API Status name(void *c, __VA_ARGS__) { return said(c, ERROR, #name " is not offered (%g)", 0.0); }
#define NONE_OF(name, type) \
    API Status name(void *c, const unsigned r[], size_t n, type v) { \
        (void)r, (void)v; \
        return n == 0 ? OK : said(c, ERROR, #name ": no such variable (%g)", 0.0); \
    }
NONE_OF(fmi2GetInteger, int *)
NONE_OF(fmi2GetBoolean, int *)
NONE_OF(fmi2GetString, const char **)
NONE_OF(fmi2SetInteger, const int *)
NONE_OF(fmi2SetBoolean, const int *)
NONE_OF(fmi2SetString, const char *const *)
NONE(fmi2SerializedFMUstateSize, void *s, size_t *n)
NONE(fmi2SerializeFMUstate, void *s, char b[], size_t n)
NONE(fmi2DeSerializeFMUstate, const char b[], size_t n, void **s)
NONE(fmi2GetDirectionalDerivative, const unsigned u[], size_t n, const unsigned k[], size_t m, const double d[], double e[])
NONE(fmi2SetRealInputDerivatives, const unsigned r[], size_t n, const int o[], const double v[])
NONE(fmi2GetRealOutputDerivatives, const unsigned r[], size_t n, const int o[], double v[])
NONE(fmi2GetStatus, int s, int *v)
NONE(fmi2GetRealStatus, int s, double *v)
NONE(fmi2GetIntegerStatus, int s, int *v)
NONE(fmi2GetBooleanStatus, int s, int *v)
NONE(fmi2GetStringStatus, int s, const char **v)
API Status fmi2CancelStep(void *c) { return said(c, ERROR, "no step is under way (%g)", 0.0); }
