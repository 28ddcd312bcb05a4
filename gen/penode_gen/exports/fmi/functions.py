# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The functions of FMI 3.0 and 2.0, in the order of the standard.

A line is `NAME(parameters)` and stands for `fmiVStatus fmiVNAME(instance, parameters)`; another type of the result stands
before the name, and then there is no instance unless it is written. @ stands for fmiV, & for value references and their number.
A line with blanks before it goes on with the one above.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

_THREE = """
const char * GetVersion(void)
SetDebugLogging(@Boolean loggingOn, size_t nCategories, const @String categories[])
@Instance InstantiateModelExchange(@String instanceName, @String instantiationToken, @String resourcePath, @Boolean visible, @Boolean
    loggingOn, @InstanceEnvironment instanceEnvironment, @LogMessageCallback logMessage)
@Instance InstantiateCoSimulation(@String instanceName, @String instantiationToken, @String resourcePath, @Boolean visible, @Boolean
    loggingOn, @Boolean eventModeUsed, @Boolean earlyReturnAllowed, const @ValueReference requiredIntermediateVariables[], size_t
    nRequiredIntermediateVariables, @InstanceEnvironment instanceEnvironment, @LogMessageCallback logMessage, @IntermediateUpdateCallback
    intermediateUpdate)
@Instance InstantiateScheduledExecution(@String instanceName, @String instantiationToken, @String resourcePath, @Boolean visible, @Boolean
    loggingOn, @InstanceEnvironment instanceEnvironment, @LogMessageCallback logMessage, @ClockUpdateCallback clockUpdate,
    @LockPreemptionCallback lockPreemption, @UnlockPreemptionCallback unlockPreemption)
void FreeInstance()
EnterInitializationMode(@Boolean toleranceDefined, @Float64 tolerance, @Float64 startTime, @Boolean stopTimeDefined, @Float64 stopTime)
ExitInitializationMode()
EnterEventMode()
Terminate()
Reset()
GetBinary(&, size_t valueSizes[], @Binary values[], size_t nValues)
GetClock(&, @Clock values[])
SetBinary(&, const size_t valueSizes[], const @Binary values[], size_t nValues)
SetClock(&, const @Clock values[])
GetNumberOfVariableDependencies(@ValueReference valueReference, size_t *nDependencies)
GetVariableDependencies(@ValueReference dependent, size_t elementIndicesOfDependent[], @ValueReference independents[], size_t
    elementIndicesOfIndependents[], @DependencyKind dependencyKinds[], size_t nDependencies)
GetFMUState(@FMUState *FMUState)
SetFMUState(@FMUState FMUState)
FreeFMUState(@FMUState *FMUState)
SerializedFMUStateSize(@FMUState FMUState, size_t *size)
SerializeFMUState(@FMUState FMUState, @Byte serializedState[], size_t size)
DeserializeFMUState(const @Byte serializedState[], size_t size, @FMUState *FMUState)
GetDirectionalDerivative(const @ValueReference unknowns[], size_t nUnknowns, const @ValueReference knowns[], size_t nKnowns, const
    @Float64 seed[], size_t nSeed, @Float64 sensitivity[], size_t nSensitivity)
GetAdjointDerivative(const @ValueReference unknowns[], size_t nUnknowns, const @ValueReference knowns[], size_t nKnowns, const @Float64
    seed[], size_t nSeed, @Float64 sensitivity[], size_t nSensitivity)
EnterConfigurationMode()
ExitConfigurationMode()
GetIntervalDecimal(&, @Float64 intervals[], @IntervalQualifier qualifiers[])
GetIntervalFraction(&, @UInt64 counters[], @UInt64 resolutions[], @IntervalQualifier qualifiers[])
GetShiftDecimal(&, @Float64 shifts[])
GetShiftFraction(&, @UInt64 counters[], @UInt64 resolutions[])
SetIntervalDecimal(&, const @Float64 intervals[])
SetIntervalFraction(&, const @UInt64 counters[], const @UInt64 resolutions[])
SetShiftDecimal(&, const @Float64 shifts[])
SetShiftFraction(&, const @UInt64 counters[], const @UInt64 resolutions[])
EvaluateDiscreteStates()
UpdateDiscreteStates(@Boolean *discreteStatesNeedUpdate, @Boolean *terminateSimulation, @Boolean *nominalsOfContinuousStatesChanged,
    @Boolean *valuesOfContinuousStatesChanged, @Boolean *nextEventTimeDefined, @Float64 *nextEventTime)
EnterContinuousTimeMode()
CompletedIntegratorStep(@Boolean noSetFMUStatePriorToCurrentPoint, @Boolean *enterEventMode, @Boolean *terminateSimulation)
SetTime(@Float64 time)
SetContinuousStates(const @Float64 continuousStates[], size_t nContinuousStates)
GetContinuousStateDerivatives(@Float64 derivatives[], size_t nContinuousStates)
GetEventIndicators(@Float64 eventIndicators[], size_t nEventIndicators)
GetContinuousStates(@Float64 continuousStates[], size_t nContinuousStates)
GetNominalsOfContinuousStates(@Float64 nominals[], size_t nContinuousStates)
GetNumberOfEventIndicators(size_t *nEventIndicators)
GetNumberOfContinuousStates(size_t *nContinuousStates)
EnterStepMode()
GetOutputDerivatives(&, const @Int32 orders[], @Float64 values[], size_t nValues)
DoStep(@Float64 currentCommunicationPoint, @Float64 communicationStepSize, @Boolean noSetFMUStatePriorToCurrentPoint, @Boolean
    *eventHandlingNeeded, @Boolean *terminateSimulation, @Boolean *earlyReturn, @Float64 *lastSuccessfulTime)
ActivateModelPartition(@ValueReference clockReference, @Float64 activationTime)
"""

