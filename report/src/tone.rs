//! Colour, sign and text of the verdict. The colour follows the unexplained share of the error.

use tauscope_dynamics::terms::UNKNOWN;

use super::number_format::percent;
use super::proof::rows;
use super::verdict_text;
use tauscope_explain::report::{Report, Verdict};

/// Unexplained share of the error (RMS) below which it is negligible.
/// Layout: only the colour depends on it; 1 % of the squared error.
const HARDLY: f64 = 0.1;
/// Unexplained share of the error (RMS) below which it is small.
/// Layout: only the colour depends on it; 9 % of the squared error.
const LITTLE: f64 = 0.3;

/// Appearance of a verdict. The sign repeats the meaning of the colour for readers who cannot distinguish colours.
pub(super) struct Tone {
    /// Class in the style sheet.
    pub class: &'static str,
    /// Sign before the text.
    pub sign: &'static str,
    /// Text of the badge.
    pub text: String,
}

impl Tone {
    pub fn of(report: &Report) -> Self {
        let (class, sign) = match report.verdict {
            Verdict::Explained => ("explained", "✓"),
            Verdict::NothingMissing => ("nothing", "✓"),
            Verdict::NotEvaluated => ("none", "–"),
            // The share is a sum over all joints, in which explained joints would hide a clear residual at one joint.
            Verdict::UnknownRemains if !report.remaining.is_empty() || report.is_of_mended() => {
                ("remains", "?")
            }
            Verdict::UnknownRemains => return Self::unknown(unknown_share(report)),
        };
        let text = verdict_text(report.verdict).to_owned();
        Self { class, sign, text }
    }

    fn unknown(share: f64) -> Self {
        let class = if share < HARDLY {
            "explained"
        } else if share < LITTLE {
            "nothing"
        } else {
            "remains"
        };
        // The badge repeats the verdict of the page title. Its share is an RMS, as are all errors on the page.
        let verdict = verdict_text(Verdict::UnknownRemains);
        let text = if share.is_finite() {
            format!("{verdict}: {} of the error (RMS)", percent(share))
        } else {
            verdict.to_owned()
        };
        let sign = "?";
        Self { class, sign, text }
    }
}

/// Returns the unexplained share of the error (RMS): the part that `unknown` curves describe, plus the residual on
/// held-out data in excess of the noise. NaN if neither is known.
fn unknown_share(report: &Report) -> f64 {
    let known = rows(report).into_iter();
    let known = known.filter(|row| row.before.is_finite() && row.after.is_finite());
    let (before, left) = known.fold((0.0, 0.0), |(before, left), row| {
        let noise = if row.noise.is_finite() {
            row.noise
        } else {
            0.0
        };
        // Noise and residual are independent, so their squares are subtracted, not their RMS values.
        let beyond = (row.after.powi(2) - noise.powi(2)).max(0.0);
        (before + row.before.powi(2), left + beyond)
    });
    let unnamed = report
        .findings
        .iter()
        .filter(|f| f.known_as() == UNKNOWN.name);
    let described: f64 = unnamed.map(|finding| finding.explains).sum();
    if before > 0.0 {
        (described + left / before).min(1.0).sqrt()
    } else if report.findings.is_empty() {
        f64::NAN
    } else {
        described.min(1.0).sqrt()
    }
}
