//! A wave over a joint's angle, A sin(n q + φ), searched as the factors of sin n q and cos n q.

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
