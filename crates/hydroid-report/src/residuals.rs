//! The section on one-step residuals: distribution and autocorrelation.

use maud::{Markup, html};

use super::figure::{Figure, Line, Mark, Panel};
use super::number::{self, duration, fixed, with_unit};
use super::page::{Section, columns, figure, nothing};
use super::rollouts::RunRollouts;
use super::{ReportError, judged_on, style};
use hydroid::identify::Candidate;
use hydroid::log::Channel;

const BARS: usize = 33;
/// Half-width of a histogram \[standard deviations\].
const REACH: f64 = 4.0;
const LAGS: usize = 40;
const FEWEST: usize = 8;

/// Statistics of one-step residuals.
#[derive(Debug)]
pub struct Residuals {
    /// Number of finite residuals.
    pub count: usize,
    mean: f64,
    deviation: f64,
    /// Share of the residuals \[%\] in each bar.
    pub bars: Vec<f64>,
    /// Number of residuals outside the histogram.
    beyond: usize,
    /// Autocorrelation at lags 1, 2, ...
    pub correlation: Vec<f64>,
}

pub(super) fn section(candidate: &Candidate, runs: &[RunRollouts<'_>]) -> Result<Section, ReportError> {
    let (heading, id) = ("Residuals", "residuals");
    let dt = candidate.model.description.dt;
    let mut blocks: Vec<Markup> = Vec::new();
    let mut missing: Vec<&str> = Vec::new();
    for (c, port) in candidate.model.description.outputs.iter().enumerate() {
        let series: Vec<&[f64]> = runs.iter().map(|w| w.residuals[c].as_slice()).collect();
        match Residuals::of(&series) {
            Some(residuals) => blocks.extend(residuals.show(&port.channel, dt)?),
            None => missing.push(&port.channel.name),
        }
    }
    let body = html! {
        p {
            "A residual is the measurement minus the prediction of one sample (" (duration(dt)) ") earlier, on " (judged_on(candidate)) ". "
            "Residuals of a complete model are white noise: normally distributed and uncorrelated from sample to sample."
        }
        @if !missing.is_empty() {
            (nothing(&format!("Too few finite residuals, or constant residuals, for {}.", missing.join(", "))))
        }
        (columns(&blocks))
    };
    Ok(Section::new(id, heading, body))
}

impl Residuals {
    /// Statistics over several runs; `None` for too few or constant residuals.
    pub fn of(runs: &[&[f64]]) -> Option<Self> {
        let finite = || runs.iter().flat_map(|run| run.iter().copied()).filter(|v| v.is_finite());
        let count = finite().count();
        if count < FEWEST {
            return None;
        }
        let mean = finite().sum::<f64>() / count as f64;
        let deviation = (finite().map(|v| (v - mean).powi(2)).sum::<f64>() / count as f64).sqrt();
        if !(deviation > 0.0 && deviation.is_finite() && mean.is_finite()) {
            return None;
        }
        let mut bars = vec![0.0; BARS];
        let mut beyond = 0;
        for value in finite() {
            let place = ((value - mean) / deviation + REACH) / (2.0 * REACH) * BARS as f64;
            if (0.0..BARS as f64).contains(&place) {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                // between 0 and the number of bars
                let bar = place as usize;
                bars[bar] += 100.0 / count as f64;
            } else {
                beyond += 1;
            }
        }
        let centred: Vec<Vec<f64>> = runs
            .iter()
            .map(|run| run.iter().map(|v| if v.is_finite() { v - mean } else { f64::NAN }).collect())
            .collect();
        let correlation =
            (1..=LAGS.min(count / 4)).map(|lag| correlation(&centred, lag, deviation)).collect();
        Some(Self { count, mean, deviation, bars, beyond, correlation })
    }

    fn show(&self, channel: &Channel, dt: f64) -> Result<[Markup; 2], ReportError> {
        let caption = html! {
            b { (channel.name) } ": mean " (number::text(self.mean, 2)) ", standard deviation "
            (number::text(self.deviation, 3)) @if !channel.unit.is_empty() { " " (number::unit(&channel.unit)) }
            " over " (number::count(self.count)) " samples"
            @if self.beyond > 0 { "; " (number::count(self.beyond)) " lie outside four standard deviations" }
            ". The line is the normal distribution with the same standard deviation."
        };
        let histogram = figure(&self.histogram(channel).svg()?, &caption);
        let band = self.band();
        let outside = self.correlation.iter().filter(|c| c.abs() > band).count();
        let share = outside as f64 / self.correlation.len().max(1) as f64;
        let caption = html! {
            b { (channel.name) } ": autocorrelation of the residuals. For white noise, 95 % of the lags lie in the shaded band. Here "
            (fixed(100.0 * share, 0)) " % of the lags lie outside it"
            @if share > 0.2 { ": the model of this output is incomplete, or the sensor is filtered." } @else { ": the model of this output explains almost all of the one-step change." }
        };
        Ok([histogram, figure(&self.autocorrelation(channel, dt).svg()?, &caption)])
    }

    fn histogram(&self, channel: &Channel) -> Figure {
        let width = 2.0 * REACH * self.deviation / BARS as f64;
        let low = self.mean - REACH * self.deviation;
        let bars = self
            .bars
            .iter()
            .enumerate()
            .map(|(i, share)| (low + i as f64 * width, low + (i + 1) as f64 * width, *share))
            .collect();
        let peak = 100.0 * width / (self.deviation * (2.0 * std::f64::consts::PI).sqrt());
        let normal = (0..=80)
            .map(|i| {
                let z = REACH * (f64::from(i) / 40.0 - 1.0);
                (self.mean + z * self.deviation, peak * (-0.5 * z * z).exp())
            })
            .collect();
        Figure::new(
            format!("Histogram of the one-step residuals of {}", channel.name),
            with_unit(&format!("residual of {}", channel.name), &channel.unit),
        )
        .x_range(low, self.mean + REACH * self.deviation)
        .panel(
            Panel::new("share of samples [%]")
                .height(150.0)
                .mark(Mark::Bars { bars, colour: style::SERIES[1] })
                .mark(Mark::Line(Line::new(normal, style::MEASURED_LINE))),
        )
    }

    fn autocorrelation(&self, channel: &Channel, dt: f64) -> Figure {
        let bars = self
            .correlation
            .iter()
            .enumerate()
            .map(|(i, c)| {
                let lag = (i + 1) as f64;
                ((lag - 0.36) * dt, (lag + 0.36) * dt, *c)
            })
            .collect();
        let end = (self.correlation.len() as f64 + 0.7) * dt;
        let band = self.band();
        let lowest = self.correlation.iter().copied().fold(-0.2f64.max(band), f64::min);
        Figure::new(format!("Autocorrelation of the one-step residuals of {}", channel.name), "lag [s]")
            .x_range(0.0, end)
            .panel(
                Panel::new(format!("autocorrelation of the residuals of {}", channel.name))
                    .height(150.0)
                    .range(1.06 * lowest.min(-band), 1.05)
                    .mark(Mark::Bars { bars, colour: style::MODEL })
                    .mark(Mark::Band {
                        points: vec![(0.0, -band, band), (end, -band, band)],
                        colour: style::INK,
                        opacity: 0.16,
                    }),
            )
    }

    /// Half-width of the 95 % band of white noise.
    fn band(&self) -> f64 {
        1.96 / (self.count as f64).sqrt()
    }
}

/// Autocorrelation at a lag, over the existing pairs.
fn correlation(runs: &[Vec<f64>], lag: usize, deviation: f64) -> f64 {
    let (sum, pairs) = runs
        .iter()
        .flat_map(|run| run.iter().zip(run.get(lag..).unwrap_or_default()))
        .map(|(a, b)| a * b)
        .filter(|product| product.is_finite())
        .fold((0.0, 0usize), |(sum, n), product| (sum + product, n + 1));
    if pairs == 0 { f64::NAN } else { sum / pairs as f64 / (deviation * deviation) }
}
