//! Words behind `--ros-args`.

use std::ffi::OsString;

use hydroid_ros::names::Names;

fn read(words: &[&str]) -> Result<(Names, Vec<String>), String> {
    let (names, own) = Names::read(words.iter().map(OsString::from))?;
    Ok((names, own.into_iter().map(|word| word.into_string().unwrap()).collect()))
}

#[test]
fn names_are_full_names() {
    let (names, own) = read(&["hydroid-ros", "new", "-c", "boat.toml"]).unwrap();
    assert_eq!(own, ["hydroid-ros", "new", "-c", "boat.toml"]);
    assert_eq!(names.topic("/odom"), "/odom");
    assert_eq!(names.topic("odom"), "/odom");
    assert_eq!(names.topic("~/estimate"), "/hydroid/estimate");
}

#[test]
fn remapping_changes_full_names() {
    let (names, _) = read(&[
        "hydroid-ros",
        "--ros-args",
        "-r",
        "odom:=gps/odom",
        "--remap",
        "~/estimate:=/state",
        "-r",
        "hydroid:__node:=model",
        "-r",
        "__ns:=/boat",
    ])
    .unwrap();
    assert_eq!((names.node.as_str(), names.namespace.as_str()), ("model", "/boat"));
    assert_eq!(names.topic("imu"), "/boat/imu");
    assert_eq!(names.topic("odom"), "/boat/gps/odom");
    assert_eq!(names.topic("/boat/odom"), "/boat/gps/odom");
    assert_eq!(names.topic("~/estimate"), "/state");
    assert_eq!(names.topic("~/predicted_path"), "/boat/model/predicted_path");
}

#[test]
fn the_first_rule_for_this_node_counts() {
    let words =
        ["x", "--ros-args", "-r", "other:a:=b", "-r", "hydroid:a:=c", "-r", "a:=d", "-r", "__ns:=boat"];
    let (names, _) = read(&words).unwrap();
    assert_eq!(names.topic("a"), "/boat/c");
}

#[test]
fn parameters_are_options() {
    let words = [
        "x",
        "--ros-args",
        "-p",
        "max_speed:=2.5",
        "-p",
        "dry_run:=true",
        "-p",
        "no_page:=false",
        "--",
        "new",
    ];
    let (names, own) = read(&words).unwrap();
    assert_eq!(own, ["x", "--max-speed=2.5", "--dry-run", "new"]);
    assert_eq!(names.unset, ["no-page"]);
}

#[test]
fn other_words_are_refused() {
    for (words, told) in [
        (&["x", "--ros-args", "-r"][..], "needs a value"),
        (&["x", "--ros-args", "-r", "a"], "NAME:=VALUE"),
        (&["x", "--ros-args", "--params-file", "a.yaml"], "[live]"),
        (&["x", "--ros-args", "new"], "not understood"),
        (&["x", "--ros-args", "-p", "use_sim_time:=True"], "not supported"),
    ] {
        let error = read(words).unwrap_err();
        assert!(error.contains(told), "{error}");
    }
}
