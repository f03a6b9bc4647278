//! `hydroid export`.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use hydroid::atomic;
use hydroid::config::Adapt;
use hydroid::model::{self, Model};
use hydroid_core::craft::Hull;
use hydroid_export::coefficients::{CoefficientOptions, Inertia};
use hydroid_export::fmu::{FmuOptions, Version};
use hydroid_export::{COptions, Format, Options, Precision, export, identifier};
use serde_json::json;

use super::Outcome;
use crate::args::{Export, Global, Target};
use crate::outputs;

pub fn run(args: &Export, global: Global) -> anyhow::Result<Outcome> {
    let model = at_step(model::read(&args.model)?, args.dt)?;
    check_options(args)?;
    let precision = args.precision.map(Precision::from).unwrap_or_default();
    let format = match args.to {
        Target::C => {
            // The exported adapter has no guard.
            let adaptation = Adapt { no_guard: true, ..args.adaptation.clone() };
            let adapter = args.adapter.then(|| adaptation.options(&model));
            Format::C(COptions { precision, adapter: adapter.transpose()?.map(Box::new) })
        }
        Target::Onnx => Format::Onnx(precision),
        Target::Casadi => Format::Casadi,
        Target::Fmu => Format::Fmu(FmuOptions {
            version: if args.fmi == Some(2) { Version::V2 } else { Version::V3 },
            libraries: args.library.clone(),
        }),
        Target::Sdf => Format::Sdf(coefficient_options(args)?),
        Target::Mss => Format::Mss,
        Target::Latex => Format::Latex(coefficient_options(args)?),
    };
    let (folder, stem) = place(&args.output, args.to)?;
    let name = args.name.clone().or(stem).unwrap_or_else(|| model.description.name.clone());
    let options = Options { name: identifier(&name) };
    let files = export(&model, &format, &options)?;
    let paths: Vec<PathBuf> = files.iter().map(|file| folder.join(&file.name)).collect();
    for path in &paths {
        outputs::check(&[("-o", Some(path))], &[&args.model])?;
    }
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))?;
    for (file, path) in files.iter().zip(&paths) {
        atomic::write(path, |out| out.write_all(&file.content))?;
    }
    if global.json {
        super::print_json(&json!({
            "model": args.model,
            "kind": model.kind(),
            "name": options.name,
            "files": paths,
        }))?;
    } else {
        let list: Vec<String> = paths.iter().map(|path| path.display().to_string()).collect();
        outln!("{} '{}': {}", model.title(), model.description.name, list.join(", "));
    }
    Ok(Outcome::Done)
}

/// Refuses options that have no effect on the format.
fn check_options(args: &Export) -> anyhow::Result<()> {
    let coefficients = [Target::Sdf, Target::Mss, Target::Latex];
    let options: [(&str, bool, &[Target]); 8] = [
        ("--precision", args.precision.is_some(), &[Target::C, Target::Onnx]),
        ("--adapter", args.adapter, &[Target::C]),
        ("--fmi", args.fmi.is_some(), &[Target::Fmu]),
        ("--library", !args.library.is_empty(), &[Target::Fmu]),
        ("--vessel", args.vessel.is_some(), &coefficients),
        ("--speed", args.speed.is_some(), &[Target::Sdf, Target::Latex]),
        ("--length", args.length.is_some(), &[Target::Latex]),
        ("--link", args.link.is_some(), &[Target::Sdf]),
    ];
    for (name, given, formats) in options {
        let list: Vec<String> = formats.iter().map(|format| format.name()).collect();
        ensure!(
            !given || formats.contains(&args.to),
            "{name} has no effect on --to {}: it is an option of {}",
            args.to.name(),
            list.join(", ")
        );
    }
    ensure!(
        args.adapter || args.adaptation == Adapt::default(),
        "the options of the adaptation, such as --forgetting, need --adapter"
    );
    ensure!(
        !args.adaptation.no_guard && args.adaptation.estimate_current.is_none(),
        "the exported adapter has no guard and no current: leave --no-guard and --estimate-current out"
    );
    Ok(())
}

/// A vessel with another sample time.
fn at_step(model: Model, dt: Option<f64>) -> anyhow::Result<Model> {
    let Some(dt) = dt else { return Ok(model) };
    let own = model.description.dt;
    let model = model.at_step(dt)?;
    ensure!(
        model.description.dt == dt,
        "--dt is for vessels: this model was identified with a sample time of {own} s"
    );
    Ok(model)
}

/// Options of the formats of coefficients, with the numbers of a vessel file.
fn coefficient_options(args: &Export) -> anyhow::Result<CoefficientOptions> {
    for (name, value) in [("--speed", args.speed), ("--length", args.length)] {
        ensure!(
            value.is_none_or(|value| value.is_finite() && value > 0.0),
            "{name} is {}: give a positive number",
            value.unwrap_or_default()
        );
    }
    let mut options =
        CoefficientOptions { speed: args.speed, length: args.length, ..CoefficientOptions::default() };
    if let Some(link) = &args.link {
        options.link.clone_from(link);
    }
    if let Some(path) = &args.vessel {
        let vessel = model::read(path)?;
        if let Some(craft) = vessel.craft() {
            let Hull { mass, i_z, x_g, x_udot, y_vdot, y_rdot, n_rdot, size, .. } = craft.hull;
            options.inertia = Some(Inertia { mass, i_z, x_g, x_udot, y_vdot, y_rdot, n_rdot });
            options.water_density = craft.water_density;
            options.length = options.length.or(size.map(|[length, ..]| length));
        } else {
            bail!("--vessel {}: this is an identified model: name a vessel file (.toml)", path.display());
        }
    }
    Ok(options)
}

/// The folder of the files, and the name of the model if the output is a file.
fn place(output: &Path, to: Target) -> anyhow::Result<(PathBuf, Option<String>)> {
    let known = to.extensions();
    let Some(extension) = output.extension().filter(|_| !output.is_dir()) else {
        return Ok((output.to_owned(), None));
    };
    if !known.iter().any(|known| extension.eq_ignore_ascii_case(known)) {
        bail!(
            "-o {}: a file of this format ends in .{}; a name without an extension is a folder",
            output.display(),
            known.join(" or .")
        );
    }
    let folder = output.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok((folder.to_owned(), output.file_stem().map(|stem| stem.to_string_lossy().into_owned())))
}
