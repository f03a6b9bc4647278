//! The archive: description, library, and names that come from hostile logs.

use std::collections::BTreeSet;
use std::io::{Cursor, Read};
use std::path::PathBuf;

use hydroid::model::Body;
use hydroid_export::Options;
use hydroid_export::fmu::{FmuOptions, MARK, Platform, Variables, Version, export};
use proptest::prelude::*;
use quick_xml::events::Event;
use zip::ZipArchive;

use crate::golden::library;
use crate::models;

fn options(version: Version, libraries: Vec<PathBuf>) -> (Options, FmuOptions) {
    (Options { name: String::from("vessel") }, FmuOptions { version, libraries })
}

fn archive(content: Vec<u8>) -> ZipArchive<Cursor<Vec<u8>>> {
    ZipArchive::new(Cursor::new(content)).unwrap()
}

fn files_of(zip: &ZipArchive<Cursor<Vec<u8>>>) -> BTreeSet<String> {
    zip.file_names().map(|name| name.unwrap().into_owned()).collect()
}

/// A file that looks like a library of this version.
fn imitation(folder: &tempfile::TempDir, name: &str, head: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, [head, MARK.as_bytes()].concat()).unwrap();
    path
}

fn elf(machine: u16) -> Vec<u8> {
    let mut head = b"\x7fELF\x02\x01".to_vec();
    head.resize(64, 0);
    head[18..20].copy_from_slice(&machine.to_le_bytes());
    head
}

fn macho(cpu: u32) -> Vec<u8> {
    [0xfeed_facf_u32.to_le_bytes(), cpu.to_le_bytes()].concat()
}

fn pe(machine: u16) -> Vec<u8> {
    let mut head = b"MZ".to_vec();
    head.resize(0x80, 0);
    head[0x3c] = 0x80;
    head.extend(b"PE\0\0");
    head.extend(machine.to_le_bytes());
    head
}

#[test]
fn equal_models_give_equal_bytes_and_all_parts() {
    for (version, folder) in [(Version::V2, "linux64"), (Version::V3, "x86_64-linux")] {
        let (options, fmu) = options(version, vec![library()]);
        let model = models::vessel("otter");
        let files = export(&model, &options, &fmu).unwrap();
        assert_eq!(files, export(&model, &options, &fmu).unwrap());
        assert_eq!((files.len(), files[0].name.as_str()), (1, "vessel.fmu"));
        let zip = archive(files[0].content.clone());
        let names = files_of(&zip);
        if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
            assert!(names.contains(&format!("binaries/{folder}/vessel.so")), "{names:?}");
        }
        for part in ["modelDescription.xml", "resources/model.toml", "documentation/index.html"] {
            assert!(names.contains(part), "{names:?}");
        }
    }
}

#[test]
fn the_platform_of_a_library_is_that_of_its_header() {
    let cases = [
        (elf(62), "x86_64-linux", "linux64"),
        (elf(183), "aarch64-linux", "aarch64-linux"),
        (macho(0x0100_0007), "x86_64-darwin", "darwin64"),
        (macho(0x0100_000c), "aarch64-darwin", "aarch64-darwin"),
        (pe(0x8664), "x86_64-windows", "win64"),
        (pe(0xaa64), "aarch64-windows", "aarch64-windows"),
    ];
    for (head, third, second) in &cases {
        let platform = Platform::of(head).unwrap();
        assert_eq!((platform.folder(Version::V3), platform.folder(Version::V2)), (*third, *second));
        // A header that was cut short is no platform, and no panic.
        for length in 0..head.len().min(10) {
            assert_eq!(Platform::of(&head[..length]), None);
        }
    }
    assert_eq!(Platform::of(&elf(40)), None);
    assert_eq!(Platform::of(b"\xca\xfe\xba\xbe universal"), None);
    let mut far = pe(0x8664);
    far[0x3c..0x40].fill(0xff);
    assert_eq!(Platform::of(&far), None);
    // Several libraries go into one FMU.
    let folder = tempfile::tempdir().unwrap();
    let libraries =
        cases.iter().enumerate().map(|(i, (head, ..))| imitation(&folder, &i.to_string(), head)).collect();
    let (options, fmu) = options(Version::V3, libraries);
    let zip = archive(export(&models::vessel("tug"), &options, &fmu).unwrap().swap_remove(0).content);
    let names = files_of(&zip);
    assert_eq!(names.iter().filter(|name| name.starts_with("binaries/")).count(), 6);
    assert!(names.contains("binaries/x86_64-windows/vessel.dll"));
    assert!(names.contains("binaries/aarch64-darwin/vessel.dylib"));
}

