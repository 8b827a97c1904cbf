//! Comparison of gradients with central differences.

use super::Net;

/// Checks that every gradient of `net` equals the central difference of `loss`, which computes the loss and sets the
/// gradients.
pub(super) fn check<N: Net<f64>>(net: &mut N, loss: impl Fn(&mut N) -> f64) {
    const STEP: f64 = 1e-6;
    loss(net);
    let gradients: Vec<Vec<f64>> = (net.weights().iter())
        .map(|weight| weight.gradient.as_slice().to_vec())
        .collect();
    assert!(gradients.iter().flatten().any(|g| g.abs() > 1e-3));
    for (index, gradients) in gradients.iter().enumerate() {
        for (entry, gradient) in gradients.iter().enumerate() {
            let mut at = |step: f64| {
                let before = net.weights()[index].value[entry];
                net.weights()[index].value[entry] = before + step;
                let loss = loss(net);
                net.weights()[index].value[entry] = before;
                loss
            };
            let difference = (at(STEP) - at(-STEP)) / (2.0 * STEP);
            assert!(
                (gradient - difference).abs() < 1e-8,
                "weight {index}, entry {entry}: {gradient} is not {difference}"
            );
        }
    }
}
