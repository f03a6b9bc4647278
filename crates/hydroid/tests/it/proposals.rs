//! Proposals from tables, and numbers that stand for something else.

use std::fmt::Write as _;

use hydroid::log::{Note, PrepareOptions, RawLog, Selection, prepare};
use hydroid::progress::silent;
use hydroid::recording::{Proposal, converted, read_logs, survey};
use tempfile::TempDir;

/// A boat that weaves for a minute: time \[s\], latitude and longitude \[deg\], heading \[deg\], speed \[m/s\], yaw rate
/// \[rad/s\], and its rudder \[deg\], which a step of 5 s orders.
fn weaving() -> Vec<[f64; 8]> {
    let (mut north, mut east, mut rudder) = (0.0, 0.0, 0.0);
    let mut rows = Vec::new();
    for k in 0..300 {
        let t = 0.2 * f64::from(k);
        let order = if (k / 25) % 2 == 0 { 10.0 } else { -10.0 };
        let (psi, r) = (0.7 + 0.5 * (0.4 * t).sin(), 0.2 * (0.4 * t).cos());
        let wobble = f64::sin(f64::from(k * k));
        let place = [54.1875 + north / 111_300.0, 12.09 + east / 65_200.0];
        let [psi_deg, speed] = [f64::to_degrees(psi) + 0.1 * wobble, 2.0 + 0.02 * wobble];
        rows.push([t, place[0], place[1], psi_deg, speed, r, order, rudder + 0.05 * wobble]);
        north += 0.2 * 2.0 * psi.cos();
        east += 0.2 * 2.0 * psi.sin();
        rudder += 0.1 * (order - rudder);
    }
    rows
}

/// A table with a header, whose cells are chosen from a row by number.
fn table(header: &str, separator: char, columns: &[usize]) -> String {
    let mut text = format!("{header}\n");
    for row in weaving() {
        let cells: Vec<String> = columns.iter().map(|c| format!("{:.8}", row[*c])).collect();
        let line = cells.join(&separator.to_string());
        let _ = writeln!(text, "{}", if separator == ';' { line.replace('.', ",") } else { line });
    }
    text
}

fn proposal(text: &str) -> Proposal {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("day.csv");
    std::fs::write(&file, text).unwrap();
    survey(file.as_path(), None).unwrap().proposal()
}

/// Sensors and inputs of a proposal, as in `hydroid.toml`.
fn proposed(text: &str) -> (Vec<String>, Vec<String>) {
    let proposal = proposal(text);
    let sensors = proposal.selection.sensors.unwrap_or_default();
    let source = |spec: &hydroid::log::ChannelSpec| {
        let text = spec.to_string();
        text.split_once('=').map_or(text.clone(), |(_, column)| column.to_owned())
    };
    let sensors = sensors.columns().map(|(name, spec)| format!("{name}={}", source(spec))).collect();
    (sensors, proposal.selection.inputs.iter().map(source).collect())
}

