//! FMI 2.0.

use std::ffi::{c_char, c_int, c_void};

use super::logger::{Call, Log2, c_text};
use super::table::add;
use super::{ERROR, Handle, Logger, OK, call, directional, get, no_variables, put, set, text};
use crate::instance::{Instance, Kind, Phase};

/// `fmi2CallbackFunctions`.
#[repr(C)]
pub struct Callbacks {
    pub logger: Option<Log2>,
    pub allocate_memory: *const c_void,
    pub free_memory: *const c_void,
    pub step_finished: *const c_void,
    pub component_environment: *mut c_void,
}

/// `fmi2EventInfo`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EventInfo {
    pub new_discrete_states_needed: c_int,
    pub terminate_simulation: c_int,
    pub nominals_of_continuous_states_changed: c_int,
    pub values_of_continuous_states_changed: c_int,
    pub next_event_time_defined: c_int,
    pub next_event_time: f64,
}

type Values = *mut c_void;

super::shared! {
    c_int;
    fmi2FreeInstance fmi2ExitInitializationMode fmi2Terminate fmi2Reset
    fmi2GetFMUstate fmi2SetFMUstate fmi2FreeFMUstate
    fmi2SerializedFMUstateSize fmi2SerializeFMUstate fmi2DeSerializeFMUstate
    fmi2EnterEventMode fmi2EnterContinuousTimeMode fmi2CompletedIntegratorStep fmi2SetTime
    fmi2SetContinuousStates fmi2GetContinuousStates fmi2GetDerivatives
    fmi2GetNominalsOfContinuousStates fmi2GetEventIndicators
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetDebugLogging(c: Handle, _: c_int, _: usize, _: *const *const c_char) -> c_int {
    call(c, |_| Ok(()))
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    guid: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    _logging_on: c_int,
) -> Handle {
    // Texts that end with a zero.
    let (name, guid, resources) = unsafe { (text(name), text(guid), text(resources)) };
    let mut logger = Logger { call: Call::Nothing, environment: 0, name: c_text(&name) };
    if !callbacks.is_null() {
        // Not null, and a structure of the importer.
        let callbacks = unsafe { &*callbacks };
        logger.call = callbacks.logger.map_or(Call::Nothing, Call::Second);
        logger.environment = callbacks.component_environment as usize;
    }
    add(logger, || match kind {
        0 => Instance::new(Kind::ModelExchange, &resources, &guid),
        1 => Instance::new(Kind::CoSimulation, &resources, &guid),
        kind => Err(format!("the type {kind} of the FMU is unknown")),
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetupExperiment(
    c: Handle,
    _tolerance_defined: c_int,
    _tolerance: f64,
    start_time: f64,
    _stop_time_defined: c_int,
    _stop_time: f64,
) -> c_int {
    call(c, |entry| entry.instance.set_start_time(start_time))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2EnterInitializationMode(c: Handle) -> c_int {
    call(c, |entry| entry.instance.enter_initialization())
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetReal(c: Handle, vr: *const u32, nvr: usize, value: *mut f64) -> c_int {
    call(c, |entry| unsafe { get(entry, vr, nvr, value) })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2SetReal(c: Handle, vr: *const u32, nvr: usize, value: *const f64) -> c_int {
    call(c, |entry| unsafe { set(entry, vr, nvr, value) })
}

macro_rules! no_variables_of {
    ($($type:literal: $($name:ident)*;)*) => { $($(
        #[unsafe(no_mangle)]
        pub extern "C" fn $name(c: Handle, _: *const u32, nvr: usize, _: Values) -> c_int {
            call(c, |_| no_variables(nvr, $type))
        }
    )*)* };
}

no_variables_of! {
    "Integer": fmi2GetInteger fmi2SetInteger;
    "Boolean": fmi2GetBoolean fmi2SetBoolean;
    "String": fmi2GetString fmi2SetString;
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2GetDirectionalDerivative(
    c: Handle,
    unknowns: *const u32,
    unknown_count: usize,
    knowns: *const u32,
    known_count: usize,
    seed: *const f64,
    sensitivity: *mut f64,
) -> c_int {
    call(c, |entry| unsafe {
        directional(
            entry,
            (unknowns, unknown_count),
            (knowns, known_count),
            (seed, known_count),
            (sensitivity, unknown_count),
        )
    })
}

#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi2NewDiscreteStates(c: Handle, info: *mut EventInfo) -> c_int {
    call(c, |entry| {
        entry.instance.check_mode("an update of the discrete states", &[Phase::Event])?;
        unsafe { put(info, EventInfo::default()) };
        Ok(())
    })
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2SetRealInputDerivatives(
    c: Handle,
    _: *const u32,
    nvr: usize,
    _: *const c_int,
    _: *const f64,
) -> c_int {
    call(c, |_| no_variables(nvr, "derivative of an input"))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2GetRealOutputDerivatives(
    c: Handle,
    _: *const u32,
    nvr: usize,
    _: *const c_int,
    _: *mut f64,
) -> c_int {
    call(c, |_| no_variables(nvr, "derivative of an output"))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2DoStep(c: Handle, t: f64, h: f64, _no_set: c_int) -> c_int {
    call(c, |entry| entry.instance.step(t, h))
}

#[unsafe(no_mangle)]
pub extern "C" fn fmi2CancelStep(c: Handle) -> c_int {
    call(c, |_| Err(String::from("no step is running that could be cancelled")))
}

/// Steps end before they return: none is pending, and no status is kept.
macro_rules! status_of {
    ($($name:ident)*) => { $(
        #[unsafe(no_mangle)]
        pub extern "C" fn $name(c: Handle, _kind: c_int, _: Values) -> c_int {
            let status = call(c, |_| Err(String::from("no status of a step is kept, because no step is pending")));
            // "Discard" if the status is unknown.
            if status == OK || c.is_null() { ERROR } else { 2 }
        }
    )* };
}

status_of! { fmi2GetStatus fmi2GetRealStatus fmi2GetIntegerStatus fmi2GetBooleanStatus fmi2GetStringStatus }
