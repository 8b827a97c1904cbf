//! A wave over a joint's angle, A sin(n q + φ), searched as the factors of sin n q and cos n q.

/// How far from a whole number the cycles of something that closes after a revolution are found, at the most.
/// Tuned: as for torque ripple; not swept.
const NEARLY_WHOLE: f64 = 0.15;

/// Amplitude, cycles per revolution and phase \[rad\], from the factors of sine and cosine and the cycles.
pub(super) fn to_parameters(coordinates: &[f64]) -> Vec<f64> {
    let [sine, cosine, cycles] = super::law::array(coordinates);
    vec![sine.hypot(cosine), cycles, cosine.atan2(sine)]
}

/// The factors of sine and cosine and the cycles, from amplitude, cycles per revolution and phase \[rad\].
pub(super) fn to_coordinates(parameters: &[f64]) -> Vec<f64> {
    let [amplitude, cycles, phase] = super::law::array::<3>(parameters);
    let (sin, cos) = phase.sin_cos();
    vec![amplitude * cos, amplitude * sin, cycles]
}

/// Whether a wave of so many cycles closes after a revolution, within what is known of it.
pub(super) fn closes(cycles: f64) -> bool {
    (cycles - cycles.round()).abs() <= NEARLY_WHOLE
}
