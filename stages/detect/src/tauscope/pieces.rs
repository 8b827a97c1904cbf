//! What is learnt from: stretches of recordings, and what in them nothing touched.

use tauscope_bus::{JointArray, TwinState, flags};

use super::late::LateIn;
use super::spans::Follow;
use crate::frame::{Lesson, Lessons};

/// So much before a labelled contact is left out \[ns\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const BEFORE_NS: i64 = 50_000_000;
/// So much behind it is left out, too \[ns\].
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
const AFTER_NS: i64 = 400_000_000;
/// Data is cut in at least so many pieces, so that there are some for each part that is held out.
/// Statistical: two for each of the [`FOLDS`].
const LEAST_PIECES: usize = 8;
/// In how many parts data is held out from what its noise is learnt from.
/// Tuned: on the sets named in [`tauscope`](crate::tauscope); not swept.
pub(super) const FOLDS: usize = 4;

/// A stretch of a recording.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece<'a> {
    pub samples: &'a [TwinState],
    /// What the twin misses of each because its acceleration comes late, by joint \[effort unit\].
    late: &'a [JointArray],
    /// The part of the data that it is held out with: pieces of one recording together, where there are enough recordings.
    pub fold: usize,
    lesson: &'a Lesson,
}

/// All recordings; few ones in equal pieces, so that there are some for each fold, unless each must begin where it does.
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

/// Settled samples of a piece, what the twin misses of each, and whether nothing touched the robot then.
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

/// How long nothing touched the robot \[s\].
pub(super) fn free_s(all: &[Piece<'_>]) -> f64 {
    let of_piece = |piece: &Piece<'_>| {
        let mut stamps = piece.samples.iter().map(|sample| sample.header.stamp_ns);
        let (first, last) = (stamps.next(), stamps.next_back());
        let long_s = first.zip(last).map_or(0.0, |(a, b)| (b - a) as f64 * 1e-9);
        long_s * free(piece).count() as f64 / piece.samples.len().max(1) as f64
    };
    all.iter().map(of_piece).sum()
}

/// The value below which a share of all is; 0 of none.
pub(super) fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let last = values.len().saturating_sub(1);
    let at = (last as f64 * share).round() as usize;
    values.get(at).copied().unwrap_or(0.0)
}
