//! How long storms last, and what happens in them at random.

use std::time::Duration;

/// The rounds of a storm: `CHLADNI_STORMS`, or a few.
pub fn rounds(few: usize) -> usize {
    std::env::var("CHLADNI_STORMS").ok().and_then(|rounds| rounds.parse().ok()).unwrap_or(few)
}

/// What its numbers begin with: `CHLADNI_SEED`, or what they usually do.
pub fn seed(usual: u64) -> u64 {
    std::env::var("CHLADNI_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(usual)
}

/// Numbers at random, the same every time.
pub struct Dice(pub u64);

impl Dice {
    pub fn below(&mut self, bound: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % bound
    }

    pub fn pause(&mut self, least_ms: u64, most_ms: u64) -> Duration {
        Duration::from_millis(least_ms + self.below(most_ms - least_ms))
    }
}
