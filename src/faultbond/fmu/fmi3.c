/* FMI 3.0 for co-simulation on a watcher. Whoever has the headers of the standard may let FMI_HEADER name theirs. All functions of
   the standard are here; those for what this FMU does not have refuse. */
#include <stdlib.h>
#include <string.h>

#ifdef FMI_HEADER
#include FMI_HEADER
#else
#include "fmi3.h"
#endif

#include "watcher.h"

/* An instance. */
typedef struct {
    Watcher *watcher;
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} Instance;

/* Tell an error, and give it. */
static fmi3Status refuse(const Instance *it, const char *message)
{
    if (it->log) it->log(it->environment, fmi3Error, "logStatusError", message);
    return fmi3Error;
}

/* Give the outcome of a call that says why it was refused, or NULL. */
static fmi3Status outcome(const Instance *it, const char *refusal) { return refusal ? refuse(it, refusal) : fmi3OK; }

/* Give the outcome of a call on variables. */
static fmi3Status done(const Instance *it, int good)
{
    return good ? fmi3OK : refuse(it, "there is no variable of this type and value reference that can be read or set so");
}

FMI3_Export const char *fmi3GetVersion(void) { return fmi3Version; }

FMI3_Export fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean loggingOn, size_t n, const fmi3String categories[])
{
    (void)c, (void)loggingOn, (void)n, (void)categories; /* there are errors only, which are always told */
    return fmi3OK;
}

FMI3_Export fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference intermediate[], size_t nIntermediate,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)loggingOn, (void)earlyReturnAllowed, (void)intermediate, (void)update;
    const Instance told = {NULL, log, environment};
    Instance *it = NULL;
    const char *wrong = NULL;
    if (!token || strcmp(token, watcher_token()) != 0) wrong = "the instantiation token is that of another FMU; unpack it anew";
    else if (eventModeUsed || nIntermediate > 0) wrong = "this FMU has neither event mode nor intermediate variables";
    else if (!(it = (Instance *)calloc(1, sizeof(Instance)))) wrong = "there is not enough memory";
    if (!wrong) {
        *it = told;
        it->watcher = watcher_new();
        if (it->watcher) return it;
        free(it);
        wrong = "there is not enough memory";
    }
    refuse(&told, wrong);
    return NULL;
}

FMI3_Export fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                                      fmi3Boolean loggingOn, fmi3InstanceEnvironment environment,
                                                      fmi3LogMessageCallback log)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)loggingOn;
    const Instance told = {NULL, log, environment};
    refuse(&told, "this FMU is for co-simulation only");
    return NULL;
}

FMI3_Export fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                                           fmi3Boolean visible, fmi3Boolean loggingOn,
                                                           fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                                           fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                                           fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)loggingOn, (void)update, (void)lock, (void)unlock;
    const Instance told = {NULL, log, environment};
    refuse(&told, "this FMU is for co-simulation only");
    return NULL;
}

FMI3_Export void fmi3FreeInstance(fmi3Instance c)
{
    if (!c) return;
    watcher_free(((Instance *)c)->watcher);
    free(c);
}

FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                                   fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    const Instance *it = (Instance *)c;
    watcher_start_at(it->watcher, startTime);
    return outcome(it, watcher_begin(it->watcher));
}

FMI3_Export fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    const Instance *it = (Instance *)c;
    return outcome(it, watcher_run(it->watcher));
}

FMI3_Export fmi3Status fmi3Terminate(fmi3Instance c)
{
    const Instance *it = (Instance *)c;
    return outcome(it, watcher_end(it->watcher));
}

FMI3_Export fmi3Status fmi3Reset(fmi3Instance c)
{
    watcher_reset(((Instance *)c)->watcher);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 step, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                  fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn,
                                  fmi3Float64 *lastSuccessfulTime)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    const Instance *it = (Instance *)c;
    const char *refusal = watcher_step(it->watcher, time, step);
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = fmi3False;
    *lastSuccessfulTime = refusal ? time : time + step;
    return outcome(it, refusal);
}

#define VARIABLES fmi3Instance c, const fmi3ValueReference vr[], size_t n

FMI3_Export fmi3Status fmi3GetFloat64(VARIABLES, fmi3Float64 values[], size_t nValues)
{
    int good = nValues == n;
    for (size_t k = 0; good && k < n; k++) good = watcher_get_real(((Instance *)c)->watcher, vr[k], &values[k]);
    return done((Instance *)c, good);
}

FMI3_Export fmi3Status fmi3SetFloat64(VARIABLES, const fmi3Float64 values[], size_t nValues)
{
    int good = nValues == n;
    for (size_t k = 0; good && k < n; k++) good = watcher_set_real(((Instance *)c)->watcher, vr[k], values[k]);
    return done((Instance *)c, good);
}

