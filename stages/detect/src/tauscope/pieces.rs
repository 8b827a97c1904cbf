//! Stretches of recordings to learn from, and the contact-free samples in them.

use tauscope_bus::{JointArray, TwinState, flags};

use super::late::LateIn;
use super::spans::Follow;
use crate::frame::{Lesson, Lessons};

/// Time before a labelled contact that is left out \[ns\].
/// Chosen: more than the 20 ms to which labels are exact. A shorter time learns a contact as noise, a longer one
/// costs contact-free time.
const BEFORE_NS: i64 = 50_000_000;
/// Time after a labelled contact that is left out \[ns\].
/// Chosen: twice the longest window, which still contains the contact, so that most of the arm's swing is left out,
/// too. A longer time leaves little contact-free time between contacts.
const AFTER_NS: i64 = 400_000_000;
/// Minimum number of pieces into which the data is divided, so that each fold has some.
/// Statistical: two for each of the [`FOLDS`].
const LEAST_PIECES: usize = 8;
/// Number of cross-validation folds.
/// Chosen: each fold is scored by a fit to three quarters of the data. Fewer folds score a worse fit, more need
/// proportionally more computing time.
pub(super) const FOLDS: usize = 4;

/// A stretch of a recording.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece<'a> {
    pub samples: &'a [TwinState],
    /// Inertial effort that the twin lacks in each sample, by joint \[effort unit\].
    late: &'a [JointArray],
    /// Cross-validation fold. With enough recordings, all pieces of a recording are in the same fold.
    pub fold: usize,
    lesson: &'a Lesson,
}

/// Returns all recordings. A few recordings are divided into equal pieces, so that each fold has some, unless an
/// offset is taken from the first seconds of each recording.
pub(super) fn pieces<'a>(
    lessons: &Lessons<'a>,
    late: &'a LateIn,
    follow: Follow,
) -> Vec<Piece<'a>> {
    let all = || lessons.train.iter().chain(lessons.validation);
    let each = if follow.offset_from_first_s > 0.0 {
        1
    } else {
        LEAST_PIECES.div_ceil(all().count().max(1))
    };
    let recordings_do = all().count() >= FOLDS;
    all()
        .zip(late.recordings())
        .enumerate()
        .flat_map(|(number, (lesson, late))| {
            let length = lesson.samples.len().div_ceil(each).max(1);
            let parts = lesson.samples.chunks(length).zip(late.chunks(length));
            parts.enumerate().map(move |(part, (samples, late))| {
                let of_all = if recordings_do {
                    number
                } else {
                    number * each + part
                };
                let fold = of_all % FOLDS;
                Piece {
                    samples,
                    late,
                    fold,
                    lesson,
                }
            })
        })
        .collect()
}

/// Returns the settled samples of a piece, with the inertial effort that the twin lacks in them and whether they are
/// contact-free.
pub(super) fn marked<'a>(
    piece: &Piece<'a>,
) -> impl Iterator<Item = (&'a TwinState, &'a JointArray, bool)> {
    let Piece {
        samples,
        late,
        lesson,
        ..
    } = *piece;
    let all = samples.iter().zip(late);
    let settled = all.filter(|(sample, _)| sample.header.has(flags::READY));
    settled.map(move |(sample, late)| {
        let stamp = sample.header.stamp_ns;
        let touched = lesson.contacts.iter().flatten().any(|contact| {
            stamp >= contact.on_ns - BEFORE_NS && stamp <= contact.off_ns + AFTER_NS
        });
        (sample, late, !touched)
    })
}

pub(super) fn free<'a>(piece: &Piece<'a>) -> impl Iterator<Item = &'a TwinState> {
    marked(piece).filter_map(|(sample, _, is_free)| is_free.then_some(sample))
}

/// Returns the contact-free time \[s\].
pub(super) fn free_s(all: &[Piece<'_>]) -> f64 {
    let of_piece = |piece: &Piece<'_>| {
        let mut stamps = piece.samples.iter().map(|sample| sample.header.stamp_ns);
        let (first, last) = (stamps.next(), stamps.next_back());
        let long_s = first.zip(last).map_or(0.0, |(a, b)| (b - a) as f64 * 1e-9);
        long_s * free(piece).count() as f64 / piece.samples.len().max(1) as f64
    };
    all.iter().map(of_piece).sum()
}

/// Returns a quantile of the values; 0 if there are none.
pub(super) fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    let at = (last as f64 * share).round() as usize;
    values.get(at).copied().unwrap_or(0.0)
}