_TWO = """
const char * GetTypesPlatform(void)
const char * GetVersion(void)
SetDebugLogging(@Boolean loggingOn, size_t nCategories, const @String categories[])
@Component Instantiate(@String instanceName, @Type fmuType, @String fmuGUID, @String fmuResourceLocation, const @CallbackFunctions
    *functions, @Boolean visible, @Boolean loggingOn)
void FreeInstance()
SetupExperiment(@Boolean toleranceDefined, @Real tolerance, @Real startTime, @Boolean stopTimeDefined, @Real stopTime)
EnterInitializationMode()
ExitInitializationMode()
Terminate()
Reset()
GetReal(&, @Real value[])
GetInteger(&, @Integer value[])
GetBoolean(&, @Boolean value[])
GetString(&, @String value[])
SetReal(&, const @Real value[])
SetInteger(&, const @Integer value[])
SetBoolean(&, const @Boolean value[])
SetString(&, const @String value[])
GetFMUstate(@FMUstate *FMUstate)
SetFMUstate(@FMUstate FMUstate)
FreeFMUstate(@FMUstate *FMUstate)
SerializedFMUstateSize(@FMUstate FMUstate, size_t *size)
SerializeFMUstate(@FMUstate FMUstate, @Byte serializedState[], size_t size)
DeSerializeFMUstate(const @Byte serializedState[], size_t size, @FMUstate *FMUstate)
GetDirectionalDerivative(const @ValueReference vUnknown_ref[], size_t nUnknown, const @ValueReference vKnown_ref[], size_t nKnown, const
    @Real dvKnown[], @Real dvUnknown[])
EnterEventMode()
NewDiscreteStates(@EventInfo *@eventInfo)
EnterContinuousTimeMode()
CompletedIntegratorStep(@Boolean noSetFMUStatePriorToCurrentPoint, @Boolean *enterEventMode, @Boolean *terminateSimulation)
SetTime(@Real time)
SetContinuousStates(const @Real x[], size_t nx)
GetDerivatives(@Real derivatives[], size_t nx)
GetEventIndicators(@Real eventIndicators[], size_t ni)
GetContinuousStates(@Real x[], size_t nx)
GetNominalsOfContinuousStates(@Real x_nominal[], size_t nx)
SetRealInputDerivatives(&, const @Integer order[], const @Real value[])
GetRealOutputDerivatives(&, const @Integer order[], @Real value[])
DoStep(@Real currentCommunicationPoint, @Real communicationStepSize, @Boolean noSetFMUStatePriorToCurrentPoint)
CancelStep()
GetStatus(const @StatusKind kind, @Status *value)
GetRealStatus(const @StatusKind kind, @Real *value)
GetIntegerStatus(const @StatusKind kind, @Integer *value)
GetBooleanStatus(const @StatusKind kind, @Boolean *value)
GetStringStatus(const @StatusKind kind, @String *value)
"""

_TYPES = ("Float32", "Float64", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean", "String")
_REFERENCES = {3: "const fmi3ValueReference valueReferences[], size_t nValueReferences", 2: "const fmi2ValueReference vr[], size_t nvr"}
_INSTANCE = {3: "fmi3Instance instance", 2: "fmi2Component c"}


@dataclass(frozen=True)
class Function:
    """A function of the standard as C; `typed`: it gets or sets variables of one type."""

    name: str
    returns: str
    text: str  # parameters

    @property
    def names(self) -> list[str]:
        """Names of the parameters."""
        return [] if self.text == "void" else [re.findall(r"\w+", part)[-1] for part in self.text.split(",")]

    @property
    def typed(self) -> bool:
        return "nValueReferences" in self.names or "nvr" in self.names


def functions(version: int) -> list[Function]:
    """All functions of FMI 2 or 3."""
    found = [_read(line, version) for line in (_THREE if version == 3 else _TWO).replace("\n    ", " ").split("\n") if line]
    if version == 3:
        found += [_read(f"Get{kind}(&, @{kind} values[], size_t nValues)", 3) for kind in _TYPES]
        found += [_read(f"Set{kind}(&, const @{kind} values[], size_t nValues)", 3) for kind in _TYPES]
    return found


def _read(line: str, version: int) -> Function:
    match = re.fullmatch(r"(.*?)(\w+)\((.*)\)", line)
    if match is None:
        raise ValueError(line)
    returns, name, parameters = match.groups()
    if not returns or name == "FreeInstance":
        parameters = ", ".join(part for part in (_INSTANCE[version], parameters) if part)
    full = parameters.replace("&", _REFERENCES[version]).replace("@", f"fmi{version}")
    return Function(f"fmi{version}{name}", returns.strip().replace("@", f"fmi{version}") or f"fmi{version}Status", full)
