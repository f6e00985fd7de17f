/* FMI 3.0, Co-Simulation: torques of the motors in, positions and velocities out. Types and functions are those
 * of the standard (https://fmi-standard.org); what Co-Simulation does not need answers with an error.
 */

#include "motion.h"
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum {
    fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent
} fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean,
                                               fmi3Boolean, fmi3Boolean, fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3LockPreemptionCallback)();
typedef void (*fmi3UnlockPreemptionCallback)();

/* Value references, as in modelDescription.xml. */
enum {
    TIME, MAX_STEP, TORQUES,
    POSITIONS = TORQUES + JOINTS, VELOCITIES = POSITIONS + JOINTS, END = VELOCITIES + JOINTS
};

/* As in modelDescription.xml, s. */
#define DEFAULT_STEP 2e-4

enum mode { INSTANTIATED, INITIALISATION, STEP, TERMINATED };

/* An arm; behind it is the memory of its terms. */
struct instance {
    enum mode mode;
    double max_step, torque[JOINTS];
    struct motion arm;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    struct memory memory[];
};

static size_t size(void) { return sizeof(struct instance) + model_terms * sizeof(struct memory); }

static fmi3Status failed(const struct instance *me, const char *message)
{
    if (me && me->log) {
        me->log(me->environment, fmi3Error, "logStatusError", message);
    }
    return fmi3Error;
}

static void begin(struct instance *me)
{
    const struct instance kept = *me;
    memset(me, 0, size());
    me->max_step = DEFAULT_STEP;
    me->environment = kept.environment;
    me->log = kept.log;
}

/* Where a variable of type Float64 is; null where there is none. */
static double *place(struct instance *me, fmi3ValueReference reference)
{
    if (reference >= END) return NULL;
    if (reference >= VELOCITIES) return &me->arm.dq[reference - VELOCITIES];
    if (reference >= POSITIONS) return &me->arm.q[reference - POSITIONS];
    if (reference >= TORQUES) return &me->torque[reference - TORQUES];
    return reference == MAX_STEP ? &me->max_step : &me->arm.time;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                                      const fmi3String categories[])
{
    (void)instance, (void)loggingOn, (void)nCategories, (void)categories;
    return fmi3OK;
}

EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
    fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate)
{
    (void)instanceName, (void)resourcePath, (void)visible, (void)loggingOn, (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables, (void)nRequiredIntermediateVariables, (void)intermediateUpdate;
    struct instance asked = { .environment = instanceEnvironment, .log = logMessage };
    if (!instantiationToken || strcmp(instantiationToken, model_token) != 0) {
        failed(&asked, "the instantiation token is another FMU's");
        return NULL;
    }
    if (eventModeUsed) {
        failed(&asked, "there is no event mode");
        return NULL;
    }
    struct instance *me = malloc(size());
    if (me) {
        *me = asked;
        begin(me);
    }
    return me;
}

EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
    fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
    fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage)
{
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
    (void)instanceEnvironment, (void)logMessage;
    return NULL;
}

EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
    fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
    fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption,
    fmi3UnlockPreemptionCallback unlockPreemption)
{
    (void)instanceName, (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
    (void)instanceEnvironment, (void)logMessage, (void)clockUpdate;
    (void)lockPreemption, (void)unlockPreemption;
    return NULL;
}

EXPORT void fmi3FreeInstance(fmi3Instance instance) { free(instance); }

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
    fmi3Float64 tolerance, fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    (void)toleranceDefined, (void)tolerance, (void)stopTimeDefined, (void)stopTime;
    struct instance *me = instance;
    if (me->mode != INSTANTIATED) return failed(me, "the arm was initialised already");
    me->arm.time = startTime;
    me->mode = INITIALISATION;
    return fmi3OK;
}

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    struct instance *me = instance;
    if (me->mode != INITIALISATION) return failed(me, "the arm is not in its initialisation");
    me->mode = STEP;
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance instance) { return failed(instance, "there is no event mode"); }

