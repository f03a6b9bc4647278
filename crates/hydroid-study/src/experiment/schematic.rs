//! Figures 1 to 3: drawings of the two modes, the direct predictor, and the adaptation.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::super::outcome::{Outcome, Picture, Shown};

/// A drawing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schematic {
    /// Subject of the drawing.
    pub of: Drawing,
}

/// Subjects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Drawing {
    /// The two modes of the hydrofoil.
    Modes,
    /// The direct predictor.
    Predictor,
    /// Online adaptation.
    Adaptation,
}

struct Sheet {
    svg: String,
}

impl Sheet {
    fn new(title: &str, width: u32, height: u32) -> Self {
        let mut svg = format!(
            "<svg viewBox=\"0 0 {width} {height}\" xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" aria-label=\"{title}\" font-family=\"Arial, Helvetica, 'Liberation Sans', sans-serif\" font-size=\"14\" fill=\"#2b2f33\">"
        );
        let _ = write!(
            svg,
            "<defs><marker id=\"tip-{}\" viewBox=\"0 0 8 8\" refX=\"7\" refY=\"4\" markerWidth=\"7\" markerHeight=\"7\" orient=\"auto\"><path d=\"M0 0 8 4 0 8z\" fill=\"#5b646e\"/></marker></defs>",
            title.len()
        );
        Self { svg }
    }

    fn raw(&mut self, svg: &str) {
        self.svg.push_str(svg);
    }

    fn words(&mut self, x: f64, y: f64, anchor: &str, class: &str, text: &str) {
        let _ = write!(self.svg, "<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\" {class}>{text}</text>");
    }

    fn block(&mut self, [x, y, width, height]: [f64; 4], colour: &str, lines: &[&str]) {
        let _ = write!(
            self.svg,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"4\" fill=\"{colour}\" fill-opacity=\".12\" stroke=\"{colour}\"/>"
        );
        let top = y + 0.5 * height - 9.0 * (lines.len() as f64 - 1.0) + 5.0;
        for (i, line) in lines.iter().enumerate() {
            let class = if i == 0 { "font-weight=\"600\"" } else { "font-size=\"13\" fill=\"#5b646e\"" };
            self.words(x + 0.5 * width, top + 18.0 * i as f64, "middle", class, line);
        }
    }

    fn arrow(&mut self, title: &str, points: &[(f64, f64)]) {
        let path: Vec<String> = points.iter().map(|(x, y)| format!("{x} {y}")).collect();
        let _ = write!(
            self.svg,
            "<path d=\"M{}\" fill=\"none\" stroke=\"#5b646e\" stroke-width=\"1.6\" marker-end=\"url(#tip-{})\"/>",
            path.join(" L"),
            title.len()
        );
    }

    fn done(mut self) -> String {
        self.svg.push_str("</svg>");
        self.svg
    }
}

const BLUE: &str = "#0072b2";
const GREEN: &str = "#009e73";
const ORANGE: &str = "#d55e00";
const GREY: &str = "#868e96";

impl Schematic {
    pub(super) fn run(&self) -> Outcome {
        let (name, svg, caption) = match self.of {
            Drawing::Modes => ("modes", modes(), MODES),
            Drawing::Predictor => ("predictor", predictor(), PREDICTOR),
            Drawing::Adaptation => ("adaptation", adaptation(), ADAPTATION),
        };
        let picture = Picture::Drawing(svg);
        let mut outcome = Outcome::default();
        outcome.pictures.push(Shown { name: name.to_owned(), picture, caption: caption.to_owned() });
        outcome
    }
}

const MODES: &str = "The hydrofoil of the thesis (eq. 7 to 12): below 2.5 m/s it floats with high drag, above it flies with low drag. A sigmoid of the speed blends the two modes. The force of the propeller follows its command with a lag of 1 s and is not measured.";
const PREDICTOR: &str = "The direct predictor (eq. 13 to 17). Inputs: the last 4 outputs, the last 4 commands and the next 19 commands. Outputs: the next 20 samples of all outputs at once.";
const ADAPTATION: &str = "Online adaptation (eq. 18). At each sample the filter corrects hidden state and weights from the difference between measurement and prediction. The guard compares the adapted model with the reference model and selects the model that predicts.";

