//! Model files: a written file is read back; invalid files are refused.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use hydroid::atomic;
use hydroid::evaluate::DesignRange;
use hydroid::log::{Channel, ChannelSpec};
use hydroid::model::{
    Body, Description, Members, Model, ModelError, Port, Provenance, Reading, TrialErrors, decode, encode,
    read, write,
};
use hydroid_core::model::sparse::{Equations, Factor, Shape, Term};
use proptest::prelude::*;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde_json::{Value, json};

fn port(name: &str, unit: &str, low: f64, high: f64) -> Port {
    Port {
        channel: Channel::new(name, unit),
        range: DesignRange { low, high },
        training_range: None,
        noise: None,
        rate_limit: None,
    }
}

/// Coefficients of a member: it has the fourth term of the second equation instead of the second one.
fn spread(scale: f64) -> [f64; 10] {
    [0.0, scale, 0.0, 0.0, 0.1, 0.0, 0.0, 0.3, scale / 7.0, 0.0]
}

/// A model with numbers without a short decimal form, and names that need escaping.
fn model() -> Model {
    let terms = vec![
        Term::constant(),
        Term::monomial(&[0]),
        Term::monomial(&[1, 2]),
        Term::signed_square(0, 0),
        Term::new(vec![
            Factor { variable: 2, shape: Shape::Power(3) },
            Factor { variable: 1, shape: Shape::Abs },
        ]),
    ];
    let coefficients: Vec<f64> =
        (0..10u32).map(|k| if k % 3 == 0 { 0.0 } else { f64::from(k).sqrt() / 7.0 }).collect();
    let dt = 1.0 / 3.0;
    let mut reading = Reading::default();
    reading.selection.outputs = vec![ChannelSpec {
        scale: 0.1 + 0.2,
        offset: -1.0 / 3.0,
        ..ChannelSpec::renamed("u", "Geschw. \"ü\"")
    }];
    Model {
        description: Description {
            bands: None,
            trial_errors: vec![TrialErrors {
                trial: "zigzag".to_owned(),
                figure: "first_overshoot_deg".to_owned(),
                trials: 3,
                half_width: Some(0.1 + 0.2),
            }],
            current: None,
            name: String::from("sindy"),
            dt,
            outputs: vec![
                port("u", "m/s", -1.0 / 3.0, std::f64::consts::PI),
                port("r", "rad/s", -std::f64::consts::FRAC_PI_6, 1e-17),
            ],
            inputs: vec![port("n \"ü\"\n", "", -1e300, 5e-324)],
            reading,
            boat: hydroid::boat::Boat::default(),
            provenance: Provenance {
                hydroid: String::from("0.1.0"),
                seed: u64::MAX,
                training: vec![String::from("a.csv[0..10]")],
                validation: Vec::new(),
                settings: json!({"x": 0.1, "y": [null, f64::MIN_POSITIVE], "z": {}}),
                ..Provenance::default()
            },
        },
        body: Body::Equations(Arc::new(Equations::new(terms, coefficients, 2, 1, dt, 4).unwrap())),
        members: Members::new(&[1.0, 1.0 / 3.0, 0.9].map(|scale| spread(scale).to_vec())),
        learning: None,
    }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

fn bytes(model: &Model) -> Vec<u8> {
    let folder = folder();
    let path = folder.path().join("model.safetensors");
    write(model, &path).unwrap();
    std::fs::read(path).unwrap()
}

fn decoded(bytes: &[u8]) -> Result<Model, ModelError> {
    decode(bytes, Path::new("m.safetensors"))
}

fn head(bytes: &[u8]) -> Value {
    let (_, metadata) = SafeTensors::read_metadata(bytes).unwrap();
    serde_json::from_str(&metadata.metadata().as_ref().unwrap()["hydroid"]).unwrap()
}

fn file(head: &str, tensor: &str, dtype: Dtype, shape: &[usize], data: &[u8]) -> Vec<u8> {
    let view = TensorView::new(dtype, shape.to_vec(), data).unwrap();
    let metadata = HashMap::from([(String::from("hydroid"), head.to_owned())]);
    safetensors::serialize([(tensor, view)], Some(metadata)).unwrap()
}

fn numbers(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// A file whose head was changed; its ten coefficients are ones.
fn with_head(change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let mut head = head(&bytes(&model()));
    change(&mut head);
    file(&head.to_string(), "coefficients", Dtype::F64, &[2, 5], &numbers(&[1.0; 10]))
}

/// The reason of an inconsistent model.
fn contradiction(bytes: &[u8]) -> String {
    match decoded(bytes) {
        Err(ModelError::Inconsistent { reason, .. }) => reason,
        other => panic!("{other:?}"),
    }
}

fn not_a_model(bytes: &[u8]) -> String {
    match decoded(bytes) {
        Err(ModelError::NotAModel { reason, .. }) => reason,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_model_file_is_rewritten_byte_for_byte() {
    let folder = folder();
    let (first, second) = (folder.path().join("new/deep/a.safetensors"), folder.path().join("b.safetensors"));
    write(&model(), &first).unwrap();
    let again = read(&first).unwrap();
    assert_eq!(again, model());
    write(&again, &second).unwrap();
    assert_eq!(std::fs::read(&first).unwrap(), std::fs::read(&second).unwrap());
    // An existing file is replaced, and no other file remains in the folder.
    write(&model(), &first).unwrap();
    assert_eq!(std::fs::read_dir(first.parent().unwrap()).unwrap().count(), 1);
    // The unchanged helper makes valid files.
    assert!(decoded(&with_head(|_| ())).is_ok());
}

/// Regression test: JSON numbers were read with a rounding error, so that a sample time of 1/3 s changed.
#[test]
fn numbers_in_the_head_survive_to_the_last_bit() {
    let mut model = model();
    for k in 1..50u32 {
        let high = f64::from(k).powi(7).sin().abs() * 10f64.powi(i32::try_from(k).unwrap() - 25);
        model.description.outputs[0].range = DesignRange { low: -high, high };
        let again = decoded(&bytes(&model)).unwrap();
        assert_eq!(again.description.outputs[0].range.high.to_bits(), high.to_bits());
    }
}

#[test]
fn a_truncated_file_is_refused() {
    let whole = bytes(&model());
    for length in 0..whole.len() {
        let reason = not_a_model(&whole[..length]);
        assert!(!reason.is_empty());
    }
    let mut longer = whole.clone();
    longer.push(0);
    not_a_model(&longer);
    assert!(decoded(&whole).is_ok());
}

#[test]
fn a_changed_byte_never_panics() {
    let whole = bytes(&model());
    for at in 0..whole.len() {
        for flip in [0x01, 0x80, 0xff] {
            let mut damaged = whole.clone();
            damaged[at] ^= flip;
            // Some changes give another valid model (a digit of a range); none may panic.
            if let Ok(model) = decoded(&damaged) {
                sound(&model);
            }
        }
    }
}

/// Properties of every model that was read.
fn sound(model: &Model) {
    let mut session = model.session();
    let (n, m) = (session.outputs(), session.inputs());
    assert_eq!((n, m), (model.description.outputs.len(), model.description.inputs.len()));
    session.observe(&vec![0.1; n]);
    session.advance(&vec![0.2; m]);
    let mut y = vec![0.0; 3 * n];
    let mut work = hydroid_core::predict::Workspace::new();
    session.rollout(&vec![0.1; 3 * m], &mut work, &mut y);
    for mut member in model.member_sessions() {
        member.observe(&vec![0.1; n]);
        member.rollout(&vec![0.1; 3 * m], &mut work, &mut y);
    }
}

#[test]
fn the_content_of_a_vessel_file_is_read_back() {
    let vessels = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../vessels");
    let paths = ["hydrofoil.toml", "mariner.toml", "otter.toml", "tug.toml"].map(|name| vessels.join(name));
    for path in paths.iter().map(PathBuf::as_path).chain([Path::new("simple")]) {
        let vessel = read(path).unwrap();
        let content = encode(&vessel).unwrap();
        let again = decode(&content, path).unwrap();
        assert_eq!((&again, encode(&again).unwrap()), (&vessel, content), "{}", path.display());
    }
    assert!(matches!(decoded(b"speed = 3"), Err(ModelError::Craft(_))));
    assert!(matches!(decoded(b"[[thruster]]\nname = 3"), Err(ModelError::Craft(_))));
    // Text that is no TOML, or has no key, is not a vessel.
    not_a_model(b"t,u\n0,1\n");
    not_a_model(b"# a comment\n");
}

proptest! {
    #[test]
    fn arbitrary_bytes_are_no_model(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(decoded(&bytes).is_err());
    }

    #[test]
    fn arbitrary_heads_are_no_model(head in ".{0,200}", length in 0usize..40) {
        let data = vec![7u8; 8 * length];
        let bytes = file(&head, "coefficients", Dtype::F64, &[length], &data);
        prop_assert!(decoded(&bytes).is_err());
    }

    #[test]
    fn a_wrong_length_field_is_refused(length in any::<u64>(), rest in prop::collection::vec(any::<u8>(), 0..100)) {
        let mut bytes = length.to_le_bytes().to_vec();
        bytes.extend(rest);
        prop_assert!(decoded(&bytes).is_err());
    }
}

#[test]
fn other_files_are_recognised() {
    let folder = folder();
    let put = |name: &str, bytes: &[u8]| -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let empty = put("empty.safetensors", b"");
    assert!(matches!(read(&empty), Err(ModelError::NotAModel { .. })));
    let log = put("log.csv", b"t [s],u [m/s]\n0,1\n0.1,2\n");
    let error = read(&log).unwrap_err();
    assert!(matches!(error, ModelError::NotAModel { .. }));
    assert!(error.to_string().contains("log.csv"), "{error}");
    assert!(
        matches!(read(folder.path()), Err(ModelError::NotAModel { reason, .. }) if reason == "it is a folder")
    );
    let nowhere = read(&folder.path().join("nowhere.safetensors")).unwrap_err();
    assert!(
        matches!(&nowhere, ModelError::Read { source, .. } if source.kind() == std::io::ErrorKind::NotFound)
    );
    assert!(nowhere.to_string().contains("nowhere.safetensors"));
    assert!(matches!(read(&log.join("below")), Err(ModelError::Read { .. })));
    #[cfg(unix)]
    assert!(matches!(read(Path::new("/dev/zero")), Err(ModelError::NotAModel { .. })));
    // A sparse file above the size limit.
    let huge = put("huge.safetensors", b"");
    std::fs::OpenOptions::new().write(true).open(&huge).unwrap().set_len((1 << 30) + 1).unwrap();
    assert!(matches!(read(&huge), Err(ModelError::NotAModel { reason, .. }) if reason.contains("too many")));
    // A safetensors file of another program, with and without metadata.
    let view = TensorView::new(Dtype::F32, vec![1], &[0; 4]).unwrap();
    let other = HashMap::from([(String::from("format"), String::from("pt"))]);
    for metadata in [None, Some(other)] {
        let foreign = safetensors::serialize([("weight", view.clone())], metadata).unwrap();
        let path = put("foreign.safetensors", &foreign);
        assert!(matches!(read(&path), Err(ModelError::Foreign { .. })));
    }
}

#[test]
fn another_file_version_is_reported() {
    let future = file(r#"{"version": 7, "all": "else"}"#, "x", Dtype::F64, &[0], &[]);
    assert!(matches!(decoded(&future), Err(ModelError::Version { found: 7, .. })));
    let old = with_head(|head| head["version"] = json!(0));
    let refused = decoded(&old).unwrap_err();
    assert!(matches!(refused, ModelError::Older { .. }));
    assert_eq!(
        refused.to_string(),
        "m.safetensors was written by an older version of hydroid; identify again"
    );
    for version in [json!("1"), json!(-1), json!(1.0), Value::Null] {
        assert!(not_a_model(&with_head(|head| head["version"] = version)).contains("version"));
    }
}

#[test]
fn a_model_of_the_format_without_roles_is_read() {
    let before = with_head(|head| {
        head["version"] = json!(2);
        head["description"].as_object_mut().unwrap().remove("boat");
    });
    let read = decoded(&before).unwrap();
    assert!(read.description.boat.is_empty());
    assert_eq!(head(&bytes(&read))["version"], 3);
    let unknown =
        with_head(|head| head["description"]["boat"] = json!({"inputs": {"n": {"role": "engine"}}}));
    assert!(not_a_model(&unknown).contains("engine"));
}

#[test]
fn an_inconsistent_header_is_refused() {
    assert!(not_a_model(&with_head(|head| head["structure"]["kind"] = json!("oracle"))).contains("oracle"));
    assert!(not_a_model(&with_head(|head| head["description"]["colour"] = json!(1))).contains("colour"));
    assert!(not_a_model(&with_head(|head| head["description"]["dt"] = json!("fast"))).contains("fast"));
    assert!(not_a_model(&with_head(|head| head["structure"]["substeps"] = json!(-1))).contains("-1"));
    not_a_model(&with_head(|head| {
        head["description"].as_object_mut().unwrap().remove("outputs");
    }));
    let together = |factors: Value, low: f64| {
        let range = json!({"low": low, "high": 1.0});
        with_head(|head| {
            head["description"]["provenance"]["moved_together"] =
                json!([{"factors": factors, "range": range}]);
        })
    };
    assert!(decoded(&together(json!([1.0]), -1.0)).is_ok());
    for (factors, low) in
        [(json!([1.0, 1.0]), -1.0), (json!([]), -1.0), (json!([0.0]), -1.0), (json!([1.0]), 2.0)]
    {
        assert!(contradiction(&together(factors, low)).contains("did not move apart"));
    }
    not_a_model(&file("[[[[", "coefficients", Dtype::F64, &[0], &[]));
    not_a_model(&file(&"[".repeat(100_000), "coefficients", Dtype::F64, &[0], &[]));
}

#[test]
fn numbers_that_contradict_the_head_are_refused() {
    let good = head(&bytes(&model())).to_string();
    let ones = numbers(&[1.0; 10]);
    let missing = contradiction(&file(&good, "weights", Dtype::F64, &[2, 5], &ones));
    assert!(missing.contains("'coefficients' is missing"), "{missing}");
    for shape in [vec![5, 2], vec![10], vec![2, 5, 1], vec![1, 10]] {
        let reason = contradiction(&file(&good, "coefficients", Dtype::F64, &shape, &ones));
        assert!(reason.contains("[2, 5]"), "{reason}");
    }
    let single = contradiction(&file(&good, "coefficients", Dtype::F32, &[2, 5], &[0; 40]));
    assert!(single.contains("F32"), "{single}");
    for bad in [f64::NAN, f64::INFINITY] {
        let mut values = [1.0; 10];
        values[7] = bad;
        let reason = contradiction(&file(&good, "coefficients", Dtype::F64, &[2, 5], &numbers(&values)));
        assert!(reason.contains("term 2 in equation 1"), "{reason}");
    }
}

/// A file with an ensemble of given shape beside ten coefficients that are ones.
fn with_members(shape: &[usize], values: &[f64], places: &[u32]) -> Vec<u8> {
    let head = head(&bytes(&model())).to_string();
    let (ones, values) = (numbers(&[1.0; 10]), numbers(values));
    let places: Vec<u8> = places.iter().flat_map(|place| place.to_le_bytes()).collect();
    let view = |dtype, shape: &[usize], data| TensorView::new(dtype, shape.to_vec(), data).unwrap();
    let tensors = [
        ("coefficients", view(Dtype::F64, &[2, 5], &ones)),
        ("members", view(Dtype::F64, shape, &values)),
        ("member_places", view(Dtype::U32, &[places.len() / 4], &places)),
    ];
    let metadata = HashMap::from([(String::from("hydroid"), head)]);
    safetensors::serialize(tensors, Some(metadata)).unwrap()
}

#[test]
fn an_ensemble_is_read_back_and_an_inconsistent_one_is_refused() {
    // A file without an ensemble.
    let old = decoded(&with_head(|_| ())).unwrap();
    assert!(old.members.is_empty() && old.member_sessions().is_empty());
    assert_eq!(model().member_sessions().len(), 3);
    let read = decoded(&with_members(&[2, 2], &[1.0, 2.0, 3.0, 4.0], &[0, 9])).unwrap();
    assert_eq!(read.members.len(), 2);
    for (shape, values, places) in [
        (vec![2, 2], vec![1.0; 4], vec![0, 10]),
        (vec![2, 2], vec![1.0; 4], vec![9, 0]),
        (vec![2, 2], vec![1.0; 4], vec![3, 3]),
        (vec![2, 2], vec![1.0; 4], vec![3]),
        (vec![4], vec![1.0; 4], vec![0, 1, 2, 3]),
        (vec![1, 2], vec![1.0, f64::NAN], vec![0, 1]),
        (vec![1 << 40, 0], vec![], vec![]),
        (vec![1, 0], vec![], vec![]),
        (vec![51, 1], vec![1.0; 51], vec![0]),
    ] {
        let reason = contradiction(&with_members(&shape, &values, &places));
        assert!(reason.contains("ensemble"), "{reason}");
    }
    let head = head(&bytes(&model())).to_string();
    let (ones, six) = (numbers(&[1.0; 10]), numbers(&[1.0; 6]));
    let view = |shape: &[usize], data| TensorView::new(Dtype::F64, shape.to_vec(), data).unwrap();
    let tensors = [("coefficients", view(&[2, 5], &ones)), ("members", view(&[2, 3], &six))];
    let metadata = HashMap::from([(String::from("hydroid"), head)]);
    let alone = contradiction(&safetensors::serialize(tensors, Some(metadata)).unwrap());
    assert!(alone.contains("only one of the tensors"), "{alone}");
}

/// The number of members is limited, and columns that no member uses are omitted.
#[test]
fn a_file_stays_small() {
    let mut many = model();
    let bare = bytes(&Model { members: Members::default(), ..model() }).len();
    many.members = Members::new(&vec![spread(1.0).to_vec(); 70]);
    assert_eq!(decoded(&bytes(&many)).unwrap().members.len(), 50);
    // Four coefficients for each member, their places, and two entries in the head.
    assert!(bytes(&many).len() - bare <= 50 * 4 * 8 + 4 * 4 + 200);
}

#[test]
fn an_invalid_header_is_refused() {
    for substeps in [json!(0), json!(1_000_000_000), json!(u64::MAX)] {
        let reason = contradiction(&with_head(|head| head["structure"]["substeps"] = substeps));
        assert!(reason.contains("integration steps"), "{reason}");
    }
    for dt in [0.0, -0.1] {
        contradiction(&with_head(|head| head["description"]["dt"] = json!(dt)));
    }
    let reason = contradiction(&with_head(|head| {
        head["structure"]["terms"][1] = json!([{"variable": 3, "shape": {"power": 1}}]);
    }));
    assert!(reason.contains("variable 3"), "{reason}");
    contradiction(&with_head(|head| {
        head["structure"]["terms"][1] = json!([{"variable": 65535, "shape": "abs"}]);
    }));
    for range in [json!({"low": 1.0, "high": 1.0}), json!({"low": 2.0, "high": 1.0})] {
        let reason = contradiction(&with_head(|head| head["description"]["outputs"][0]["range"] = range));
        assert!(reason.contains("'u'"), "{reason}");
    }
    // Fewer channels than coefficients.
    contradiction(&with_head(|head| head["description"]["outputs"] = json!([])));
    contradiction(&with_head(|head| {
        head["description"]["outputs"].as_array_mut().unwrap().pop();
    }));
}

/// A model without outputs is refused.
#[test]
fn a_model_without_outputs_is_refused() {
    let mut head = head(&bytes(&model()));
    head["description"]["outputs"] = json!([]);
    head["structure"]["terms"] = json!([[]]);
    let reason = contradiction(&file(&head.to_string(), "coefficients", Dtype::F64, &[0, 1], &[]));
    assert!(reason.contains("no outputs"), "{reason}");
}

/// A term of many factors with high powers needs bounded time and memory.
#[test]
fn terms_that_are_too_large_are_refused() {
    let mut head = head(&bytes(&model()));
    let factors: Vec<Value> = (0..2000).map(|_| json!({"variable": 0, "shape": {"power": 255}})).collect();
    head["structure"]["terms"][0] = Value::Array(factors);
    let reason =
        contradiction(&file(&head.to_string(), "coefficients", Dtype::F64, &[2, 5], &numbers(&[1.0; 10])));
    assert!(reason.contains("65,535"), "{reason}");
}

#[test]
fn a_failed_write_leaves_no_file() {
    let folder = folder();
    let blocked = folder.path().join("file");
    std::fs::write(&blocked, "there").unwrap();
    let listing = || {
        let mut names: Vec<_> =
            std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let before = listing();
    // A regular file has no subfolders.
    let error = write(&model(), &blocked.join("deep/model.safetensors")).unwrap_err();
    assert!(error.to_string().contains("model.safetensors"), "{error}");
    // A folder is not replaced by a file.
    let taken = folder.path().join("taken");
    std::fs::create_dir_all(taken.join("inside")).unwrap();
    assert!(write(&model(), &taken).is_err());
    std::fs::remove_dir_all(&taken).unwrap();
    // Content that fails half-way leaves the old file and no part of the new one.
    for name in ["fresh", "file"] {
        let failed = atomic::write(&folder.path().join(name), |out| {
            out.write_all(&vec![1; 100_000])?;
            Err(std::io::Error::other("the disk is full"))
        });
        assert!(failed.unwrap_err().to_string().contains("the disk is full"));
    }
    assert_eq!(listing(), before);
    assert_eq!(std::fs::read_to_string(&blocked).unwrap(), "there");
}

#[test]
fn an_adapting_model_keeps_its_prior() {
    let settings = hydroid_core::adapt::ExpertMixtureOptions {
        priors_s: vec![100.0, 1.0 / 3.0],
        forgetting_s: 30.0,
        window: 2,
        horizon: 20,
        gate: hydroid_core::adapt::InnovationGate::default(),
    };
    let root = (0..25).map(|k| if k % 5 >= k / 5 { 1.0 / f64::from(k + 1) } else { 0.0 }).collect();
    let mut model =
        Model { learning: Some(hydroid::model::Learning { settings, r_factor: root }), ..model() };
    for port in model.description.outputs.iter_mut().chain(&mut model.description.inputs) {
        (port.range.low, port.range.high) = (-1.0, 1.0);
    }
    assert_eq!(decoded(&bytes(&model)).unwrap(), model);
    model.learning.as_mut().unwrap().r_factor[0] = 0.0;
    assert!(contradiction(&bytes(&model)).contains("triangle"));
    model.learning.as_mut().unwrap().r_factor[0] = 1e-200;
    assert!(contradiction(&bytes(&model)).contains("triangle"));
    // Values that would exhaust the memory, or outside their range.
    let refused = |change: &dyn Fn(&mut hydroid_core::adapt::ExpertMixtureOptions), word: &str| {
        let mut model = model.clone();
        let learning = model.learning.as_mut().unwrap();
        learning.r_factor[0] = 1.0;
        change(&mut learning.settings);
        let message = contradiction(&bytes(&model));
        assert!(message.contains(word), "'{word}' is not in: {message}");
    };
    refused(&|s| s.horizon = 1 << 50, "horizon");
    refused(&|s| s.window = 1 << 50, "window");
    refused(&|s| s.priors_s = vec![1.0; 100_000], "experts");
    refused(&|s| s.priors_s[0] = 1e308, "prior");
    refused(&|s| s.priors_s[0] = 1e-310, "prior");
    refused(&|s| s.forgetting_s = 1e-4, "forgetting");
    refused(&|s| s.gate.inflate = 0.0, "gate");
}