EXPORT fmi3Status fmi3Terminate(fmi3Instance instance)
{
    ((struct instance *)instance)->mode = TERMINATED;
    return fmi3OK;
}

EXPORT fmi3Status fmi3Reset(fmi3Instance instance)
{
    begin(instance);
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                 size_t nValueReferences, fmi3Float64 values[], size_t nValues)
{
    struct instance *me = instance;
    if (nValues != nValueReferences) return failed(me, "every variable is one number");
    for (size_t i = 0; i < nValues; i++) {
        const double *from = place(me, valueReferences[i]);
        if (!from) return failed(me, "there is no variable of this reference");
        values[i] = *from;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                 size_t nValueReferences, const fmi3Float64 values[], size_t nValues)
{
    struct instance *me = instance;
    if (nValues != nValueReferences) return failed(me, "every variable is one number");
    for (size_t i = 0; i < nValues; i++) {
        const fmi3ValueReference reference = valueReferences[i];
        const bool is_input = reference >= TORQUES && reference < POSITIONS;
        if (reference == TIME || !place(me, reference)) return failed(me, "there is no such variable to set");
        if (!is_input && me->mode > INITIALISATION) return failed(me, "only torques change once it moves");
        if (!isfinite(values[i])) return failed(me, "a value is not finite");
        if (reference == MAX_STEP && !(values[i] > 0.0)) return failed(me, "max_step must be above 0");
        *place(me, reference) = values[i];
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
    fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
    fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn,
    fmi3Float64 *lastSuccessfulTime)
{
    (void)noSetFMUStatePriorToCurrentPoint;
    struct instance *me = instance;
    *eventHandlingNeeded = *terminateSimulation = *earlyReturn = false;
    *lastSuccessfulTime = me->arm.time;
    if (me->mode != STEP) return failed(me, "the arm moves only between initialisation and end");
    if (!(communicationStepSize > 0.0)) return failed(me, "a step must be longer than 0 s");
    /* A step that is longer by rounding alone is no step more. */
    const double steps = fmax(1.0, ceil(communicationStepSize / me->max_step - 1e-6));
    for (double k = 0.0; k < steps; k += 1.0) {
        if (!motion_step(&me->arm, me->memory, me->torque, communicationStepSize / steps)) {
            return failed(me, "the arm ran away, or its mass matrix has no inverse");
        }
    }
    /* No sum of rounding. */
    me->arm.time = *lastSuccessfulTime = currentCommunicationPoint + communicationStepSize;
    return fmi3OK;
}

/* A copy of all that an arm is. */

EXPORT fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    if (!*FMUState) *FMUState = malloc(size());
    if (!*FMUState) return failed(instance, "there is no memory left");
    memcpy(*FMUState, instance, size());
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    memcpy(instance, FMUState, size());
    return fmi3OK;
}

EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    (void)instance;
    free(*FMUState);
    *FMUState = NULL;
    return fmi3OK;
}

/* What this FMU does not have. */