#[test]
fn libraries_that_do_not_fit_are_refused_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let good = imitation(&folder, "good", &elf(62));
    let again = imitation(&folder, "again", &elf(62));
    let text = imitation(&folder, "text", b"#!/bin/sh");
    let other = folder.path().join("other");
    std::fs::write(&other, elf(62)).unwrap();
    for (libraries, told) in [
        (vec![folder.path().join("none")], "cannot read the library"),
        (vec![text], "not a library for Linux"),
        (vec![other], "is not the library hydroid-fmu of this version"),
        (vec![good, again], "second library for x86_64-linux"),
    ] {
        let (options, fmu) = options(Version::V3, libraries);
        let error = export(&models::vessel("otter"), &options, &fmu).unwrap_err().to_string();
        assert!(error.contains(told), "{error}");
        assert!(
            error.contains("cargo build --release -p hydroid-fmu") || error.contains("name one"),
            "{error}"
        );
    }
}

/// Names and values of all attributes of an element, in the description of an FMU.
fn attributes(content: &[u8], element: &str) -> Vec<Vec<(String, String)>> {
    let text = std::str::from_utf8(content).unwrap();
    let mut reader = quick_xml::Reader::from_str(text);
    let mut found = Vec::new();
    loop {
        match reader.read_event().unwrap() {
            Event::Eof => break,
            Event::Text(text) => assert!(text.trim().is_empty(), "only elements"),
            Event::Start(tag) | Event::Empty(tag) if tag.name().as_ref() == element => {
                let of = tag.attributes().map(|attribute| {
                    let attribute = attribute.unwrap();
                    let key = attribute.key.as_ref().to_owned();
                    (key, quick_xml::escape::unescape(&attribute.value).unwrap().into_owned())
                });
                found.push(of.collect());
            }
            _ => {}
        }
    }
    found
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn hostile_names_and_units_stay_inside_their_attributes(
        names in prop::collection::vec(any::<String>(), 5),
        units in prop::collection::vec("[<>&\"'%\\x00-\\x1f\u{7f}-\u{ffff}a-z]{0,12}", 5),
        title in any::<String>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let library = imitation(&folder, "library", &elf(62));
        let mut model = models::model(Body::Equations(models::equations(vec![models::lag()])));
        let d = &mut model.description;
        for (port, (name, unit)) in d.outputs.iter_mut().chain(&mut d.inputs).zip(names.iter().zip(&units)) {
            port.channel.name.clone_from(name);
            port.channel.unit.clone_from(unit);
        }
        for version in [Version::V2, Version::V3] {
            let options = Options { name: title.clone() };
            let fmu = FmuOptions { version, libraries: vec![library.clone()] };
            let file = export(&model, &options, &fmu).unwrap().swap_remove(0);
            let stem = file.name.strip_suffix(".fmu").unwrap();
            prop_assert!(!stem.is_empty() && stem.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'));
            let mut zip = archive(file.content);
            let mut content = Vec::new();
            zip.by_name("modelDescription.xml").unwrap().read_to_end(&mut content).unwrap();
            let element = if version == Version::V2 { "ScalarVariable" } else { "Float64" };
            let variables = attributes(&content, element);
            let expected = Variables::of(&model);
            prop_assert_eq!(variables.len(), expected.all().len());
            let mut seen = BTreeSet::new();
            for (attributes, variable) in variables.iter().zip(expected.all()) {
                let get = |key: &str| attributes.iter().find(|(k, _)| k == key).map(|(_, value)| value.as_str());
                let name = get("name").unwrap();
                prop_assert_eq!(name, variable.name.as_str());
                prop_assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'));
                prop_assert!(seen.insert(name.to_owned()));
                prop_assert!(attributes.iter().all(|(key, _)| [
                    "name", "valueReference", "description", "causality", "variability", "initial", "unit",
                    "nominal", "start", "derivative",
                ].contains(&key.as_str())));
            }
            let files = files_of(&zip);
            prop_assert!(files.iter().all(|name| !name.contains("..") && name.split('/').count() <= 3));
        }
    }
}
