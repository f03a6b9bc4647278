//! FMI 3.0.

use std::ffi::{c_char, c_int, c_void};

use super::logger::{Call, Log3, c_text};
use super::table::add;
use super::{Handle, Logger, call, directional, get, no_variables, put, set, text};
use crate::instance::{Instance, Kind, Phase};

/// A Boolean of C.
pub type Boolean = u8;

type Any = *mut c_void;

super::shared! {
    Boolean;
    fmi3FreeInstance fmi3ExitInitializationMode fmi3Terminate fmi3Reset
    fmi3GetFMUState fmi3SetFMUState fmi3FreeFMUState
    fmi3SerializedFMUStateSize fmi3SerializeFMUState fmi3DeserializeFMUState
    fmi3EnterEventMode fmi3EnterContinuousTimeMode fmi3CompletedIntegratorStep fmi3SetTime
    fmi3SetContinuousStates fmi3GetContinuousStates fmi3GetContinuousStateDerivatives
    fmi3GetNominalsOfContinuousStates fmi3GetEventIndicators
}

fn instantiate(
    (name, token, resources): (&str, &str, &str),
    environment: *mut c_void,
    log: Option<Log3>,
    kind: Result<Kind, &str>,
) -> Handle {
    let call = log.map_or(Call::Nothing, Call::Third);
    let logger = Logger { call, environment: environment as usize, name: c_text(name) };
    add(logger, || Instance::new(kind?, resources, token))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi3SetDebugLogging(c: Handle, _: Boolean, _: usize, _: *const *const c_char) -> c_int {
    call(c, |_| Ok(()))
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateModelExchange(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: Boolean,
    _logging_on: Boolean,
    environment: *mut c_void,
    log: Option<Log3>,
) -> Handle {
    // Texts that end with a zero.
    let (name, token, resources) = unsafe { (text(name), text(token), text(resources)) };
    instantiate((&name, &token, &resources), environment, log, Ok(Kind::ModelExchange))
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: Boolean,
    _logging_on: Boolean,
    event_mode_used: Boolean,
    _early_return_allowed: Boolean,
    _intermediate: *const u32,
    _intermediate_count: usize,
    environment: *mut c_void,
    log: Option<Log3>,
    _intermediate_update: *const c_void,
) -> Handle {
    // Texts that end with a zero.
    let (name, token, resources) = unsafe { (text(name), text(token), text(resources)) };
    let kind = if event_mode_used == 0 { Ok(Kind::CoSimulation) } else { Err("the FMU has no event mode") };
    instantiate((&name, &token, &resources), environment, log, kind)
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateScheduledExecution(
    name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: Boolean,
    _logging_on: Boolean,
    environment: *mut c_void,
    log: Option<Log3>,
    _clock_update: *const c_void,
    _lock: *const c_void,
    _unlock: *const c_void,
) -> Handle {
    // Texts that end with a zero.
    let (name, token, resources) = unsafe { (text(name), text(token), text(resources)) };
    let refused = Err("the FMU has no scheduled execution; use co-simulation");
    instantiate((&name, &token, &resources), environment, log, refused)
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi3EnterInitializationMode(
    c: Handle,
    _tolerance_defined: Boolean,
    _tolerance: f64,
    start_time: f64,
    _stop_time_defined: Boolean,
    _stop_time: f64,
) -> c_int {
    call(c, |entry| {
        entry.instance.set_start_time(start_time)?;
        entry.instance.enter_initialization()
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetFloat64(
    c: Handle,
    vr: *const u32,
    nvr: usize,
    values: *mut f64,
    count: usize,
) -> c_int {
    call(c, |entry| {
        same_count(nvr, count)?;
        unsafe { get(entry, vr, nvr, values) }
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetFloat64(
    c: Handle,
    vr: *const u32,
    nvr: usize,
    values: *const f64,
    count: usize,
) -> c_int {
    call(c, |entry| {
        same_count(nvr, count)?;
        unsafe { set(entry, vr, nvr, values) }
    })
}

fn same_count(references: usize, values: usize) -> Result<(), String> {
    if references == values { Ok(()) } else { Err(format!("{values} values for {references} variables")) }
}

macro_rules! no_variables_of {
    ($($type:literal: $($name:ident($($arg:ty),*))*;)*) => { $($(
        #[unsafe(no_mangle)]
        pub extern "C" fn $name(c: Handle, _: *const u32, nvr: usize, $(_: $arg),*) -> c_int {
            call(c, |_| no_variables(nvr, $type))
        }
    )*)* };
}

no_variables_of! {
    "Float32": fmi3GetFloat32(Any, usize) fmi3SetFloat32(Any, usize);
    "Int8": fmi3GetInt8(Any, usize) fmi3SetInt8(Any, usize);
    "UInt8": fmi3GetUInt8(Any, usize) fmi3SetUInt8(Any, usize);
    "Int16": fmi3GetInt16(Any, usize) fmi3SetInt16(Any, usize);
    "UInt16": fmi3GetUInt16(Any, usize) fmi3SetUInt16(Any, usize);
    "Int32": fmi3GetInt32(Any, usize) fmi3SetInt32(Any, usize);
    "UInt32": fmi3GetUInt32(Any, usize) fmi3SetUInt32(Any, usize);
    "Int64": fmi3GetInt64(Any, usize) fmi3SetInt64(Any, usize);
    "UInt64": fmi3GetUInt64(Any, usize) fmi3SetUInt64(Any, usize);
    "Boolean": fmi3GetBoolean(Any, usize) fmi3SetBoolean(Any, usize);
    "String": fmi3GetString(Any, usize) fmi3SetString(Any, usize);
    "Binary": fmi3GetBinary(Any, Any, usize) fmi3SetBinary(Any, Any, usize);
    "Clock": fmi3GetClock(Any) fmi3SetClock(Any) fmi3GetIntervalDecimal(Any, Any)
        fmi3GetIntervalFraction(Any, Any, Any) fmi3GetShiftDecimal(Any) fmi3GetShiftFraction(Any, Any)
        fmi3SetIntervalDecimal(Any) fmi3SetIntervalFraction(Any, Any) fmi3SetShiftDecimal(Any)
        fmi3SetShiftFraction(Any, Any);
    "derivative of an output": fmi3GetOutputDerivatives(Any, Any, usize);
}

macro_rules! unsupported {
    ($($name:ident($($arg:ty),*): $reason:literal;)*) => { $(
        #[unsafe(no_mangle)]
        pub extern "C" fn $name(c: Handle, $(_: $arg),*) -> c_int {
            call(c, |_| Err(String::from($reason)))
        }
    )* };
}

unsupported! {
    fmi3GetNumberOfVariableDependencies(u32, Any): "the dependencies are those of the model description";
    fmi3GetVariableDependencies(u32, Any, Any, Any, Any, usize): "the dependencies are those of the model description";
    fmi3GetAdjointDerivative(Any, usize, Any, usize, Any, usize, Any, usize): "the FMU has no adjoint derivatives; use directional derivatives";
    fmi3EnterConfigurationMode(): "the FMU has no structural parameters";
    fmi3ExitConfigurationMode(): "the FMU has no structural parameters";
    fmi3EvaluateDiscreteStates(): "the FMU has no discrete states";
    fmi3EnterStepMode(): "the FMU has no event mode in co-simulation";
    fmi3ActivateModelPartition(u32, f64): "the FMU has no scheduled execution";
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetDirectionalDerivative(
    c: Handle,
    unknowns: *const u32,
    unknown_count: usize,
    knowns: *const u32,
    known_count: usize,
    seed: *const f64,
    seed_count: usize,
    sensitivity: *mut f64,
    sensitivity_count: usize,
) -> c_int {
    call(c, |entry| unsafe {
        directional(
            entry,
            (unknowns, unknown_count),
            (knowns, known_count),
            (seed, seed_count),
            (sensitivity, sensitivity_count),
        )
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3UpdateDiscreteStates(
    c: Handle,
    needs_update: *mut Boolean,
    terminate: *mut Boolean,
    nominals_changed: *mut Boolean,
    values_changed: *mut Boolean,
    next_event_defined: *mut Boolean,
    next_event: *mut f64,
) -> c_int {
    call(c, |entry| {
        entry.instance.check_mode("an update of the discrete states", &[Phase::Event])?;
        for place in [needs_update, terminate, nominals_changed, values_changed, next_event_defined] {
            unsafe { put(place, 0) };
        }
        unsafe { put(next_event, 0.0) };
        Ok(())
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetNumberOfEventIndicators(c: Handle, count: *mut usize) -> c_int {
    call(c, |_| {
        unsafe { put(count, 0) };
        Ok(())
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetNumberOfContinuousStates(c: Handle, count: *mut usize) -> c_int {
    call(c, |entry| {
        unsafe { put(count, entry.instance.continuous_states()?.len()) };
        Ok(())
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3DoStep(
    c: Handle,
    t: f64,
    h: f64,
    _no_set: Boolean,
    event_handling_needed: *mut Boolean,
    terminate: *mut Boolean,
    early_return: *mut Boolean,
    last_time: *mut f64,
) -> c_int {
    call(c, |entry| {
        let outcome = entry.instance.step(t, h);
        let reached = if outcome.is_ok() { t + h } else { t };
        unsafe {
            put(event_handling_needed, 0);
            put(terminate, 0);
            put(early_return, 0);
            put(last_time, reached);
        }
        outcome
    })
}
