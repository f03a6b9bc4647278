//! Development splits (not kept).
use std::path::PathBuf;
use std::time::Instant;

use hydroid::identify::{Job, Members, Method, SindySettings, identify};
use hydroid::log::{self, PrepareOptions, Selection, Split, Trajectory};
use hydroid::progress::silent;

fn load(folder: &str, files: &[&str], outputs: &str, inputs: &str, wind: Option<&str>) -> Vec<Trajectory> {
    let data = PathBuf::from(std::env::var_os("HYDROID_DATA").unwrap_or("/work/shared/data".into()));
    files
        .iter()
        .map(|f| {
            let raw = log::read(&data.join(folder).join(f)).unwrap();
            let selection =
                Selection { wind: wind.map(|w| w.parse().unwrap()), ..Selection::of(outputs, inputs).unwrap() };
            let mut p = log::prepare(&[raw], &selection, &PrepareOptions::default()).unwrap();
            p.runs.sort_by_key(|r| std::cmp::Reverse(r.len()));
            p.runs.remove(0)
        })
        .collect()
}
fn cut(r: &Trajectory, a: f64, b: f64) -> Trajectory {
    let n = r.len() as f64;
    let mut t = r.slice((a * n) as usize, (b * n) as usize);
    t.name = format!("{}[{a}:{b}]", r.name);
    t
}
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let only = args.get(1).cloned().unwrap_or_default();
    let mut splits: Vec<(String, Vec<Trajectory>, Vec<Trajectory>, Vec<Trajectory>)> = Vec::new();
    let horizon;
    if args[0] == "tug" {
        horizon = 100;
        let r = load("cybership-enterprise1", &["random_run1.csv", "run1.csv", "dptest1.csv"],
            "u=u_mps,v=v_mps,r=r_radps", "u1_vsp1_x,u2_vsp1_y,u3_vsp2_x,u4_vsp2_y,u5_bowthruster", None);
        let (rr, run, dp) = (&r[0], &r[1], &r[2]);
        let mut add = |n: &str, a: Vec<Trajectory>, b: Vec<Trajectory>, c: Vec<Trajectory>| splits.push((n.into(), a, b, c));
        add("A", vec![cut(rr, 0., 0.6)], vec![cut(rr, 0.6, 1.)], vec![run.clone()]);
        add("C", vec![rr.clone()], vec![dp.clone()], vec![run.clone()]);
        add("D", vec![rr.clone()], vec![run.clone()], vec![dp.clone()]);
        add("F", vec![cut(rr, 0., 0.6)], vec![run.clone()], vec![cut(rr, 0.6, 1.)]);
        add("B", vec![cut(rr, 0.4, 1.)], vec![run.clone()], vec![cut(rr, 0., 0.4)]);
        add("G", vec![dp.clone()], vec![run.clone()], vec![rr.clone()]);
    } else {
        horizon = 300;
        let f = ["random_03-Aug-2020_11_04_37.csv", "random_06-Aug-2020_16_24_25_1.csv", "random_06-Aug-2020_16_24_25_4.csv",
            "random_31-Jul-2020_12_29_58.csv", "random_06-Aug-2020_16_24_25_6.csv",
            "zigzag_31-Jul-2020_13_22_52.csv", "zigzag_31-Jul-2020_13_29_19.csv"];
        let r = load("esso-osaka", &f, "u=u_velo,v=vm_velo,r=r_angvelo", "n=n_prop,delta=delta_rudder",
            Some("wind_velo_relative_mid,wind_dir_relative_mid"));
        for i in 0..5 {
            let v = (i + 1) % 5;
            let train = (0..5).filter(|j| *j != i && *j != v).map(|j| r[j].clone()).collect();
            splits.push((format!("L{i}"), train, vec![r[v].clone()], vec![r[i].clone()]));
        }
        splits.push(("Z".into(), (0..4).map(|j| r[j].clone()).collect(), vec![r[4].clone()], vec![r[5].clone(), r[6].clone()]));
    }
    let methods = match args.get(2).map(String::as_str) {
        Some("r") => vec![Method::Recursive], Some("l") => vec![Method::Lagged], Some("lr") => vec![Method::Lagged, Method::Recursive],
        Some("s") => vec![Method::Sindy], Some("sr") => vec![Method::Sindy, Method::Recursive],
        _ => vec![Method::Sindy, Method::Lagged, Method::Recursive],
    };
    let mut sums = vec![0.0; methods.len() + 1];
    let mut count = 0.0;
    let clock = Instant::now();
    for (name, train, validation, test) in splits {
        if !only.is_empty() && !only.contains(&name) && only != "-" { continue; }
        let job = Job {
            methods: methods.clone(),
            split: Split { train, validation, test, notes: Vec::new() },
            reading: Default::default(), horizon, origin_stride: 10, seed: 0,
            sindy: SindySettings { members: Members(0), ..Default::default() },
        };
        let found = match identify(&job, &mut silent()) { Ok(f) => f, Err(e) => { println!("{name}: {e}"); continue; } };
        let mut line = format!("{name:>3} ");
        let mut values = Vec::new();
        for c in &found.candidates {
            let n = c.test.nrmse.last().unwrap();
            let mean = n.iter().sum::<f64>() / n.len() as f64;
            values.push(mean);
            let t = &c.found().trials[c.found().chosen];
            line += &format!("| {mean:.3} ({:.2} {:.2} {:.2}; val {:.3} {}) ", n[0], n[1], n[2], c.validation.score(), if c.test.diverged > 0 { "DIV" } else { "" });
            line += &format!("[{} {:?} {:?} r{} n{}] ", t.structure, t.regression, t.optimizer, t.ridge, t.terms);
            if let Some(p) = c.model.learning.as_ref() { line += &format!("{}", p.settings.window); }
        }
        let b = found.best.map_or(f64::NAN, |b| values[b]);
        let p = found.candidates[0].test.persistence.nrmse.last().unwrap().iter().sum::<f64>() / 3.0;
        println!("{line}| BEST {b:.3} {:?} pers {p:.3}", found.best.map(|b| methods[b].name()));
        values.push(b);
        for (s, v) in sums.iter_mut().zip(&values) { *s += v; }
        count += 1.0;
    }
    let s: Vec<String> = sums.iter().map(|s| format!("{:.4}", s / count)).collect();
    println!("MEAN {} {:?} best: {}   {:.0} s", args[0], args.get(2), s.join(" "), clock.elapsed().as_secs_f64());
}