/// Header, separator, columns of the samples, inputs that are proposed, and remarks.
type Case<'a> = (&'a str, char, &'a [usize], Vec<String>, &'a [&'a str]);

/// Names with a device, a unit or in another language were taken for nothing.
#[test]
fn names_of_tables_are_read_by_their_words() {
    let place = |latitude: &str, longitude: &str, rest: &[&str]| -> Vec<String> {
        let place = [format!("latitude={latitude}"), format!("longitude={longitude}")];
        place.into_iter().chain(rest.iter().map(|text| (*text).to_owned())).collect()
    };
    let cases: [Case<'_>; 7] = [
        (
            "t,gps_lat,gps_lon,hdg_deg,sog_mps,cog_deg,yaw_rate,rudder_cmd",
            ',',
            &[0, 1, 2, 3, 4, 3, 5, 6],
            place(
                "gps_lat [deg]",
                "gps_lon [deg]",
                &["speed=sog_mps", "course=cog_deg", "heading=hdg_deg", "yaw_rate=yaw_rate"],
            ),
            &["rudder_cmd"],
        ),
        (
            "t;Breite;Laenge;Kurs;Fahrt;Ruder",
            ';',
            &[0, 1, 2, 3, 4, 7],
            place("Breite [deg]", "Laenge [deg]", &["heading=Kurs [deg]"]),
            &["Ruder"],
        ),
        (
            "t;Breite;Länge;Kurs über Grund;Fahrt über Grund [kn];Steuerkurs;Drehzahl",
            ';',
            &[0, 1, 2, 3, 4, 3, 6],
            place(
                "Breite [deg]",
                "Länge [deg]",
                &["speed=Fahrt über Grund", "course=Kurs über Grund [deg]", "heading=Steuerkurs [deg]"],
            ),
            &["Drehzahl"],
        ),
        (
            "time\tlat_dd\tlon_dd\tRate of Turn [deg/min]\tTrue Heading\trudder",
            '\t',
            &[0, 1, 2, 3, 3, 6],
            place("lat_dd [deg]", "lon_dd [deg]", &["heading=True Heading [deg]", "yaw_rate=Rate of Turn"]),
            &["rudder"],
        ),
        (
            "time,f9pLat,f9pLon,headingDeg,speedKn,courseDeg,rudderAngle",
            ',',
            &[0, 1, 2, 3, 4, 3, 6],
            place(
                "f9pLat [deg]",
                "f9pLon [deg]",
                &["speed=speedKn [kn]", "course=courseDeg [deg]", "heading=headingDeg [deg]"],
            ),
            &["rudderAngle"],
        ),
        // A target, an accuracy, the wind and the water are none of the vessel's motion.
        (
            "t,lat,lon,target_lat,target_lon,heading,heading_accuracy,wind_speed,stw,rudder",
            ',',
            &[0, 1, 2, 1, 2, 3, 4, 4, 4, 6],
            place("lat [deg]", "lon [deg]", &["heading=heading [deg]"]),
            &["rudder"],
        ),
        // A part of a word is no word.
        (
            "t,platform,long_haul,lat,lon,heading,trudder,propane,motorway,rudder",
            ',',
            &[0, 1, 2, 1, 2, 3, 4, 5, 4, 6],
            place("lat [deg]", "lon [deg]", &["heading=heading [deg]"]),
            &["rudder"],
        ),
    ];
    for (header, separator, columns, sensors, inputs) in cases {
        let found = proposed(&table(header, separator, columns));
        assert_eq!(found.0, sensors, "{header}");
        assert_eq!(found.1, inputs, "{header}");
    }
    let velocities = proposal(&table("t,u_mps,v_mps,r_radps,u_true,rudder", ',', &[0, 4, 5, 5, 4, 6]));
    let outputs: Vec<String> = velocities.selection.outputs.iter().map(ToString::to_string).collect();
    assert_eq!(outputs, ["u=u_mps", "v=v_mps", "r=r_radps"]);
}

/// The course was taken for the heading beside a compass, a yaw rate for nothing without a heading, and a shaft for nothing beside a
/// command of the rudder.
#[test]
fn what_one_name_says_does_not_hide_the_others() {
    let german = table(
        "t;Breite;Länge;Kurs [deg];Kompass [deg];Drehrate [rad/s];Ruder;Drehzahl [1/min]",
        ';',
        &[0, 1, 2, 3, 3, 5, 6, 4],
    );
    let (sensors, inputs) = proposed(&german);
    let place = ["latitude=Breite [deg]", "longitude=Länge [deg]", "heading=Kompass", "yaw_rate=Drehrate"];
    assert_eq!(sensors, place);
    assert_eq!(inputs, ["Ruder", "Drehzahl"]);

    let text =
        table("t,lat,lon,gyro_z [rad/s],rudder_cmd [deg],shaft [rps],motor_cmd", ',', &[0, 1, 2, 5, 6, 4, 0]);
    let constant: String = text
        .lines()
        .enumerate()
        .map(|(k, line)| match line.rsplit_once(',') {
            Some((front, _)) if k > 0 => format!("{front},7\n"),
            _ => format!("{line}\n"),
        })
        .collect();
    let (sensors, inputs) = proposed(&constant);
    assert_eq!(sensors, ["latitude=lat [deg]", "longitude=lon [deg]", "yaw_rate=gyro_z"]);
    assert_eq!(inputs, ["rudder_cmd", "shaft"]);
    let said = "`motor_cmd` is constant (7), and is not proposed";
    assert!(proposal(&constant).remarks.iter().any(|remark| remark.contains(said)));
    // A speed without a course is said also where there is nothing else.
    let alone = table("t,speed [m/s],gyro_z [rad/s],rudder_cmd", ',', &[0, 4, 5, 6]);
    assert!(proposal(&alone).remarks.iter().any(|remark| remark.contains("`speed` is not proposed")));
}

/// Set-point, command and feedback of an actuator were three inputs.
#[test]
fn an_actuator_has_one_input() {
    for (names, expected) in [
        ("rudder_setpoint,rudder_cmd,rudder_meas", &["rudder_cmd"][..]),
        ("Rudder Feedback,Rudder Order", &["Rudder Order"]),
        ("rudder_target,rudder_actual", &["rudder_actual"]),
        ("Ruder_Soll,Ruder_Befehl,Ruder_Ist", &["Ruder_Befehl"]),
        ("throttle,engine_rpm,steering,rudder_angle", &["throttle", "steering"]),
        ("thr_port_cmd,thr_stbd_cmd,rpm_left,rpm_right", &["thr_port_cmd", "thr_stbd_cmd"]),
        ("leftPwmUs,rightPwmUs,leftRpm,rightRpm", &["leftPwmUs", "rightPwmUs"]),
        ("motor1_cmd,motor2_cmd,motor1_fb,motor2_fb,motor_temp", &["motor1_cmd", "motor2_cmd"]),
        ("engine_rpm,thruster_rpm,thruster_angle", &["engine_rpm", "thruster_rpm", "thruster_angle"]),
        // The set-point of a heading is that of a controller.
        ("rudder,heading_cmd", &["rudder"]),
        ("thrust_left,thrust_right,psi_setpoint", &["thrust_left", "thrust_right"]),
        ("speed_order,rudder", &["speed_order", "rudder"]),
    ] {
        let width = names.split(',').count();
        let columns: Vec<usize> = [0, 1, 2, 3].into_iter().chain((0..width).map(|k| 6 + k % 2)).collect();
        let text = table(&format!("t,lat,lon,heading,{names}"), ',', &columns);
        assert_eq!(proposed(&text).1, expected, "{names}");
        let proposal = proposal(&text);
        let named = |name: &&str| proposal.remarks.iter().any(|remark| remark.contains(*name));
        assert!(
            names.split(',').filter(|name| *name != "motor_temp").all(|name| named(&name)),
            "{names}: {proposal:?}"
        );
    }
    // Where the words do not say which is the command, it is the one that is held.
    for names in ["delta,rudder", "rudder,delta"] {
        let text = table(&format!("t,lat,lon,heading,{names}"), ',', &[0, 1, 2, 3, 7, 6]);
        assert_eq!(proposed(&text).1, [names.split_once(',').unwrap().1]);
    }
}

/// Columns without words of commands are found by their values.
#[test]
fn pulse_widths_without_a_name_are_commands() {
    let mut text = "t,lat,lon,heading,ch1,ch3,mode\n".to_owned();
    for row in weaving() {
        let pulse = 1500.0 + 10.0 * row[6] * f64::from(u8::from(row[0] > 10.0));
        let _ =
            writeln!(text, "{},{:.8},{:.8},{},{pulse},{},3", row[0], row[1], row[2], row[3], 3000.0 - pulse);
    }
    assert_eq!(proposed(&text).1, ["ch1", "ch3"]);
}

/// Velocities that are computed from a table by its proposal.
fn read(text: &str) -> Result<(RawLog, Vec<Note>), String> {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("day.csv");
    std::fs::write(&file, text).unwrap();
    let mut selection = survey(file.as_path(), None).unwrap().proposal().selection;
    let (logs, notes) = read_logs(&[&file], &mut selection, &PrepareOptions::default(), &mut silent())
        .map_err(|error| error.to_string())?;
    Ok((converted(&logs[0], &selection, &mut Vec::new()).map_err(|error| error.to_string())?, notes))
}

fn says(notes: &[Note], text: &str) -> bool {
    notes.iter().any(|note| note.message.contains(text) && note.remedy.is_some())
}

fn column<'a>(log: &'a RawLog, name: &str) -> &'a [f64] {
    &log.columns[log.position(name).unwrap()].values
}

