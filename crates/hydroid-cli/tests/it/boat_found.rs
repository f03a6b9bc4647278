//! From a recording to a model, without a number that the recording already contains.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::common::{Service, done, run, text};

/// Two pulse widths, and the motion that follows their distance from 1520 and 1460 us.
fn table(path: &Path) {
    let mut log = "t [s],u [m/s],v [m/s],r [rad/s],pwm_right,pwm_left\n".to_owned();
    let (mut u, mut v, mut r) = (0.0_f64, 0.0_f64, 0.0_f64);
    for k in 0..3000_u32 {
        let step = |n: u32| f64::from((k / 30 * n + 5 * n) % 9) / 4.0 - 1.0;
        let at_rest = k % 600 < 120;
        let [right, left] = if at_rest { [0.0; 2] } else { [step(4), step(7)] };
        let row = [f64::from(k) * 0.1, u, v, r, 1520.0 + 300.0 * right, 1460.0 + 300.0 * left];
        log += &row.map(|x| format!("{x:.5}")).join(",");
        log.push('\n');
        u += 0.1 * (0.8 * (left + right) - 0.5 * u * u.abs() - 0.3 * u);
        v += 0.1 * (-0.4 * v - 0.3 * r);
        r += 0.1 * (0.3 * (left - right) - 0.9 * r);
    }
    std::fs::write(path, log).unwrap();
}

#[test]
fn a_proposal_is_complete() {
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    table(&at.join("day.csv"));
    done(at, "inspect day.csv --write-config");
    let config = std::fs::read_to_string(at.join("hydroid.toml")).unwrap();
    for line in ["[boat.inputs.pwm_left] # pwm_left", "neutral = 1460 ", "neutral = 1520 ", "scale = 400 "] {
        assert!(config.contains(line), "{line} in\n{config}");
    }
    done(at, "identify day.csv --methods sindy -o out");
    let model = text(&done(at, "inspect out/sindy.safetensors --json").stdout);
    let model: Value = serde_json::from_str(&model).unwrap();
    let description = &model["description"];
    assert_eq!(description["boat"]["inputs"]["pwm_right"]["neutral"], 1520.0);
    let spec = &description["reading"]["selection"]["inputs"][0];
    assert_eq!(spec, "pwm_right=(pwm_right [us] - 1520) * 0.0025 [1]");
    // Another log with the same raw values, in other columns.
    let renamed =
        std::fs::read_to_string(at.join("day.csv")).unwrap().replacen("pwm_right,pwm_left", "pr,pl", 1);
    std::fs::write(at.join("next.csv"), renamed).unwrap();
    let same = "evaluate out/sindy.safetensors day.csv --json";
    let other = "evaluate out/sindy.safetensors next.csv --inputs pwm_right=pr,pwm_left=pl --json";
    let nrmse = |args: &str| {
        let document: Value = serde_json::from_str(&text(&done(at, args).stdout)).unwrap();
        document.pointer("/channels").or(document.pointer("/0/channels")).unwrap_or(&document).to_string()
    };
    assert_eq!(nrmse(same).replace("day.csv", ""), nrmse(other).replace("next.csv", ""));
    let refused = run(at, "evaluate out/sindy.safetensors next.csv --inputs pwm_right=pr*0.5,pwm_left=pl");
    assert!(text(&refused.stderr).contains("has a formula in two places"), "{}", text(&refused.stderr));
}

/// The proposal for a recording of an autopilot gives a model that predicts another run.
#[test]
fn a_recording_of_an_autopilot() {
    let Some(data) = std::env::var_os("HYDROID_DATA").map(PathBuf::from) else {
        println!("skipped: no HYDROID_DATA");
        return;
    };
    let otter = data.join("fleet/formats/otter.BIN");
    let folder = TempDir::new().unwrap();
    let at = folder.path();
    std::fs::copy(otter, at.join("otter.BIN")).unwrap();
    done(at, "inspect otter.BIN --write-config");
    let out = text(&done(at, "identify otter.BIN --methods sindy -o out").stdout);
    let values =
        "neutral 0 (stated), limits -1 to 1 (stated); as it is sent, neutral 1500 us, limits 1100 to 1900 us";
    assert!(out.contains("thruster") && out.contains(values), "{out}");
    // The service answers with pulses, too; at rest they are neutral.
    let service = [
        "control",
        "out/sindy.safetensors",
        "--task",
        "circle",
        "--horizons",
        "1",
        "--tolerance",
        "100",
        "-",
    ];
    let mut service = Service::start(at, &service);
    for k in 0..40 {
        let t = 0.2 * f64::from(k);
        let line = if k < 3 {
            json!({ "t": t, "x": 0.5 * t, "y": 0.0, "psi": 0.0, "u": 0.5, "v": 0.0, "r": 0.0 })
        } else {
            json!({ "t": t, "u": 0.5, "v": 0.0, "r": 0.0 })
        };
        let answer = service.ask(&line.to_string());
        for name in ["throttle_left", "throttle_right"] {
            let [command, raw] = ["command", "raw"].map(|key| answer[key][name].as_f64().unwrap());
            assert!((raw - (1500.0 + 400.0 * command)).abs() < 1e-6, "{answer}");
            assert!(k < 39 || (answer["control"] == "blind" && raw == 1500.0), "{answer}");
        }
    }
    service.kill();
    // The unit of the heading is that of the line.
    for key in ["psi [deg]", "heading [deg]"] {
        let args = ["control", "out/sindy.safetensors", "--task", "circle", "--horizons", "1", "-"];
        let mut service = Service::start(at, &args);
        let answer =
            service.ask(&json!({ "t": 0, "x": 0, "y": 0, key: 90, "u": 0.5, "v": 0, "r": 0 }).to_string());
        let psi = answer["pose"]["psi"].as_f64().unwrap();
        assert!((psi - std::f64::consts::FRAC_PI_2).abs() < 1e-9, "{key}: {answer}");
        service.kill();
    }
    done(at, "export out/sindy.safetensors --to c -o otter.h");
    let header = std::fs::read_to_string(at.join("otter.h")).unwrap();
    assert!(header.contains("as it is sent, neutral 1500 us, limits 1100 to 1900 us"), "{header}");
    assert!(header.contains("otter_from_raw"), "{header}");
    let run6 = data.parent().unwrap().join("reference/users/usv/otter_run6_pwm.csv");
    if !run6.exists() {
        return;
    }
    std::fs::copy(run6, at.join("run6.csv")).unwrap();
    let args = "evaluate out/sindy.safetensors run6.csv --outputs u,v,r --inputs throttle_left=pl,throttle_right=pr --heading psi --horizon 10s --json";
    let shown: Value = serde_json::from_str(&text(&done(at, args).stdout)).unwrap();
    // Raw pulses gave 2.4, 2.9 and 1.9, and 41 windows diverged. Libraries of terms that are about as good in the
    // cross-validation differ by .1 here.
    let last = shown["nrmse"].as_array().unwrap().last().unwrap();
    for (channel, most) in [0.3, 0.6, 0.3].into_iter().enumerate() {
        assert!(last[channel].as_f64().unwrap() < most, "{last}");
    }
    assert_eq!(shown["diverged"], 0);
}
