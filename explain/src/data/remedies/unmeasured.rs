//! Efforts that are no measurement: they never change.

use super::{Remedy, Slip};
use crate::read::audit::is_unmeasured;
use crate::read::recording::Recording;

/// The joints, of `n`, whose effort stays one number through every recording, and that move in some: a channel that
/// stands still holds another number each time it is started.
pub fn of_unmeasured(recordings: &[Recording], n: usize) -> Vec<Slip> {
    let with_effort = || recordings.iter().filter(|one| !one.effort.is_empty());
    let number = |joint: usize| {
        let of = |recording: &Recording| recording.effort.get(joint).copied();
        let silent = with_effort().filter(|one| is_unmeasured(one, joint, n));
        let first = silent.clone().next().and_then(of)?;
        let same = |one: &Recording| {
            let mut efforts = one.effort.iter().skip(joint).step_by(n);
            let held = efforts.next().map(|x| x.to_bits());
            efforts.all(|x| Some(x.to_bits()) == held)
        };
        with_effort().all(same).then_some(first)
    };
    let slip = |joint: usize| {
        Some(Slip {
            remedy: Remedy::Unmeasured(joint, number(joint)?),
            mended: Vec::new(),
            share: 0.0,
            slopes: Vec::new(),
        })
    };
    (0..n).filter_map(slip).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    #[test]
    fn an_effort_that_never_changes_is_told_and_one_that_does_is_not() {
        let model = fixture::model();
        let mut recordings = [4, 5].map(|seed| fixture::recording(&model, seed, |_, _, _| {}));
        assert!(of_unmeasured(&recordings, 2).is_empty());
        for recording in &mut recordings {
            recording
                .effort
                .iter_mut()
                .skip(1)
                .step_by(2)
                .for_each(|x| *x = 0.37);
        }
        let told = of_unmeasured(&recordings, 2);
        assert_eq!(told.len(), 1);
        assert_eq!(told[0].remedy, Remedy::Unmeasured(1, 0.37));
        // Another number in another recording is none the less one number there.
        let other = recordings[1].effort.iter_mut().skip(1).step_by(2);
        other.for_each(|x| *x = -0.51);
        assert_eq!(of_unmeasured(&recordings, 2).len(), 1);
        // In one recording it does change.
        recordings[1].effort[21] += 0.01;
        assert!(of_unmeasured(&recordings, 2).is_empty());
    }
}