/// A table with positions, speed and heading in text.
fn disguised(write: impl Fn(usize, [f64; 4]) -> [String; 4]) -> String {
    let mut text = "t,lat,lon,heading,sog_mps,cog_deg,rudder\n".to_owned();
    for (k, row) in weaving().into_iter().enumerate() {
        let [latitude, longitude, heading, speed] = write(k, [row[1], row[2], row[3], row[4]]);
        let _ =
            writeln!(text, "{:.1},{latitude},{longitude},{heading},{speed},{:.3},{}", row[0], row[3], row[6]);
    }
    text
}

/// Positions as NMEA writes them were left out, one by one.
#[test]
fn degrees_and_minutes_are_read_as_such() {
    let degrees =
        disguised(|_, [a, b, psi, u]| [format!("{a:.9}"), format!("{b:.9}"), psi.to_string(), u.to_string()]);
    let minutes = |x: f64| format!("{:.7}", 100.0 * x.floor() + 60.0 * x.fract());
    let ddmm = disguised(|_, [a, b, psi, u]| [minutes(a), minutes(b), psi.to_string(), u.to_string()]);
    let (plain, notes) = read(&degrees).unwrap();
    assert!(!says(&notes, "degrees and minutes"), "{notes:?}");
    let (read_as, notes) = read(&ddmm).unwrap();
    assert!(says(&notes, "are read as degrees and minutes (ddmm.mmmm)"), "{notes:?}");
    for name in ["x", "y"] {
        let pairs = column(&plain, name).iter().zip(column(&read_as, name));
        assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 0.02), "{name}: {:?}", pairs.clone().next_back());
    }
    // Numbers of another form are refused.
    let other = disguised(|_, [a, b, psi, u]| {
        [format!("{}", 1e3 * a), format!("{}", 1e3 * b), psi.to_string(), u.to_string()]
    });
    let error = read(&other).unwrap_err();
    assert!(error.contains("is neither in degrees nor in degrees and minutes"), "{error}");
}

