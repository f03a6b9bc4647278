//! The study as data: records, models and experiments, each a few lines of TOML.
//!
//! `records.toml` says what is simulated, `models.toml` what is learned from it, `claims.toml` what is claimed of the results;
//! every other file is an experiment, named after the file. A table `quick` in any of them has what the small version does
//! otherwise.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::StudyError;
use super::experiment::Kind;
use hydroid::identify::{GivenRanges, Method, NetworkOptions, SindyOptions};
use hydroid::toml_file;

/// The files that are built in, name and text.
const BUILT_IN: [(&str, &str); 17] = [
    ("records.toml", include_str!("../experiments/records.toml")),
    ("models.toml", include_str!("../experiments/models.toml")),
    ("claims.toml", include_str!("../experiments/claims.toml")),
    ("fig1.toml", include_str!("../experiments/fig1.toml")),
    ("fig2.toml", include_str!("../experiments/fig2.toml")),
    ("fig3.toml", include_str!("../experiments/fig3.toml")),
    ("fig4.toml", include_str!("../experiments/fig4.toml")),
    ("fig5.toml", include_str!("../experiments/fig5.toml")),
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

/// What drives a simulated run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Drive {
    /// Shapes over the full range of both commands.
    Mixed,
    /// The same, slow enough to stay below the change of mode.
    LowSpeed,
    /// Parallel legs, steered in closed loop.
    LawnMower,
}

/// A simulated log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// `simple` or `hydrofoil`.
    pub plant: String,
    /// What drives it.
    pub excitation: Drive,
    /// Its length \[s\]; a lawn-mower ends after its last leg.
    pub duration_s: f64,
    /// Sample time \[s\].
    #[serde(default = "tenth")]
    pub dt_s: f64,
    /// Seed of commands and noise.
    pub seed: u64,
    /// Of a lawn-mower: the speed of each leg \[m/s\].
    #[serde(default)]
    pub speeds: Vec<f64>,
    /// Of a lawn-mower: the length of a leg \[m\].
    pub leg_m: Option<f64>,
    /// Of a lawn-mower: the distance between legs \[m\].
    pub spacing_m: Option<f64>,
}

const fn tenth() -> f64 {
    0.1
}

/// What is learned, and from what.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelPlan {
    /// By what it is found.
    pub method: Method,
    /// The record that it is learned from.
    pub train: String,
    /// The record on which it is chosen.
    pub validate: String,
    /// The record on which it is judged.
    pub test: String,
    /// One model for each.
    pub seeds: Vec<u64>,
    /// Longest horizon \[samples\].
    pub horizon: usize,
    /// What is predicted.
    #[serde(default = "motion")]
    pub outputs: Vec<String>,
    /// Ranges that it is meant for.
    #[serde(default)]
    pub ranges: GivenRanges,
    /// Settings of a network.
    #[serde(default)]
    pub network: NetworkOptions,
    /// Settings of equations.
    #[serde(default)]
    pub sindy: SindyOptions,
}

fn motion() -> Vec<String> {
    ["u", "v", "r"].map(String::from).to_vec()
}

/// A question, and what is done to answer it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// Its heading.
    pub title: String,
    /// What is asked, and how to read the answer.
    pub text: String,
    /// What is done.
    pub run: Kind,
}

/// Something that the thesis says, and what decides whether it is so.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Claim {
    /// What is claimed.
    pub claim: String,
    /// The experiment that measures it.
    pub experiment: String,
    /// The figure of it that decides.
    pub measure: String,
    /// The claim is reproduced where the figure is at most (at least) this.
    pub reproduced: Bound,
    /// It is reproduced in part where the figure is at most (at least) this.
    pub partly: Bound,
    /// What the figure is.
    pub measured: String,
    /// Why the verdict is what it is.
    pub because: String,
}

/// A bound on a figure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// The figure may be no larger.
    AtMost(f64),
    /// The figure may be no smaller.
    AtLeast(f64),
}

impl Bound {
    /// Whether a figure keeps it; one that is no number does not.
    pub fn holds(self, figure: f64) -> bool {
        match self {
            Self::AtMost(most) => figure <= most,
            Self::AtLeast(least) => figure >= least,
        }
    }

    /// In words.
    pub fn words(self) -> String {
        match self {
            Self::AtMost(most) => format!("≤ {most}"),
            Self::AtLeast(least) => format!("≥ {least}"),
        }
    }

    /// By what factor a figure keeps it; below 1 where it does not.
    pub fn margin(self, figure: f64) -> f64 {
        match self {
            Self::AtMost(most) => most / figure,
            Self::AtLeast(least) => figure / least,
        }
    }
}

/// All of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Records by name.
    pub records: BTreeMap<String, Record>,
    /// Models by name.
    pub models: BTreeMap<String, ModelPlan>,
    /// Experiments by name, in the order of the page.
    pub experiments: Vec<(String, Experiment)>,
    /// What is judged.
    pub claims: Vec<Claim>,
    /// Whether this is the small version.
    pub quick: bool,
}

/// The order of the page; what is not named here comes behind, by name.
const ORDER: [&str; 14] = [
    "fig1",
    "fig2",
    "fig3",
    "fig4",
    "fig5",
    "fig6",
    "fig7",
    "fig8",
    "fig9",
    "sindy",
    "amount",
    "cost",
    "forgetting",
    "table1",
];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Claims {
    claim: Vec<Claim>,
}

impl Plan {
    /// The plan that is built in.
    ///
    /// # Errors
    /// If a file of it is not sound, which the tests exclude.
    pub fn built_in(quick: bool) -> Result<Self, StudyError> {
        let files = BUILT_IN.iter().map(|(name, text)| (PathBuf::from(name), (*text).to_owned()));
        Self::of(files.collect(), quick)
    }

    /// The plan in a folder, all of whose `.toml` files are read.
    ///
    /// # Errors
    /// If the folder or a file of it cannot be read, or says what cannot be.
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

    /// Writes the files that are built in, to be edited.
    ///
    /// # Errors
    /// If a file cannot be written, or one of the name is there that says something else.
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
        let place = |name: &str| ORDER.iter().position(|known| *known == name).unwrap_or(ORDER.len());
        plan.experiments.sort_by(|(a, _), (b, _)| (place(a), a).cmp(&(place(b), b)));
        plan.check()?;
        Ok(plan)
    }

    /// Whether all that is named is there.
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
            known(
                &format!("the claim '{}'", claim.claim),
                "experiment",
                &claim.experiment,
                experiments.iter(),
            )?;
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

/// A file with a table for each name, each of which may have a small version.
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

/// A file that may have a small version.
fn small<T: DeserializeOwned>(text: &str, path: &Path, quick: bool) -> Result<T, StudyError> {
    let mut table: toml::Table = toml_file::parse(text, path)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    apply_quick(&mut table, quick);
    table.try_into().map_err(|error| wrong(text, path, &name, &error))
}

fn wrong(text: &str, path: &Path, name: &str, error: &toml::de::Error) -> StudyError {
    // A table that was merged has lost its lines: the heading is the nearest that is known.
    let heading = text.lines().position(|line| line.trim() == format!("[{name}]")).map_or(1, |i| i + 1);
    StudyError::Entry {
        path: path.to_owned(),
        line: heading,
        name: name.to_owned(),
        message: error.message().to_owned(),
    }
}

/// Takes the table `quick` out, and puts what it says in place where that is asked for.
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
