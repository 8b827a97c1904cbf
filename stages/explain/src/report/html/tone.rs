//! The verdict's colour, sign and words: they follow the share of the mismatch that has no name.

use tauscope_dynamics::terms::UNKNOWN;

use super::number_format::percent;
use super::proof::rows;
use super::verdict_text;
use crate::report::schema::{Report, Verdict};

/// Below this share what is unknown is as good as nothing.
/// Tuned: by hand, on no recorded seeds; not swept.
const HARDLY: f64 = 0.01;
/// Below this share it is little.
/// Tuned: by hand, on no recorded seeds; not swept.
const LITTLE: f64 = 0.1;

/// How a verdict looks: it must not hang on colour alone.
pub(super) struct Tone {
    /// Of the style sheet.
    pub class: &'static str,
    /// Before the words.
    pub sign: &'static str,
    /// What the badge says.
    pub text: String,
}

impl Tone {
    pub fn of(report: &Report) -> Self {
        let (class, sign) = match report.verdict {
            Verdict::Explained => ("explained", "✓"),
            Verdict::NothingMissing => ("nothing", "✓"),
            Verdict::NotEvaluated => ("none", "–"),
            // A clear remainder at one joint is not averaged away by what is explained at others.
            Verdict::UnknownRemains if !report.remaining.is_empty() || report.is_of_mended() => {
                ("remains", "?")
            }
            Verdict::UnknownRemains => return Self::unknown(unknown_share(report)),
        };
        let text = verdict_text(report.verdict).to_owned();
        Self { class, sign, text }
    }

    fn unknown(share: f64) -> Self {
        let (class, sign, text) = if share < HARDLY {
            (
                "explained",
                "✓",
                "Explained but for less than 1 %".to_owned(),
            )
        } else if share < LITTLE {
            let text = format!("Explained but for {}", percent(share));
            ("nothing", "✓", text)
        } else if share.is_finite() {
            let text = format!("Something unknown remains: {}", percent(share));
            ("remains", "?", text)
        } else {
            let text = verdict_text(Verdict::UnknownRemains).to_owned();
            ("remains", "?", text)
        };
        Self { class, sign, text }
    }
}

/// Share of the squared mismatch that has no name: what a curve without a name describes, and what is left on held-out data
/// beyond the noise. Not a number where neither is known.
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
        (described + left / before).min(1.0)
    } else if report.findings.is_empty() {
        f64::NAN
    } else {
        described
    }
}
