//! The study as data: records, models, claims and experiments as TOML.
//!
//! `records.toml`, `models.toml` and `claims.toml` define records, models and claims; every other file is an experiment
//! with the name of the file. A table `quick` contains the values of the small version.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::StudyError;
use super::claim::Claim;
use super::experiment::Kind;
use hydroid::identify::{GivenRanges, Method, NetworkOptions, SindyOptions};
use hydroid::toml_file;

const BUILT_IN: [(&str, &str); 18] = [
    ("records.toml", include_str!("../experiments/records.toml")),
    ("models.toml", include_str!("../experiments/models.toml")),
    ("claims.toml", include_str!("../experiments/claims.toml")),
    ("fig1.toml", include_str!("../experiments/fig1.toml")),
    ("fig2.toml", include_str!("../experiments/fig2.toml")),
    ("fig3.toml", include_str!("../experiments/fig3.toml")),
    ("fig4.toml", include_str!("../experiments/fig4.toml")),
    ("fig5.toml", include_str!("../experiments/fig5.toml")),
    ("fig5_10ms.toml", include_str!("../experiments/fig5_10ms.toml")),
    ("fig6.toml", include_str!("../experiments/fig6.toml")),
    ("fig7.toml", include_str!("../experiments/fig7.toml")),
    ("fig8.toml", include_str!("../experiments/fig8.toml")),
    ("fig9.toml", include_str!("../experiments/fig9.toml")),
    ("sindy.toml", include_str!("../experiments/sindy.toml")),
    ("amount.toml", include_str!("../experiments/amount.toml")),
    ("cost.toml", include_str!("../experiments/cost.toml")),
    ("forgetting.toml", include_str!("../experiments/forgetting.toml")),
    ("table1.toml", include_str!("../experiments/table1.toml")),
];

/// Excitation of a simulated run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Drive {
    /// Shapes over the full range of both commands.
    Mixed,
    /// The same shapes, slow enough to stay below the change of mode.
    LowSpeed,
    /// Parallel legs in closed loop.
    LawnMower,
}

/// A simulated log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// `simple` or `hydrofoil`.
    pub plant: String,
    pub excitation: Drive,
    /// Duration \[s\]; a lawn-mower run ends after its last leg.
    pub duration_s: f64,
    /// Sample time \[s\].
    #[serde(default = "tenth")]
    pub dt_s: f64,
    /// Seed of commands and noise.
    pub seed: u64,
    /// Speed of each leg of a lawn-mower run \[m/s\].
    #[serde(default)]
    pub speeds: Vec<f64>,
    /// Length of a leg \[m\].
    pub leg_m: Option<f64>,
    /// Distance between legs \[m\].
    pub spacing_m: Option<f64>,
}

const fn tenth() -> f64 {
    0.1
}

/// A model and its records.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelPlan {
    pub method: Method,
    pub train: String,
    pub validate: String,
    pub test: String,
    /// Seeds, one model each.
    pub seeds: Vec<u64>,
    /// Longest horizon \[samples\].
    pub horizon: usize,
    #[serde(default = "motion")]
    pub outputs: Vec<String>,
    #[serde(default)]
    pub ranges: GivenRanges,
    /// Options of a network.
    #[serde(default)]
    pub network: NetworkOptions,
    /// Options of sparse regression.
    #[serde(default)]
    pub sindy: SindyOptions,
}

fn motion() -> Vec<String> {
    ["u", "v", "r"].map(String::from).to_vec()
}

/// An experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    pub title: String,
    /// Question, and how to read the result.
    pub text: String,
    pub run: Kind,
}

/// A study.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    pub records: BTreeMap<String, Record>,
    pub models: BTreeMap<String, ModelPlan>,
    /// Experiments by name, in the order of the page.
    pub experiments: Vec<(String, Experiment)>,
    pub claims: Vec<Claim>,
    /// Whether this is the small version.
    pub quick: bool,
}

/// Order of the page, and computing time relative to the whole, as in the short version; other experiments follow by
/// name.
const ORDER: [(&str, f64); 15] = [
    ("fig1", 0.0),
    ("fig2", 0.0),
    ("fig3", 0.0),
    ("fig4", 0.14),
    ("fig5", 0.1),
    ("fig5_10ms", 0.01),
    ("fig6", 0.03),
    ("fig7", 0.0),
    ("fig8", 0.02),
    ("fig9", 0.22),
    ("sindy", 0.01),
    ("amount", 0.11),
    ("cost", 0.03),
    ("forgetting", 0.1),
    ("table1", 0.22),
];
/// Relative time of an experiment that is not built in.
const OTHER: f64 = 0.1;

