//! Builds the page of hydroid: `cargo run -p build-page`.
//!
//! The result is in `web/dist`: `hydroid.html` is the page in a single file, with everything inside, and `site` is a folder
//! for a web server. With `--node FOLDER` it also writes the functions of the page for Node.js, for tests.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::GzEncoder;
use sha2::{Digest as _, Sha256};
use wasm_bindgen_cli_support::Bindgen;

const TARGET: &str = "wasm32-unknown-unknown";

/// Parts of the application behind those that the pages of hydroid share, in their order.
const PARTS: [&str; 8] =
    ["texts.js", "dom.js", "engine.js", "store.js", "notes.js", "columns.js", "result.js", "main.js"];

/// What no page of hydroid does: connect, load, or send. `SCRIPTS` are those of the page and of the report.
const POLICY: &str = "default-src 'none'; script-src SCRIPTS 'wasm-unsafe-eval' blob:; worker-src blob:; style-src STYLES 'unsafe-inline'; img-src data: blob:; connect-src 'none'; form-action 'none'; base-uri 'none'";

fn main() -> Result<()> {
    let web = Path::new(env!("CARGO_MANIFEST_DIR")).parent().context("the folder of the page")?.to_owned();
    let wasm = compile(&web)?;
    let node = std::env::args().skip_while(|argument| argument != "--node").nth(1);
    if let Some(folder) = node {
        Bindgen::new().input_path(&wasm).nodejs(true)?.typescript(false).generate(folder)?;
    }
    let worker = worker(&web, &wasm)?;
    let application = application(&web)?;
    let own = read(&web.join("page/app/style.css"))?;
    let style = [hydroid_web::UPLOT_STYLE, &own, hydroid_web::DRIVE_STYLE].concat();
    let page = read(&web.join("page/app/index.html"))?;
    let report = read(&web.join("../crates/hydroid-report/src/hover.js"))?;
    for (name, text) in [("worker", &worker), ("application", &application)] {
        ensure!(!text.to_ascii_lowercase().contains("</script"), "the {name} contains an end of a script");
    }

    let dist = web.join("dist");
    let site = dist.join("site");
    fs::create_dir_all(&site)?;
    let hashes = format!("{} {}", hash(&application), hash(&report));
    let policy = POLICY.replace("SCRIPTS", &hashes).replace(" STYLES", "");
    let single = filled(
        &page,
        &[("POLICY", &policy), ("STYLE", &style), ("WORKER", &worker), ("APPLICATION", &application)],
    );
    write(&dist.join("hydroid.html"), &single)?;

    let policy = POLICY.replace("SCRIPTS", &format!("'self' {}", hash(&report))).replace("STYLES", "'self'");
    let linked = page
        .replace("<style>STYLE</style>", "<link rel=\"stylesheet\" href=\"style.css\">")
        .replace("<script type=\"text/plain\" id=\"worker\">WORKER</script>\n", "")
        .replace("<script>APPLICATION</script>", "<script src=\"application.js\"></script>")
        .replace("POLICY", &policy);
    for (name, text) in [
        ("index.html", &linked),
        ("style.css", &style),
        ("worker.js", &worker),
        ("application.js", &application),
    ] {
        write(&site.join(name), text)?;
    }
    let packed = gzip(single.as_bytes())?.len();
    println!(
        "{}: {:.1} MB, compressed {:.1} MB",
        dist.join("hydroid.html").display(),
        megabytes(single.len()),
        megabytes(packed)
    );
    Ok(())
}

#[expect(clippy::cast_precision_loss, reason = "for display")]
fn megabytes(bytes: usize) -> f64 {
    bytes as f64 / 1e6
}

/// Compiles the functions of the page with vectors of 128 bits.
fn compile(web: &Path) -> Result<PathBuf> {
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| web.join("../target"), PathBuf::from);
    let status = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(web)
        .env("RUSTFLAGS", "-C target-feature=+simd128")
        .args([
            "build",
            "--profile",
            "page",
            "--locked",
            "-p",
            "hydroid-page",
            "--target",
            TARGET,
            "--target-dir",
        ])
        .arg(&target)
        .status()?;
    ensure!(status.success(), "the page does not compile; it needs `rustup target add {TARGET}`");
    Ok(target.join(TARGET).join("page/hydroid_page.wasm"))
}

/// The script of a worker: glue, module, and messages.
fn worker(web: &Path, wasm: &Path) -> Result<String> {
    let folder = wasm.with_file_name("bindings");
    Bindgen::new().input_path(wasm).no_modules(true)?.typescript(false).generate(&folder)?;
    let glue = read(&folder.join("hydroid_page.js"))?;
    let module = fs::read(folder.join("hydroid_page_bg.wasm"))?;
    let module = STANDARD.encode(gzip(&module)?);
    let messages = read(&web.join("page/app/worker.js"))?;
    Ok(format!("{glue}\nconst HYDROID_WASM = \"{module}\";\n{messages}"))
}

fn application(web: &Path) -> Result<String> {
    let mut text = String::from("\"use strict\";\n");
    text.extend(hydroid_web::DRIVING);
    let example = read(&web.join("../vessels/otter.toml"))?;
    text.extend(["\nconst EXAMPLE = ", &serde_json::to_string(&example)?, ";\n"]);
    for part in PARTS {
        text.push_str(&read(&web.join("page/app").join(part))?);
    }
    Ok(text)
}

/// A page with its parts. The parts may contain the words.
fn filled(page: &str, parts: &[(&str, &str)]) -> String {
    let Some(((word, part), rest)) = parts.split_first() else { return page.to_owned() };
    match page.split_once(word) {
        Some((before, after)) => filled(before, &[]) + part + &filled(after, rest),
        None => page.to_owned(),
    }
}

fn hash(script: &str) -> String {
    format!("'sha256-{}'", STANDARD.encode(Sha256::digest(script)))
}

fn gzip(bytes: &[u8]) -> Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    Ok(encoder.finish()?)
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| path.display().to_string())
}

fn write(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).with_context(|| path.display().to_string())
}