/// Numbers that stand for a missing measurement were motion.
#[test]
fn numbers_for_missing_measurements_of_sensors_are_none() {
    let text = disguised(|k, [a, b, psi, u]| {
        let is_lost = k % 40 < 3;
        let or = |none: &str, x: f64| if is_lost { none.to_owned() } else { format!("{x:.9}") };
        [or("99.99", a), or("999", b), or("511", psi), or("-999", u)]
    });
    let (log, notes) = read(&text).unwrap();
    for expected in [
        "`lat` is 99.99 in 24 rows",
        "`lon` is 999 in 24 rows",
        "`heading` is 511 in 24 rows",
        "`sog_mps` is -999 in 24 rows",
    ] {
        assert!(says(&notes, expected), "{expected}: {notes:?}");
    }
    let u = column(&log, "u");
    assert!(u.iter().all(|u| u.is_nan() || (1.5..2.5).contains(u)), "{u:?}");
}

#[test]
fn numbers_for_missing_values_of_channels_are_none() {
    let of = |u: &dyn Fn(usize) -> f64, n: &dyn Fn(usize) -> f64| {
        let mut text = "t,u,r,n_cmd\n".to_owned();
        for k in 0..400 {
            let _ =
                writeln!(text, "{},{},{:.4},{}", 0.1 * k as f64, u(k), 0.1 * (0.1 * k as f64).cos(), n(k));
        }
        let folder = TempDir::new().unwrap();
        let file = folder.path().join("log.csv");
        std::fs::write(&file, text).unwrap();
        let log = hydroid::log::read(&file).unwrap();
        prepare(&[log], &Selection::default(), &PrepareOptions::default()).unwrap()
    };
    let largest = |of: &hydroid::log::Table, column: usize| {
        of.column(column).fold(0.0, |most: f64, x| x.abs().max(most))
    };
    let u = |k: usize| 1.0 + 0.3 * (0.05 * k as f64).sin();
    let n = |k: usize| (k / 50 % 3) as f64;
    for none in [99.99, -999.0, 9999.0, 65535.0, 42.0] {
        let prepared = of(&|k| if k % 70 == 5 { none } else { u(k) }, &n);
        assert!(says(&prepared.notes, "`u` is"), "{none}: {:?}", prepared.notes);
        assert!(prepared.runs.iter().all(|run| largest(&run.outputs, 0) < 1.4), "{none}");
    }
    for none in [999.0, 65535.0, -32768.0] {
        let prepared = of(&u, &|k| if k % 70 == 5 { none } else { n(k) });
        assert!(says(&prepared.notes, "`n_cmd` is"), "{none}: {:?}", prepared.notes);
        assert!(prepared.runs.iter().all(|run| largest(&run.inputs, 0) < 3.0), "{none}");
    }
    // Steps of a command, a single outlier and a rest are values.
    for prepared in [
        of(&u, &|k| if k % 70 < 9 { 400.0 } else { n(k) }),
        of(&|k| if k == 7 { 50.0 } else { u(k) }, &n),
        of(&|k| if k < 100 { 0.0 } else { 1.0 + 1e-3 * u(k) }, &n),
    ] {
        assert!(!says(&prepared.notes, "stands for a missing value"), "{:?}", prepared.notes);
    }
}

