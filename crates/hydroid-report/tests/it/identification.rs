//! The page of an identification.

use std::ops::ControlFlow;
use std::sync::OnceLock;

use hydroid::excitation::Excitation;
use hydroid::identify::{
    Candidate, GivenRanges, Grade, IdentifyResult, Job, Method, MotionOption, NetworkTrainingOptions,
    RateLimitOption, SindyOptions, identify, verdicts,
};
use hydroid::log::{Channel, Note, Split, Table, Trajectory};
use hydroid::model::Reading;
use hydroid::progress::silent;
use hydroid::simulate::{Options, simulate};
use hydroid_core::craft::Craft;
use hydroid_core::model::sparse::{Equations, Gate, Real, Signal, Term};
use hydroid_report::{Context, ReportError, identification, style};

/// A simulated run with channel names that need escaping.
fn run(seed: u64) -> Trajectory {
    let vessel = Craft::simple();
    let options = Options { duration_s: 120.0, seed, ..Options::new(vessel, Excitation::Mixed) };
    let mut run = simulate(&options, &mut |_| ControlFlow::Continue(()))
        .unwrap()
        .to_trajectory(&["u", "v", "r"])
        .unwrap();
    let renamed = |table: &Table, names: &[&str]| {
        let channels: Vec<Channel> =
            table.channels().iter().zip(names).map(|(c, n)| Channel::new(*n, c.unit.clone())).collect();
        Table::new(channels, table.rows(0, table.len()).to_vec())
    };
    run.outputs = renamed(&run.outputs, &["u", "v_<b>", "r&\"'"]);
    run.inputs = renamed(&run.inputs, &["PP_cmd", "</svg><script>"]);
    run.truth = None;
    run.name = format!("run <i>{seed}</i>");
    run
}

fn job() -> Job {
    let mut test = run(3);
    let channels = test.outputs.channels().to_vec();
    let mut values = test.outputs.rows(0, test.len()).to_vec();
    values[3 * 400..3 * 430].fill(f64::NAN);
    test.outputs = Table::new(channels, values);
    Job {
        methods: vec![Method::Sindy],
        split: Split {
            train: vec![run(1)],
            validation: vec![run(2)],
            test: vec![test],
            notes: vec![Note::warning("split <by hand>").with_remedy("give more runs")],
        },
        reading: Reading::default(),
        boat: hydroid::boat::Boat::default(),
        horizon: 20,
        origin_stride: 5,
        seed: 7,
        ranges: GivenRanges::new(),
        networks: NetworkTrainingOptions::default(),
        vessel: None,
        motion: MotionOption::default(),
        rate_limits: RateLimitOption::default(),
        allow_feedback: Vec::new(),
        sindy: SindyOptions { degree: Some(2), window: Some(0.5), ..SindyOptions::default() },
    }
}

fn identified() -> &'static (Job, IdentifyResult) {
    static DONE: OnceLock<(Job, IdentifyResult)> = OnceLock::new();
    DONE.get_or_init(|| {
        let job = job();
        let result = identify(&job, &mut silent()).unwrap();
        (job, result)
    })
}

fn context() -> Context {
    Context {
        title: "Trials of <M/S \"A&B\">".into(),
        command: "hydroid identify a.csv && echo '<done>'".into(),
        sources: vec!["a<1>.csv".into()],
        notes: vec![Note::info("a<1>.csv: 3 samples dropped"), Note::warning("b.csv: irregular <clock>")],
        ..Context::default()
    }
}

/// Checks that elements are closed in order.
fn assert_balanced(page: &str) {
    const VOID: [&str; 2] = ["meta", "br"];
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page.strip_prefix("<!DOCTYPE html>").expect("a page starts with its type");
    while let Some(start) = rest.find('<') {
        let end = start + rest[start..].find('>').expect("a tag ends");
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "closed out of order before: {rest:.100}");
            continue;
        }
        let name = tag.split([' ', '/']).next().unwrap_or_default();
        assert!(!name.is_empty() && name.bytes().all(|b| b.is_ascii_alphanumeric()), "<{tag}>");
        assert_eq!(tag.matches('"').count() % 2, 0, "<{tag}>");
        if name == "style" {
            rest = &rest[rest.find("</style>").expect("a style ends")..];
        }
        if !tag.ends_with('/') && !VOID.contains(&name) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
}