FMI3_Export fmi3Status fmi3GetInt64(VARIABLES, fmi3Int64 values[], size_t nValues)
{
    int good = nValues == n;
    for (size_t k = 0; good && k < n; k++) good = watcher_get_whole(((Instance *)c)->watcher, vr[k], &values[k]);
    return done((Instance *)c, good);
}

FMI3_Export fmi3Status fmi3GetBoolean(VARIABLES, fmi3Boolean values[], size_t nValues)
{
    int good = nValues == n;
    for (size_t k = 0; good && k < n; k++) {
        int flag = 0;
        good = watcher_get_flag(((Instance *)c)->watcher, vr[k], &flag);
        values[k] = flag != 0;
    }
    return done((Instance *)c, good);
}

FMI3_Export fmi3Status fmi3GetString(VARIABLES, fmi3String values[], size_t nValues)
{
    int good = nValues == n;
    for (size_t k = 0; good && k < n; k++) good = watcher_get_text(((Instance *)c)->watcher, vr[k], &values[k]);
    return done((Instance *)c, good);
}

/* No variable is of these types, and none but numbers can be set. */
#define NO_GETTER(Type)                                                                                        \
    FMI3_Export fmi3Status fmi3Get##Type(VARIABLES, fmi3##Type values[], size_t nValues)                       \
    {                                                                                                          \
        (void)vr, (void)values, (void)nValues;                                                                 \
        return done((Instance *)c, n == 0);                                                                    \
    }
#define NO_SETTER(Type)                                                                                        \
    FMI3_Export fmi3Status fmi3Set##Type(VARIABLES, const fmi3##Type values[], size_t nValues)                 \
    {                                                                                                          \
        (void)vr, (void)values, (void)nValues;                                                                 \
        return done((Instance *)c, n == 0);                                                                    \
    }
NO_GETTER(Float32)
NO_GETTER(Int8)
NO_GETTER(UInt8)
NO_GETTER(Int16)
NO_GETTER(UInt16)
NO_GETTER(Int32)
NO_GETTER(UInt32)
NO_GETTER(UInt64)
NO_SETTER(Float32)
NO_SETTER(Int8)
NO_SETTER(UInt8)
NO_SETTER(Int16)
NO_SETTER(UInt16)
NO_SETTER(Int32)
NO_SETTER(UInt32)
NO_SETTER(Int64)
NO_SETTER(UInt64)
NO_SETTER(Boolean)
NO_SETTER(String)

FMI3_Export fmi3Status fmi3GetBinary(VARIABLES, size_t sizes[], fmi3Binary values[], size_t nValues)
{
    (void)vr, (void)sizes, (void)values, (void)nValues;
    return done((Instance *)c, n == 0);
}

FMI3_Export fmi3Status fmi3SetBinary(VARIABLES, const size_t sizes[], const fmi3Binary values[], size_t nValues)
{
    (void)vr, (void)sizes, (void)values, (void)nValues;
    return done((Instance *)c, n == 0);
}

FMI3_Export fmi3Status fmi3GetClock(VARIABLES, fmi3Clock values[])
{
    (void)vr, (void)values;
    return done((Instance *)c, n == 0);
}

FMI3_Export fmi3Status fmi3SetClock(VARIABLES, const fmi3Clock values[])
{
    (void)vr, (void)values;
    return done((Instance *)c, n == 0);
}

/* A state is a copy of the watcher. */
FMI3_Export fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    const Instance *it = (Instance *)c;
    if (*state) watcher_become((Watcher *)*state, it->watcher);
    else *state = watcher_copy(it->watcher);
    return outcome(it, *state ? NULL : "there is not enough memory");
}

FMI3_Export fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    const Instance *it = (Instance *)c;
    if (!state) return refuse(it, "there is no state to go back to");
    watcher_become(it->watcher, (const Watcher *)state);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    if (!state) return fmi3OK;
    watcher_free((Watcher *)*state);
    *state = NULL;
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    (void)c, (void)state;
    *size = watcher_saved_size();
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    if (!state || size < watcher_saved_size()) return refuse((Instance *)c, "there is no state, or no room for it");
    watcher_save((const Watcher *)state, bytes);
    return fmi3OK;
}

FMI3_Export fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    const Instance *it = (Instance *)c;
    Watcher *copy = watcher_copy(it->watcher);
    if (!copy) return refuse(it, "there is not enough memory");
    if (!watcher_restore(copy, bytes, size)) {
        watcher_free(copy);
        return refuse(it, "this is no state of this FMU, or it is damaged");
    }
    *state = copy;
    return fmi3OK;
}

/* What this FMU does not have. */
static fmi3Status not_here(fmi3Instance c) { return refuse((Instance *)c, "this FMU does not have what this function is for"); }

