//! Learning and adaptation of the bias, which sets the sensor's sensitivity (section 4): the block that estimates
//! it for a joint (equations 12 to 16, figure 9), and the machine that handles a request (figure 10).

use super::learnt::LearntJoint;

/// The bias of one joint: the estimate made in parallel with the collision test, and the bias applied in the test.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bias {
    /// `Coll_Ident` \[effort unit\].
    ident: f64,
    /// `Coll_0`, from which the current adaptation started \[effort unit\].
    start: f64,
    /// `t_adapt` \[s\]; `None` while it is locked to zero.
    adapt_s: Option<f64>,
}

impl Bias {
    /// Creates a bias of `initial` (`Coll_bias0`), constant until learning is requested.
    pub fn new(initial: f64) -> Self {
        Self {
            ident: 0.0,
            start: initial,
            adapt_s: None,
        }
    }

    /// Restores the bias of an earlier run.
    pub fn resume(learnt: &LearntJoint) -> Self {
        Self {
            ident: learnt.ident,
            start: learnt.start,
            adapt_s: learnt.adapt_s,
        }
    }

    /// Returns the state for [`resume`](Self::resume).
    pub fn learnt(&self) -> LearntJoint {
        LearntJoint {
            ident: self.ident,
            start: self.start,
            adapt_s: self.adapt_s,
        }
    }

    /// Returns `Coll_Ident` \[effort unit\].
    pub fn ident(&self) -> f64 {
        self.ident
    }

    /// Returns the current `Coll_bias` by equation 14, with the adaptation's time constant.
    pub fn value(&self, time_constant_s: f64) -> f64 {
        match self.adapt_s {
            None => self.start,
            // The adaptation is complete.
            Some(_) if self.start.to_bits() == self.ident.to_bits() => self.ident,
            Some(t) => self.ident + (-t / time_constant_s).exp() * (self.start - self.ident),
        }
    }

    /// Advances the adaptation by `dt_s`.
    pub fn advance(&mut self, dt_s: f64) {
        if let Some(t) = &mut self.adapt_s {
            *t += dt_s;
        }
    }

    /// Runs the parallel test with `S_Ident` (equation 12) on a tested joint. For a virtual collision it applies
    /// equation 13 and, during adaptation, equation 16.
    ///
    /// `passes` is the largest |R| that the collision test accepts: `Coll_Ident` is raised at most to that level. A
    /// larger |R| is an alarm and not normal behaviour of the robot (the paper's robot has stopped by then).
    pub fn observe(&mut self, residue: f64, model_error: f64, passes: f64, time_constant_s: f64) {
        let needed = residue.min(passes) - model_error;
        if needed <= self.ident {
            return;
        }
        if self.adapt_s.is_some() {
            self.start = self.value(time_constant_s);
            self.adapt_s = Some(0.0);
        }
        self.ident = needed;
    }

    /// Executes the service Init: discards `Coll_Ident` and locks `t_adapt`; the applied bias stays constant.
    pub fn init(&mut self, time_constant_s: f64) {
        self.start = self.value(time_constant_s);
        self.ident = 0.0;
        self.adapt_s = None;
    }

    /// Executes the service Set, equation 15: applies `Coll_Ident` as the bias.
    pub fn set(&mut self) {
        self.start = self.ident;
    }

    /// Executes the service Adapt: unlocks `t_adapt`.
    pub fn adapt(&mut self) {
        self.adapt_s = Some(0.0);
    }
}

/// Service that the machine calls at a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Service {
    /// Nothing.
    None,
    /// Init.
    Init,
    /// Set, at the end of learning.
    Set,
    /// Adapt.
    Adapt,
}

/// The machine of figure 10.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum LearningState {
    /// Waiting for a request.
    #[default]
    Idle,
    /// Requested: the estimation restarts.
    Init,
    /// Estimating, with the elapsed time \[s\].
    Learning(f64),
    /// Learnt: the estimate is applied, and adaptation starts.
    Adapt,
}