#define NOTHING(name, ...)                                       \
    EXPORT fmi3Status name(fmi3Instance instance, __VA_ARGS__)   \
    {                                                            \
        return failed(instance, #name ": this FMU has no such"); \
    }
#define NO_MODE(name)                                                 \
    EXPORT fmi3Status name(fmi3Instance instance)                     \
    {                                                                 \
        return failed(instance, #name ": this FMU has no such mode"); \
    }
#define REFERENCES const fmi3ValueReference references[], size_t count
#define NO_TYPE(type)                                                             \
    NOTHING(fmi3Get##type, REFERENCES, fmi3##type values[], size_t nValues)       \
    NOTHING(fmi3Set##type, REFERENCES, const fmi3##type values[], size_t nValues)

NO_TYPE(Float32)
NO_TYPE(Int8)
NO_TYPE(UInt8)
NO_TYPE(Int16)
NO_TYPE(UInt16)
NO_TYPE(Int32)
NO_TYPE(UInt32)
NO_TYPE(Int64)
NO_TYPE(UInt64)
NO_TYPE(Boolean)
NO_TYPE(String)
NOTHING(fmi3GetBinary, REFERENCES, size_t sizes[], fmi3Binary values[], size_t nValues)
NOTHING(fmi3SetBinary, REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t nValues)
NOTHING(fmi3GetClock, REFERENCES, fmi3Clock values[])
NOTHING(fmi3SetClock, REFERENCES, const fmi3Clock values[])
NOTHING(fmi3GetNumberOfVariableDependencies, fmi3ValueReference reference, size_t *count)
NOTHING(fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t elementIndicesOfDependent[],
        fmi3ValueReference independents[], size_t elementIndicesOfIndependents[], fmi3DependencyKind kinds[],
        size_t count)
NOTHING(fmi3SerializedFMUStateSize, fmi3FMUState state, size_t *bytes)
NOTHING(fmi3SerializeFMUState, fmi3FMUState state, fmi3Byte serialized[], size_t bytes)
NOTHING(fmi3DeserializeFMUState, const fmi3Byte serialized[], size_t bytes, fmi3FMUState *state)
NOTHING(fmi3GetDirectionalDerivative, const fmi3ValueReference unknowns[], size_t nUnknowns,
        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
        fmi3Float64 sensitivity[], size_t nSensitivity)
NOTHING(fmi3GetAdjointDerivative, const fmi3ValueReference unknowns[], size_t nUnknowns,
        const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,
        fmi3Float64 sensitivity[], size_t nSensitivity)
NOTHING(fmi3GetIntervalDecimal, REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NOTHING(fmi3GetIntervalFraction, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
        fmi3IntervalQualifier qualifiers[])
NOTHING(fmi3GetShiftDecimal, REFERENCES, fmi3Float64 shifts[])
NOTHING(fmi3GetShiftFraction, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NOTHING(fmi3SetIntervalDecimal, REFERENCES, const fmi3Float64 intervals[])
NOTHING(fmi3SetIntervalFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NOTHING(fmi3SetShiftDecimal, REFERENCES, const fmi3Float64 shifts[])
NOTHING(fmi3SetShiftFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NOTHING(fmi3UpdateDiscreteStates, fmi3Boolean *needUpdate, fmi3Boolean *terminate, fmi3Boolean *nominals,
        fmi3Boolean *values, fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime)
NOTHING(fmi3CompletedIntegratorStep, fmi3Boolean noSetFMUState, fmi3Boolean *enterEventMode,
        fmi3Boolean *terminate)
NOTHING(fmi3SetTime, fmi3Float64 time)
NOTHING(fmi3SetContinuousStates, const fmi3Float64 states[], size_t count)
NOTHING(fmi3GetContinuousStateDerivatives, fmi3Float64 derivatives[], size_t count)
NOTHING(fmi3GetEventIndicators, fmi3Float64 indicators[], size_t count)
NOTHING(fmi3GetContinuousStates, fmi3Float64 states[], size_t count)
NOTHING(fmi3GetNominalsOfContinuousStates, fmi3Float64 nominals[], size_t count)
NOTHING(fmi3GetNumberOfEventIndicators, size_t *count)
NOTHING(fmi3GetNumberOfContinuousStates, size_t *count)
NOTHING(fmi3GetOutputDerivatives, REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)
NOTHING(fmi3ActivateModelPartition, fmi3ValueReference clockReference, fmi3Float64 activationTime)
NO_MODE(fmi3EnterEventMode)
NO_MODE(fmi3EnterConfigurationMode)
NO_MODE(fmi3ExitConfigurationMode)
NO_MODE(fmi3EvaluateDiscreteStates)
NO_MODE(fmi3EnterContinuousTimeMode)