#define ABSENT(name, arguments, unused) \
    FMI3_Export fmi3Status name arguments { unused; return not_here(c); }

ABSENT(fmi3GetNumberOfVariableDependencies, (fmi3Instance c, fmi3ValueReference vr, size_t *n), ((void)vr, (void)n))
ABSENT(fmi3GetVariableDependencies,
       (fmi3Instance c, fmi3ValueReference dependent, size_t elements[], fmi3ValueReference independents[],
        size_t elementsOfIndependents[], fmi3DependencyKind kinds[], size_t n),
       ((void)dependent, (void)elements, (void)independents, (void)elementsOfIndependents, (void)kinds, (void)n))
ABSENT(fmi3GetDirectionalDerivative,
       (fmi3Instance c, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns,
        const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity),
       ((void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns, (void)seed, (void)nSeed, (void)sensitivity,
        (void)nSensitivity))
ABSENT(fmi3GetAdjointDerivative,
       (fmi3Instance c, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns,
        const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity),
       ((void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns, (void)seed, (void)nSeed, (void)sensitivity,
        (void)nSensitivity))
ABSENT(fmi3GetOutputDerivatives, (VARIABLES, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues),
       ((void)vr, (void)n, (void)orders, (void)values, (void)nValues))
ABSENT(fmi3EnterConfigurationMode, (fmi3Instance c), (void)0)
ABSENT(fmi3ExitConfigurationMode, (fmi3Instance c), (void)0)
ABSENT(fmi3EnterEventMode, (fmi3Instance c), (void)0)
ABSENT(fmi3EnterStepMode, (fmi3Instance c), (void)0)
ABSENT(fmi3EvaluateDiscreteStates, (fmi3Instance c), (void)0)
ABSENT(fmi3UpdateDiscreteStates,
       (fmi3Instance c, fmi3Boolean *needUpdate, fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsChanged,
        fmi3Boolean *valuesChanged, fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime),
       ((void)needUpdate, (void)terminateSimulation, (void)nominalsChanged, (void)valuesChanged, (void)nextEventTimeDefined,
        (void)nextEventTime))
ABSENT(fmi3GetIntervalDecimal, (VARIABLES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]),
       ((void)vr, (void)n, (void)intervals, (void)qualifiers))
ABSENT(fmi3GetIntervalFraction,
       (VARIABLES, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]),
       ((void)vr, (void)n, (void)counters, (void)resolutions, (void)qualifiers))
ABSENT(fmi3GetShiftDecimal, (VARIABLES, fmi3Float64 shifts[]), ((void)vr, (void)n, (void)shifts))
ABSENT(fmi3GetShiftFraction, (VARIABLES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]),
       ((void)vr, (void)n, (void)counters, (void)resolutions))
ABSENT(fmi3SetIntervalDecimal, (VARIABLES, const fmi3Float64 intervals[]), ((void)vr, (void)n, (void)intervals))
ABSENT(fmi3SetIntervalFraction, (VARIABLES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]),
       ((void)vr, (void)n, (void)counters, (void)resolutions))
ABSENT(fmi3SetShiftDecimal, (VARIABLES, const fmi3Float64 shifts[]), ((void)vr, (void)n, (void)shifts))
ABSENT(fmi3SetShiftFraction, (VARIABLES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]),
       ((void)vr, (void)n, (void)counters, (void)resolutions))
ABSENT(fmi3EnterContinuousTimeMode, (fmi3Instance c), (void)0)
ABSENT(fmi3CompletedIntegratorStep,
       (fmi3Instance c, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation),
       ((void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation))
ABSENT(fmi3SetTime, (fmi3Instance c, fmi3Float64 time), (void)time)
ABSENT(fmi3SetContinuousStates, (fmi3Instance c, const fmi3Float64 states[], size_t n), ((void)states, (void)n))
ABSENT(fmi3GetContinuousStateDerivatives, (fmi3Instance c, fmi3Float64 derivatives[], size_t n), ((void)derivatives, (void)n))
ABSENT(fmi3GetEventIndicators, (fmi3Instance c, fmi3Float64 indicators[], size_t n), ((void)indicators, (void)n))
ABSENT(fmi3GetContinuousStates, (fmi3Instance c, fmi3Float64 states[], size_t n), ((void)states, (void)n))
ABSENT(fmi3GetNominalsOfContinuousStates, (fmi3Instance c, fmi3Float64 nominals[], size_t n), ((void)nominals, (void)n))
ABSENT(fmi3GetNumberOfEventIndicators, (fmi3Instance c, size_t *n), (void)n)
ABSENT(fmi3GetNumberOfContinuousStates, (fmi3Instance c, size_t *n), (void)n)
ABSENT(fmi3ActivateModelPartition, (fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time), ((void)clock, (void)time))
