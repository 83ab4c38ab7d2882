/* FMI 2.0 for co-simulation on a watcher. Whoever has the headers of the standard may let FMI_HEADER name theirs. */
#include <stdlib.h>
#include <string.h>

#ifdef FMI_HEADER
#include FMI_HEADER
#else
#include "fmi2.h"
#endif

#include "watcher.h"

/* An instance. */
typedef struct {
    Watcher *watcher;
    fmi2CallbackFunctions callbacks;
    char *name;
} Instance;

/* Tell an error, and give it. A message holds no per cent sign, so that it may stand where the standard has a format. */
static fmi2Status refuse(const Instance *it, const char *message)
{
    if (it->callbacks.logger)
        it->callbacks.logger(it->callbacks.componentEnvironment, it->name, fmi2Error, "logStatusError", message);
    return fmi2Error;
}

/* Give the outcome of a call that says why it was refused, or NULL. */
static fmi2Status outcome(const Instance *it, const char *refusal) { return refusal ? refuse(it, refusal) : fmi2OK; }

/* Give the outcome of a call on variables. */
static fmi2Status done(const Instance *it, int good)
{
    return good ? fmi2OK : refuse(it, "there is no variable of this type and value reference that can be read or set so");
}

FMI2_Export const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

FMI2_Export const char *fmi2GetVersion(void) { return fmi2Version; }

FMI2_Export fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t n, const fmi2String categories[])
{
    (void)c, (void)loggingOn, (void)n, (void)categories; /* there are errors only, which are always told */
    return fmi2OK;
}

FMI2_Export void fmi2FreeInstance(fmi2Component c)
{
    Instance *it = (Instance *)c;
    if (!it) return;
    watcher_free(it->watcher);
    free(it->name);
    free(it);
}

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean loggingOn)
{
    (void)resources, (void)visible, (void)loggingOn;
    Instance *it = (Instance *)calloc(1, sizeof(Instance));
    if (!it) return NULL;
    const char *wrong = NULL;
    if (callbacks) it->callbacks = *callbacks;
    it->name = (char *)calloc(1, strlen(name ? name : "") + 1);
    if (it->name && name) memcpy(it->name, name, strlen(name));
    it->watcher = watcher_new();
    if (type != fmi2CoSimulation) wrong = "this FMU is for co-simulation only";
    else if (!guid || strcmp(guid, watcher_token()) != 0) wrong = "the guid is that of another FMU; unpack it anew";
    else if (!it->name || !it->watcher) wrong = "there is not enough memory";
    if (!wrong) return it;
    refuse(it, wrong);
    fmi2FreeInstance(it);
    return NULL;
}

FMI2_Export fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                                           fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    watcher_start_at(((Instance *)c)->watcher, startTime);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    const Instance *it = (Instance *)c;
    return outcome(it, watcher_begin(it->watcher));
}

FMI2_Export fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    const Instance *it = (Instance *)c;
    return outcome(it, watcher_run(it->watcher));
}

FMI2_Export fmi2Status fmi2Terminate(fmi2Component c)
{
    const Instance *it = (Instance *)c;
    return outcome(it, watcher_end(it->watcher));
}

FMI2_Export fmi2Status fmi2Reset(fmi2Component c)
{
    watcher_reset(((Instance *)c)->watcher);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[])
{
    int good = 1;
    for (size_t k = 0; k < n; k++) good &= watcher_get_real(((Instance *)c)->watcher, vr[k], &value[k]);
    return done((Instance *)c, good);
}

FMI2_Export fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[])
{
    int good = 1;
    for (size_t k = 0; k < n; k++) {
        int64_t whole = 0;
        good &= watcher_get_whole(((Instance *)c)->watcher, vr[k], &whole);
        value[k] = (fmi2Integer)(whole > INT32_MAX ? INT32_MAX : whole);
    }
    return done((Instance *)c, good);
}

FMI2_Export fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[])
{
    int good = 1;
    for (size_t k = 0; k < n; k++) good &= watcher_get_flag(((Instance *)c)->watcher, vr[k], &value[k]);
    return done((Instance *)c, good);
}

FMI2_Export fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[])
{
    int good = 1;
    for (size_t k = 0; k < n; k++) good &= watcher_get_text(((Instance *)c)->watcher, vr[k], &value[k]);
    return done((Instance *)c, good);
}

FMI2_Export fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[])
{
    int good = 1;
    for (size_t k = 0; k < n; k++) good &= watcher_set_real(((Instance *)c)->watcher, vr[k], value[k]);
    return done((Instance *)c, good);
}

FMI2_Export fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[])
{
    (void)vr, (void)value;
    return done((Instance *)c, n == 0);
}

FMI2_Export fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[])
{
    (void)vr, (void)value;
    return done((Instance *)c, n == 0);
}

FMI2_Export fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[])
{
    (void)vr, (void)value;
    return done((Instance *)c, n == 0);
}

/* A state is a copy of the watcher. */
FMI2_Export fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    if (!state) return fmi2OK;
    watcher_free((Watcher *)*state);
    *state = NULL;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    const Instance *it = (Instance *)c;
    if (*state) watcher_become((Watcher *)*state, it->watcher);
    else *state = watcher_copy(it->watcher);
    return outcome(it, *state ? NULL : "there is not enough memory");
}

FMI2_Export fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    const Instance *it = (Instance *)c;
    if (!state) return refuse(it, "there is no state to go back to");
    watcher_become(it->watcher, (const Watcher *)state);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c, (void)state;
    *size = watcher_saved_size();
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    if (!state || size < watcher_saved_size()) return refuse((Instance *)c, "there is no state, or no room for it");
    watcher_save((const Watcher *)state, (uint8_t *)bytes);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    const Instance *it = (Instance *)c;
    Watcher *copy = watcher_copy(it->watcher);
    if (!copy) return refuse(it, "there is not enough memory");
    if (!watcher_restore(copy, (const uint8_t *)bytes, size)) {
        watcher_free(copy);
        return refuse(it, "this is no state of this FMU, or it is damaged");
    }
    *state = copy;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    const Instance *it = (Instance *)c;
    return outcome(it, watcher_step(it->watcher, time, step));
}

FMI2_Export fmi2Status fmi2CancelStep(fmi2Component c)
{
    return refuse((Instance *)c, "a step is done when its call returns");
}

FMI2_Export fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = watcher_time(((Instance *)c)->watcher);
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    (void)c;
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = fmi2False; /* it never ends by itself */
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

FMI2_Export fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

FMI2_Export fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

FMI2_Export fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                                   const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr, (void)n, (void)order, (void)value;
    return refuse((Instance *)c, "inputs are samples and have no derivatives");
}

FMI2_Export fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                                    const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)n, (void)order, (void)value;
    return refuse((Instance *)c, "outputs have no derivatives");
}

FMI2_Export fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t nUnknown,
                                                    const fmi2ValueReference known[], size_t nKnown, const fmi2Real dvKnown[],
                                                    fmi2Real dvUnknown[])
{
    (void)unknown, (void)nUnknown, (void)known, (void)nKnown, (void)dvKnown, (void)dvUnknown;
    return refuse((Instance *)c, "outputs have no derivatives");
}
