//! An importer of FMUs in Rust: calls of both interfaces.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::Path;
use std::sync::Mutex;

use hydroid::model::{Model, encode};
use hydroid_export::fmu::{MODEL_FILE, Role, SAMPLE_TIME_FILE, VESSEL_FILE, Variables, identity, token};
use hydroid_fmu::interface::{Handle, OK, fmi2, fmi3};

use crate::golden::Golden;

static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

unsafe extern "C" fn log(_: *mut c_void, _: c_int, _: *const c_char, message: *const c_char) {
    let message = unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned();
    MESSAGES.lock().unwrap().push(message);
}

/// Whether a message was reported that contains a text.
pub(crate) fn reported(part: &str) -> bool {
    MESSAGES.lock().unwrap().iter().any(|message| message.contains(part))
}

/// Resources of an FMU in a folder.
pub(crate) struct Resources {
    pub(crate) folder: tempfile::TempDir,
    pub(crate) token: String,
    pub(crate) variables: Variables,
    pub(crate) model_file: &'static str,
}

impl Resources {
    pub(crate) fn of(model: &Model) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let content = encode(model).unwrap();
        let model_file = if model.is_vessel() { VESSEL_FILE } else { MODEL_FILE };
        let dt = model.description.dt;
        std::fs::write(folder.path().join(model_file), &content).unwrap();
        std::fs::write(folder.path().join(SAMPLE_TIME_FILE), format!("{dt:?}\n")).unwrap();
        let token = identity(token(&content, dt));
        Self { folder, token, variables: Variables::of(model), model_file }
    }

    pub(crate) fn reference(&self, role: Role) -> u32 {
        u32::try_from(self.variables.reference(role).unwrap()).unwrap()
    }
}

/// Version and kind of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Api {
    Steps2,
    Steps3,
    Exchange2,
    Exchange3,
}

impl Api {
    pub(crate) fn is_second(self) -> bool {
        matches!(self, Self::Steps2 | Self::Exchange2)
    }
}

/// An instance that is freed at the end.
pub(crate) struct Instance<'a> {
    pub(crate) of: &'a Resources,
    pub(crate) api: Api,
    pub(crate) handle: Handle,
}

impl Drop for Instance<'_> {
    fn drop(&mut self) {
        if self.api.is_second() {
            fmi2::fmi2FreeInstance(self.handle);
        } else {
            fmi3::fmi3FreeInstance(self.handle);
        }
    }
}

/// Instantiates; null if the FMU refuses.
pub(crate) fn instantiate(folder: &Path, token: &str, api: Api) -> Handle {
    let path = folder.to_str().unwrap();
    let uri = CString::new(format!("file://{}", path.replace(' ', "%20"))).unwrap();
    let path = CString::new(path).unwrap();
    let token = CString::new(token).unwrap();
    let name = c"vessel".as_ptr();
    let null = std::ptr::null_mut();
    unsafe {
        match api {
            Api::Steps2 | Api::Exchange2 => {
                let kind = c_int::from(api == Api::Steps2);
                let (token, uri) = (token.as_ptr(), uri.as_ptr());
                fmi2::fmi2Instantiate(name, kind, token, uri, std::ptr::null(), 0, 0)
            }
            Api::Exchange3 => {
                let (token, path) = (token.as_ptr(), path.as_ptr());
                fmi3::fmi3InstantiateModelExchange(name, token, path, 0, 0, null, Some(log))
            }
            Api::Steps3 => fmi3::fmi3InstantiateCoSimulation(
                name,
                token.as_ptr(),
                path.as_ptr(),
                0,
                0,
                0,
                0,
                std::ptr::null(),
                0,
                null,
                Some(log),
                std::ptr::null(),
            ),
        }
    }
}

impl<'a> Instance<'a> {
    pub(crate) fn new(of: &'a Resources, api: Api) -> Self {
        let handle = instantiate(of.folder.path(), &of.token, api);
        assert!(!handle.is_null(), "{api:?}");
        Self { of, api, handle }
    }

    /// An instance at the start of a run.
    pub(crate) fn started(of: &'a Resources, api: Api, golden: &Golden) -> Self {
        let instance = Self::new(of, api);
        instance.start(golden);
        instance
    }

    pub(crate) fn start(&self, golden: &Golden) {
        let c = self.handle;
        self.parameters(golden);
        if self.api.is_second() {
            assert_eq!(fmi2::fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0), OK);
            assert_eq!(fmi2::fmi2EnterInitializationMode(c), OK);
            assert_eq!(fmi2::fmi2ExitInitializationMode(c), OK);
        } else {
            assert_eq!(fmi3::fmi3EnterInitializationMode(c, 0, 0.0, 0.0, 0, 0.0), OK);
            assert_eq!(fmi3::fmi3ExitInitializationMode(c), OK);
        }
    }

    fn parameters(&self, golden: &Golden) {
        for (i, value) in golden.start_outputs.iter().enumerate() {
            self.set(Role::StartOutput(i), *value);
        }
        for (i, value) in golden.start_inputs.iter().enumerate() {
            self.set(Role::StartInput(i), *value);
        }
        if !golden.poses.is_empty() {
            golden.start_pose.iter().enumerate().for_each(|(i, value)| self.set(Role::StartPose(i), *value));
            golden.current.iter().enumerate().for_each(|(i, value)| self.set(Role::Current(i), *value));
        }
    }

    pub(crate) fn try_set(&self, reference: u32, value: f64) -> c_int {
        unsafe {
            if self.api.is_second() {
                fmi2::fmi2SetReal(self.handle, &raw const reference, 1, &raw const value)
            } else {
                fmi3::fmi3SetFloat64(self.handle, &raw const reference, 1, &raw const value, 1)
            }
        }
    }

    pub(crate) fn set(&self, role: Role, value: f64) {
        assert_eq!(self.try_set(self.of.reference(role), value), OK, "{role:?}");
    }

    pub(crate) fn inputs(&self, c: &[f64]) {
        c.iter().enumerate().for_each(|(i, value)| self.set(Role::Input(i), *value));
    }

    pub(crate) fn get(&self, role: Role) -> f64 {
        let reference = self.of.reference(role);
        let mut value = f64::NAN;
        let status = unsafe {
            if self.api.is_second() {
                fmi2::fmi2GetReal(self.handle, &raw const reference, 1, &raw mut value)
            } else {
                fmi3::fmi3GetFloat64(self.handle, &raw const reference, 1, &raw mut value, 1)
            }
        };
        assert_eq!(status, OK, "{role:?}");
        value
    }

    /// Outputs and pose.
    pub(crate) fn row(&self, golden: &Golden) -> Vec<f64> {
        let outputs = (0..golden.outputs).map(|i| self.get(Role::Output(i)));
        let pose = if golden.poses.is_empty() { 0 } else { 3 };
        outputs.chain((0..pose).map(|i| self.get(Role::Pose(i)))).collect()
    }

    pub(crate) fn try_step(&self, t: f64, h: f64) -> c_int {
        if self.api.is_second() {
            return fmi2::fmi2DoStep(self.handle, t, h, 1);
        }
        let mut flags = [9_u8; 3];
        let mut last = f64::NAN;
        let [events, terminate, early] = &mut flags;
        let status =
            unsafe { fmi3::fmi3DoStep(self.handle, t, h, 1, events, terminate, early, &raw mut last) };
        if status == OK {
            assert_eq!((flags, last), ([0; 3], t + h));
        }
        status
    }

    pub(crate) fn step(&self, t: f64, h: f64) {
        assert_eq!(self.try_step(t, h), OK, "from {t} by {h}");
    }
}