/// Recordings of vessels, ground vehicles and aircraft, and the fields that are proposed as commands: outputs to
/// actuators, their orders, or their state; never a measurement of the vessel.
const COMMANDS: [(&str, &[&str]); 18] = [
    ("fleet/formats/otter.BIN", &["RCOU.C1", "RCOU.C3"]),
    ("fleet/formats/otter.ulg", &["actuator_outputs.output[0]", "actuator_outputs.output[1]"]),
    ("fleet/formats/otter_lz4.mcap", &["/actuators.pwm_us[0]", "/actuators.pwm_us[1]"]),
    ("fleet/formats/otter_ros1.bag", &["/actuators.pwm_us[0]", "/actuators.pwm_us[1]"]),
    ("fleet/formats/otter_ros2_sqlite", &["/actuators.pwm_us[0]", "/actuators.pwm_us[1]"]),
    ("fleet/formats/otter_truncated.mcap", &["/actuators.pwm_us[0]", "/actuators.pwm_us[1]"]),
    ("fleet/formats/tanker.nmea", &["RSA.starboard", "RPM.speed"]),
    ("wild/delorean_00000041.BIN", &["RCOU.C1", "RCOU.C2", "RCOU.C3", "RCOU.C4"]),
    ("wild/small.BIN", &["RCOU.C1", "RCOU.C2", "RCOU.C3", "RCOU.C4"]),
    (
        "wild/mcap_test_ulog.ulg",
        &["actuator_motors.control[0]", "actuator_servos.control[0]", "actuator_servos.control[1]"],
    ),
    (
        "wild/sample_log_small.ulg",
        &[
            "actuator_outputs.output[0]",
            "actuator_outputs.output[1]",
            "actuator_outputs.output[2]",
            "actuator_outputs.output[3]",
            "actuator_outputs.output[4]",
            "actuator_outputs.output[5]",
            "actuator_outputs.output[6]",
            "actuator_outputs.output[7]",
        ],
    ),
    (
        "wild/example.bag",
        &[
            "/turtle2/cmd_vel.linear.x",
            "/turtle2/cmd_vel.angular.z",
            "/turtle1/cmd_vel.linear.x",
            "/turtle1/cmd_vel.angular.z",
        ],
    ),
    ("wild/rowdy_part.csv", &["Rudder"]),
    ("wild/kolmak_2023_09_07.csv", &[]),
    ("wild/astra_regata.log", &[]),
    ("wild/gofree-merrimac.log", &[]),
    ("wild/psaros0821.TXT", &[]),
    ("wild/tinylog.txt", &[]),
];

#[test]
fn no_proposed_command_of_a_recording_is_a_measurement() {
    let Some(folder) = std::env::var_os("HYDROID_DATA") else {
        eprintln!("skipped: no HYDROID_DATA");
        return;
    };
    for (file, expected) in COMMANDS {
        let path = std::path::Path::new(&folder).join(file);
        let proposal = survey(path.as_path(), None).unwrap_or_else(|e| panic!("{file}: {e}")).proposal();
        let found: Vec<String> = proposal
            .selection
            .inputs
            .iter()
            .map(|spec| spec.to_string().rsplit('=').next().unwrap_or_default().to_owned())
            .collect();
        assert_eq!(found, expected, "{file}");
    }
}
