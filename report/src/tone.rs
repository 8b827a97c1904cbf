//! Colour, sign and text of the verdict. The colour follows the unexplained share of the error.

use tauscope_dynamics::terms::UNKNOWN;

use super::number_format::percent;
use super::proof::rows;
use super::verdict_text;
use tauscope_explain::report::{Report, Verdict};

/// Unexplained share of the error (RMS) below which it is negligible.
/// Tuned: by hand, on no recorded seeds; not swept.
const HARDLY: f64 = 0.1;
/// Unexplained share of the error (RMS) below which it is small.
/// Tuned: by hand, on no recorded seeds; not swept.
const LITTLE: f64 = 0.3;

/// Appearance of a verdict, which does not depend on colour alone.
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
            // A clear residual at one joint is not averaged away by explained joints.
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
        // The badge begins like the title of the page, and its share is an RMS like every error on it.
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

/// Unexplained share of the error (RMS): the part that `unknown` curves describe, and the residual on held-out data
/// beyond the noise. NaN if neither is known.
fn unknown_share(report: &Report) -> f64 {
    let known = rows(report).into_iter();
    let known = known.filter(|row| row.before.is_finite() && row.after.is_finite());
    let (before, left) = known.fold((0.0, 0.0), |(before, left), row| {
        let noise = if row.noise.is_finite() {
            row.noise
        } else {
            0.0
        };
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