fn page(result: &IdentifyResult, split: &Split) -> String {
    let page = identification(result, split, &context()).unwrap();
    assert_balanced(&page);
    for foreign in ["http:", "https:", "src=", "<link", "<img", "<iframe", "@import", "url(", "NaN", "inf\""]
    {
        assert!(!page.contains(foreign), "{foreign} in the page");
    }
    let ids: Vec<&str> = page.split(" id=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    let unique: std::collections::HashSet<&&str> = ids.iter().collect();
    assert_eq!(unique.len(), ids.len(), "{ids:?}");
    page
}

#[test]
fn the_page_is_whole_and_says_what_was_found() {
    let (job, result) = identified();
    let page = page(result, &job.split);
    assert!(page.len() < 1_000_000, "{} bytes", page.len());
    for text in [
        "Trials of &lt;M/S &quot;A&amp;B&quot;&gt;",
        "v_&lt;b&gt;",
        "&lt;/svg&gt;&lt;script&gt;",
        "run &lt;i&gt;3&lt;/i&gt;",
        "Irregular &lt;clock&gt;",
        "split &lt;by hand&gt;",
        "hydroid identify a.csv &amp;&amp; echo",
        "PP_cmd",
        "d(u)/dt =",
        "NRMSE of u",
        "standard error",
        "\\pm",
        "autocorrelation",
        "share of the training range",
        "chosen",
    ] {
        assert!(page.to_lowercase().contains(&text.to_lowercase()), "{text} is missing");
    }
    assert!(!page.contains("<i>3</i>") && !page.contains("v_<b>"));
    for verdict in &result.verdicts {
        assert!(page.contains(style::grade(verdict.grade).0));
    }
    for heading in ["Equations", "Error over", "Measured against", "Residuals", "Data", "chosen", "Settings"]
    {
        assert!(page.contains(heading), "{heading}");
    }
}

#[test]
fn the_same_input_gives_the_same_bytes() {
    let (job, result) = identified();
    assert_eq!(page(result, &job.split), page(result, &job.split));
    let mut slower = result.clone();
    slower.candidates[0].train_seconds += 100.0;
    assert_eq!(page(result, &job.split), page(&slower, &job.split));
}

#[test]
fn a_useless_or_diverging_model_is_called_that_first() {
    let (job, result) = identified();
    let mut useless = result.clone();
    for verdict in &mut useless.verdicts {
        (verdict.grade, verdict.nrmse) = (Grade::NotIdentified, f64::INFINITY);
    }
    let text = page(&useless, &job.split);
    assert!(text.contains("This model is of no use.") && text.contains("Not identified"));
    useless.verdicts[0].grade = Grade::Good;
    assert!(page(&useless, &job.split).contains("Usable in part."));

    let mut diverged = result.clone();
    diverged.best = None;
    assert!(page(&diverged, &job.split).contains("No model is recommended."));
    diverged.candidates[0].test.as_mut().unwrap().diverged = 3;
    let text = page(&diverged, &job.split);
    assert!(text.contains("Do not use this model: it diverges."));
    let banner = text.find("Do not use this model").unwrap();
    assert!(banner < text.find("class=\"tiles\"").unwrap());
}

#[test]
fn without_candidates_there_is_a_page_that_says_so() {
    let (job, _) = identified();
    let nothing = IdentifyResult {
        candidates: vec![],
        best: None,
        verdicts: vec![],
        warnings: vec![],
        ranges: vec![],
        cross_validation: None,
        currents: None,
        for_trials: None,
        missing: None,
    };
    assert!(page(&nothing, &job.split).contains("Nothing was identified."));
    let empty = Split { train: vec![], validation: vec![], test: vec![], notes: vec![] };
    assert!(page(&nothing, &empty).contains("There are no runs."));
}

#[test]
fn without_windows_trials_or_variation_there_is_a_page() {
    let (job, result) = identified();
    let mut poor = result.clone();
    let candidate = &mut poor.candidates[0];
    found_mut(candidate).trials.clear();
    let test = candidate.test.as_mut().unwrap();
    test.windows = 0;
    test.horizons.clear();
    for table in [&mut test.nrmse, &mut test.mae, &mut test.rmse] {
        table.clear();
    }
    poor.verdicts = verdicts(candidate.judged(), &[]);
    let text = page(&poor, &job.split);
    assert!(text.contains("This model was not judged.") && text.contains("No settings were tried."));

    // Test runs that are all NaN, constant, or of a single sample.
    for value in [f64::NAN, 1.0, 1e300] {
        for samples in [1, 2, 200] {
            let mut split = job.split.clone();
            let run = &mut split.test[0];
            run.outputs = Table::new(run.outputs.channels().to_vec(), vec![value; 3 * samples]);
            run.inputs = Table::new(run.inputs.channels().to_vec(), vec![0.0; 2 * samples]);
            split.train[0] = run.clone();
            page(result, &split);
        }
    }
}

#[test]
fn errors_that_are_not_finite_are_told_as_such() {
    let (job, result) = identified();
    let mut wild = result.clone();
    let candidate = &mut wild.candidates[0];
    for (h, row) in candidate.test.as_mut().unwrap().nrmse.iter_mut().enumerate() {
        row[0] = if h % 2 == 0 { f64::NAN } else { f64::INFINITY };
        row[1] = 1e200;
    }
    for trial in &mut found_mut(candidate).trials {
        trial.score = Some(f64::INFINITY);
    }
    found_mut(candidate).trials[0].score = None;
    found_mut(candidate).condition = f64::INFINITY;
    found_mut(candidate).fit.scaled.clear();
    found_mut(candidate).unidentifiable =
        vec![Term::constant(), Term::monomial(&[0]), Term::monomial(&[10_000])];
    wild.verdicts = verdicts(candidate.judged(), &[]);
    let text = page(&wild, &job.split);
    assert!(text.contains('∞') && text.contains("cannot distinguish some terms"));
}

#[test]
fn rollouts_that_blow_up_are_drawn_as_far_as_the_panel_goes() {
    let (job, result) = identified();
    let mut wild = result.clone();
    let candidate = &mut wild.candidates[0];
    // du/dt = 1e6 u^2: not finite within a few samples.
    let terms = vec![Term::constant(), Term::monomial(&[0, 0])];
    let equations = Equations::new(terms, [1.0, 1e6].repeat(3), 3, 2, job.split.test[0].dt, 1).unwrap();
    found_mut(candidate).fit.equations = equations.clone();
    found_mut(candidate).fit.scaled = vec![0.5; 6];
    candidate.model.body = hydroid::model::Body::Equations(std::sync::Arc::new(equations));
    let text = page(&wild, &job.split);
    assert!(text.contains("it diverges there"));
    assert!(text.contains("Too few finite residuals") || text.contains("residual of u"));
}

#[test]
fn lags_and_modes_are_told_in_words_and_gates_stand_once() {
    let (job, result) = identified();
    let mut gated = result.clone();
    let candidate = &mut gated.candidates[0];
    let gate = Gate { centre: Real(0.5), slope: Real(11.0) };
    let terms: Vec<Term> =
        [Term::monomial(&[0]), Term::monomial(&[5])].iter().flat_map(|term| term.gated(0, gate)).collect();
    let lag = Signal::Lag { input: 3, time_constant_s: Real(1.0) };
    let row = [-1.0, -2.0, 0.25, 0.0];
    let dt = job.split.test[0].dt;
    let equations = Equations::with_signals(terms, row.repeat(3), 3, 2, vec![lag], dt, 1).unwrap();
    let found = found_mut(candidate);
    found.fit.equations = equations.clone();
    found.fit.scaled = vec![0.5; 12];
    let ensemble = found.ensemble.as_mut().unwrap();
    ensemble.members = vec![row.repeat(3), row.map(|x| 1.1 * x).repeat(3)];
    (ensemble.low, ensemble.high) = (vec![-3.0; 12], vec![-0.125; 12]);
    ensemble.inclusion = [1.0, 0.25, 1.0, 1.0].repeat(3);
    candidate.model.members = hydroid::model::Members::new(&ensemble.members);
    candidate.model.body = hydroid::model::Body::Equations(std::sync::Arc::new(equations));
    let text = page(&gated, &job.split);
    for part in [
        "acts through a first-order lag of <b>1.00 s</b>, found in these logs",
        "<b>0.500\u{a0}m/s</b>, over about ±0.2\u{a0}m/s (10 to 90 %)",
        "% of the time above",
        "s = sigma(11.00 (u - 0.5000))",
        "−3.000 … −0.1250",
        "25 % ⚠",
        "90 % of the ensemble",
        "front",
        "within one standard error of the best",
    ] {
        assert!(text.contains(part), "{part} is missing");
    }
    assert!(!text.contains("below(u") && !text.contains("above(u"), "a gate is written out");
}

#[test]
fn runs_of_another_vessel_are_refused() {
    let (job, result) = identified();
    let mut split = job.split.clone();
    split.test[0].outputs = Table::new(vec![Channel::new("u", "m/s")], vec![0.0; 10]);
    let refused = identification(result, &split, &context());
    assert!(matches!(refused, Err(ReportError::OtherRuns { .. })));
}

fn found_mut(candidate: &mut Candidate) -> &mut hydroid::sindy::SearchResult {
    match &mut candidate.training {
        hydroid::identify::Training::Equations(found) | hydroid::identify::Training::Recursive(found) => {
            std::sync::Arc::make_mut(found)
        }
        hydroid::identify::Training::Network(_)
        | hydroid::identify::Training::Committee(_)
        | hydroid::identify::Training::GreyBox(_) => {
            panic!("it has no search")
        }
    }
}