fn modes() -> String {
    let title = "The two modes of the hydrofoil";
    let mut sheet = Sheet::new(title, 760, 250);
    sheet.raw("<path d=\"M20 120 Q60 112 100 120 T180 120 T260 120 T340 120\" fill=\"none\" stroke=\"#56b4e9\" stroke-width=\"2\"/>");
    sheet.raw("<path d=\"M420 120 Q460 112 500 120 T580 120 T660 120 T740 120\" fill=\"none\" stroke=\"#56b4e9\" stroke-width=\"2\"/>");
    sheet.raw("<path d=\"M90 96 H270 L250 136 H115 Z\" fill=\"#0072b2\" fill-opacity=\".25\" stroke=\"#0072b2\" stroke-width=\"1.6\"/><path d=\"M130 136 V160 H150 M220 136 V160 H240\" fill=\"none\" stroke=\"#0072b2\" stroke-width=\"2\"/>");
    sheet.raw("<path d=\"M490 58 H670 L650 98 H515 Z\" fill=\"#009e73\" fill-opacity=\".25\" stroke=\"#009e73\" stroke-width=\"1.6\"/><path d=\"M530 98 V140 H550 M620 98 V140 H640\" fill=\"none\" stroke=\"#009e73\" stroke-width=\"2\"/>");
    sheet.words(180.0, 40.0, "middle", "font-weight=\"600\"", "afloat: high drag");
    sheet.words(580.0, 40.0, "middle", "font-weight=\"600\"", "flying: low drag");
    sheet.words(180.0, 190.0, "middle", "", "weight 1 − s(u)");
    sheet.words(580.0, 190.0, "middle", "", "weight s(u)");
    sheet.words(380.0, 226.0, "middle", "font-size=\"15\"", "s(u) = 1 / (1 + exp(−12 (u − 2.5 m/s)))");
    sheet.arrow(title, &[(345.0, 84.0), (415.0, 84.0)]);
    sheet.words(380.0, 74.0, "middle", "font-size=\"13\" fill=\"#5b646e\"", "faster");
    sheet.arrow(title, &[(415.0, 150.0), (345.0, 150.0)]);
    sheet.words(380.0, 168.0, "middle", "font-size=\"13\" fill=\"#5b646e\"", "slower");
    sheet.done()
}

fn predictor() -> String {
    let title = "The direct predictor";
    let mut sheet = Sheet::new(title, 760, 230);
    sheet.block([10.0, 20.0, 180.0, 56.0], GREY, &["outputs y", "k−3 .. k: 12 numbers"]);
    sheet.block([10.0, 88.0, 180.0, 56.0], GREY, &["commands c", "k−3 .. k: 8 numbers"]);
    sheet.block([10.0, 156.0, 180.0, 56.0], ORANGE, &["future commands", "k+1 .. k+19: 38 numbers"]);
    for (i, x) in [270.0, 375.0, 480.0].into_iter().enumerate() {
        sheet.block([x, 48.0, 80.0, 136.0], BLUE, &["256", "tanh"]);
        if i > 0 {
            sheet.arrow(title, &[(x - 25.0, 116.0), (x - 2.0, 116.0)]);
        }
    }
    for y in [48.0, 116.0, 184.0] {
        sheet.arrow(title, &[(190.0, y), (230.0, y), (230.0, 116.0), (268.0, 116.0)]);
    }
    sheet.block([610.0, 80.0, 140.0, 72.0], GREEN, &["outputs", "k+1 .. k+20", "60 numbers"]);
    sheet.arrow(title, &[(560.0, 116.0), (608.0, 116.0)]);
    sheet.done()
}

fn adaptation() -> String {
    let title = "Online adaptation";
    let mut sheet = Sheet::new(title, 760, 280);
    sheet.block([20.0, 20.0, 150.0, 60.0], GREY, &["vessel", "command, output y"]);
    sheet.block([270.0, 20.0, 190.0, 60.0], BLUE, &["network", "state h, weights θ"]);
    sheet.block(
        [270.0, 130.0, 190.0, 70.0],
        GREEN,
        &["Kalman filter", "covariance of h and θ", "K = P H′ S⁻¹"],
    );
    sheet.block([560.0, 20.0, 180.0, 60.0], BLUE, &["predictions", "with bands"]);
    sheet.block(
        [560.0, 130.0, 180.0, 70.0],
        ORANGE,
        &["guard", "adapted, snapshot, reference:", "which model predicts?"],
    );
    sheet.arrow(title, &[(460.0, 50.0), (558.0, 50.0)]);
    sheet.arrow(title, &[(170.0, 50.0), (268.0, 50.0)]);
    sheet.words(219.0, 42.0, "middle", "font-size=\"13\" fill=\"#5b646e\"", "commands");
    sheet.arrow(title, &[(95.0, 80.0), (95.0, 165.0), (268.0, 165.0)]);
    sheet.words(170.0, 157.0, "middle", "font-size=\"13\" fill=\"#5b646e\"", "measured y");
    sheet.arrow(title, &[(330.0, 80.0), (330.0, 128.0)]);
    sheet.words(322.0, 108.0, "end", "font-size=\"13\" fill=\"#5b646e\"", "predicted y");
    sheet.arrow(title, &[(400.0, 130.0), (400.0, 82.0)]);
    sheet.words(408.0, 108.0, "start", "font-size=\"13\" fill=\"#5b646e\"", "corrects h and θ");
    sheet.arrow(title, &[(460.0, 165.0), (558.0, 165.0)]);
    sheet.arrow(title, &[(650.0, 130.0), (650.0, 82.0)]);
    sheet.block(
        [270.0, 226.0, 470.0, 42.0],
        GREY,
        &["reference model: not adapted; predicts if the adapted one is worse"],
    );
    sheet.arrow(title, &[(650.0, 226.0), (650.0, 202.0)]);
    sheet.done()
}