/// Usual computing time of an experiment, relative to the whole study.
pub(super) fn usual_time(name: &str) -> f64 {
    ORDER.iter().find(|(known, _)| *known == name).map_or(OTHER, |(_, time)| *time)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Claims {
    claim: Vec<Claim>,
}

impl Plan {
    /// The built-in plan.
    ///
    /// # Errors
    /// If a built-in file is invalid; tests exclude this.
    pub fn built_in(quick: bool) -> Result<Self, StudyError> {
        let files = BUILT_IN.iter().map(|(name, text)| (PathBuf::from(name), (*text).to_owned()));
        Self::of(files.collect(), quick)
    }

    /// The plan in a folder: all of its `.toml` files.
    ///
    /// # Errors
    /// If the folder or a file cannot be read, or an entry is invalid.
    pub fn read(folder: &Path, quick: bool) -> Result<Self, StudyError> {
        let unreadable = |source| StudyError::Folder { path: folder.to_owned(), source };
        let mut files = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(unreadable)? {
            let path = entry.map_err(unreadable)?.path();
            if path.extension().is_some_and(|e| e == "toml") {
                let text = std::fs::read_to_string(&path).map_err(unreadable)?;
                files.push((path, text));
            }
        }
        files.sort();
        Self::of(files, quick)
    }

    /// Writes the built-in files for editing.
    ///
    /// # Errors
    /// If a file cannot be written, or exists with other content.
    pub fn write(folder: &Path) -> Result<(), StudyError> {
        for (name, text) in BUILT_IN {
            let path = folder.join(name);
            if std::fs::read_to_string(&path).is_ok_and(|there| there != text) {
                return Err(StudyError::Edited { path });
            }
            hydroid::atomic::write(&path, |out| out.write_all(text.as_bytes()))?;
        }
        Ok(())
    }

    fn of(files: Vec<(PathBuf, String)>, quick: bool) -> Result<Self, StudyError> {
        let mut plan = Self {
            records: BTreeMap::new(),
            models: BTreeMap::new(),
            experiments: Vec::new(),
            claims: Vec::new(),
            quick,
        };
        for (path, text) in files {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            match name.as_str() {
                "records" => plan.records = named(&text, &path, quick)?,
                "models" => plan.models = named(&text, &path, quick)?,
                "claims" => plan.claims = small::<Claims>(&text, &path, quick)?.claim,
                _ => plan.experiments.push((name, small(&text, &path, quick)?)),
            }
        }
        let place = |name: &str| ORDER.iter().position(|(known, _)| *known == name).unwrap_or(ORDER.len());
        plan.experiments.sort_by(|(a, _), (b, _)| (place(a), a).cmp(&(place(b), b)));
        plan.check()?;
        Ok(plan)
    }

    fn check(&self) -> Result<(), StudyError> {
        if self.experiments.is_empty() {
            return Err(StudyError::Nothing);
        }
        let plants: Vec<String> = ["simple", "hydrofoil"].map(String::from).to_vec();
        for (name, record) in &self.records {
            known(&format!("record '{name}'"), "plant", &record.plant, plants.iter())?;
        }
        let record = |whose: &str, name: &String| known(whose, "record", name, self.records.keys());
        for (name, model) in &self.models {
            for used in [&model.train, &model.validate, &model.test] {
                record(&format!("model '{name}'"), used)?;
            }
            if model.seeds.is_empty() {
                return Err(StudyError::NoSeeds { model: name.clone() });
            }
        }
        for (name, experiment) in &self.experiments {
            let whose = format!("experiment '{name}'");
            let (records, models) = experiment.run.uses();
            experiment.run.check().map_err(|why| StudyError::Cannot { name: name.clone(), why })?;
            records.into_iter().try_for_each(|used| record(&whose, used))?;
            models.into_iter().try_for_each(|used| known(&whose, "model", used, self.models.keys()))?;
        }
        let experiments: Vec<String> = self.experiments.iter().map(|(name, _)| name.clone()).collect();
        for claim in &self.claims {
            let whose = format!("claim '{}'", claim.claim);
            known(&whose, "experiment", &claim.experiment, experiments.iter())?;
            if claim.measures.is_empty() {
                return Err(StudyError::NoMeasures { whose });
            }
        }
        Ok(())
    }
}

fn known<'a>(
    whose: &str,
    what: &'static str,
    name: &str,
    among: impl Iterator<Item = &'a String> + Clone,
) -> Result<(), StudyError> {
    if among.clone().any(|one| one == name) {
        return Ok(());
    }
    Err(StudyError::Unknown {
        whose: whose.to_owned(),
        what,
        name: name.to_owned(),
        nearest: toml_file::nearest(name, among.clone().map(String::as_str)),
        known: among.cloned().collect(),
    })
}

/// A file with one table per name, each with an optional `quick`.
fn named<T: DeserializeOwned>(
    text: &str,
    path: &Path,
    quick: bool,
) -> Result<BTreeMap<String, T>, StudyError> {
    let tables: BTreeMap<String, toml::Table> = toml_file::parse(text, path)?;
    let small = |(name, mut table): (String, toml::Table)| {
        apply_quick(&mut table, quick);
        let value = table.try_into().map_err(|error| wrong(text, path, &name, &error))?;
        Ok((name, value))
    };
    tables.into_iter().map(small).collect()
}

/// A file with an optional `quick`.
fn small<T: DeserializeOwned>(text: &str, path: &Path, quick: bool) -> Result<T, StudyError> {
    let mut table: toml::Table = toml_file::parse(text, path)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    apply_quick(&mut table, quick);
    table.try_into().map_err(|error| wrong(text, path, &name, &error))
}

fn wrong(text: &str, path: &Path, name: &str, error: &toml::de::Error) -> StudyError {
    // A merged table has no line numbers; its heading is the nearest known position.
    let heading = text.lines().position(|line| line.trim() == format!("[{name}]")).map_or(1, |i| i + 1);
    StudyError::Entry {
        path: path.to_owned(),
        line: heading,
        name: name.to_owned(),
        message: error.message().to_owned(),
    }
}

/// Removes the table `quick`, and applies its values if `quick` is set.
fn apply_quick(table: &mut toml::Table, quick: bool) {
    let Some(toml::Value::Table(other)) = table.remove("quick") else { return };
    if quick {
        merge(table, other);
    }
}

fn merge(into: &mut toml::Table, from: toml::Table) {
    for (key, value) in from {
        match (into.get_mut(&key), value) {
            (Some(toml::Value::Table(into)), toml::Value::Table(from)) => merge(into, from),
            (_, value) => {
                into.insert(key, value);
            }
        }
    }
}