impl LearningState {
    /// Advances the machine by a sample, `dt_s` after the previous one. `learning_s` is the duration of learning;
    /// `asked` is true if learning is requested.
    pub(super) fn step(&mut self, dt_s: f64, learning_s: f64, asked: bool) -> Service {
        let (next, service) = match *self {
            // A request during learning restarts it.
            _ if asked => (Self::Init, Service::None),
            Self::Idle => (Self::Idle, Service::None),
            Self::Init => (Self::Learning(0.0), Service::Init),
            Self::Learning(elapsed_s) if elapsed_s + dt_s >= learning_s => {
                (Self::Adapt, Service::Set)
            }
            Self::Learning(elapsed_s) => (Self::Learning(elapsed_s + dt_s), Service::None),
            Self::Adapt => (Self::Idle, Service::Adapt),
        };
        *self = next;
        service
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TAU: f64 = 60.0;

    fn close(value: f64, wanted: f64) {
        assert!((value - wanted).abs() < 1e-12, "{value} is not {wanted}");
    }

    #[test]
    fn a_virtual_collision_raises_the_estimate_to_what_would_have_avoided_it() {
        let mut bias = Bias::new(2.0);
        bias.observe(1.5, 1.0, f64::INFINITY, TAU);
        close(bias.ident(), 0.5);
        // |R| <= S_Ident = 1 + 0.5: no virtual collision.
        bias.observe(1.4, 1.0, f64::INFINITY, TAU);
        close(bias.ident(), 0.5);
        // Locked: the applied bias is still the initial one (remark 3).
        bias.advance(1000.0);
        close(bias.value(TAU), 2.0);
    }

    #[test]
    fn equations_14_to_16_by_hand() {
        let mut bias = Bias::new(2.0);
        bias.observe(1.5, 1.0, f64::INFINITY, TAU);
        bias.set();
        bias.adapt();
        // Equation 15: applied at once, and changed only by a new estimate.
        close(bias.value(TAU), 0.5);
        bias.advance(30.0);
        close(bias.value(TAU), 0.5);
        // Equation 16: from 0.5 towards 0.9.
        bias.observe(1.9, 1.0, f64::INFINITY, TAU);
        close(bias.value(TAU), 0.5);
        bias.advance(60.0);
        let after = 0.9 - (-1.0_f64).exp() * 0.4;
        close(bias.value(TAU), after);
        // Again, from the current value.
        bias.observe(2.0, 1.0, f64::INFINITY, TAU);
        close(bias.value(TAU), after);
        bias.advance(60.0);
        close(bias.value(TAU), 1.0 - (-1.0_f64).exp() * (1.0 - after));
    }

    #[test]
    fn a_collision_teaches_no_more_than_the_test_lets_pass() {
        let mut bias = Bias::new(2.0);
        bias.observe(50.0, 1.0, 1.1 * (1.0 + 0.5), TAU);
        close(bias.ident(), 0.65);
    }

    #[test]
    fn a_request_goes_through_init_learning_and_adapt_back_to_idle() {
        let mut state = LearningState::default();
        assert_eq!(state.step(0.5, 2.0, false), Service::None);
        assert_eq!(state, LearningState::Idle);
        assert_eq!(state.step(0.5, 2.0, true), Service::None);
        assert_eq!(state, LearningState::Init);
        assert_eq!(state.step(0.5, 2.0, false), Service::Init);
        for _ in 0..3 {
            assert_eq!(state.step(0.5, 2.0, false), Service::None);
        }
        assert_eq!(state, LearningState::Learning(1.5));
        assert_eq!(state.step(0.5, 2.0, false), Service::Set);
        assert_eq!(state, LearningState::Adapt);
        assert_eq!(state.step(0.5, 2.0, false), Service::Adapt);
        assert_eq!(state, LearningState::Idle);
    }

    #[test]
    fn a_second_request_discards_the_estimate_and_keeps_the_bias_until_it_is_set() {
        let mut bias = Bias::new(2.0);
        bias.observe(1.5, 1.0, f64::INFINITY, TAU);
        bias.set();
        bias.adapt();
        bias.init(TAU);
        close(bias.ident(), 0.0);
        close(bias.value(TAU), 0.5);
        bias.observe(1.2, 1.0, f64::INFINITY, TAU);
        close(bias.value(TAU), 0.5);
        bias.set();
        assert!((bias.value(TAU) - 0.2).abs() < 1e-12);
        let mut state = LearningState::Learning(1.0);
        state.step(0.1, 2.0, true);
        assert_eq!(state, LearningState::Init);
    }
}
