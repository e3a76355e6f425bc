//! Faults that tests inject.

/// What goes wrong, and after how many passes of the place where it can.
#[derive(Debug, Default)]
pub(super) struct Faults {
    lost: Option<u32>,
    memory: Option<u32>,
    time: Option<u32>,
    spoil: bool,
}

/// Counts down, and tells whether it is time.
fn count_down(count: &mut Option<u32>) -> bool {
    match count {
        Some(0) => {
            *count = None;
            true
        }
        Some(left) => {
            *left -= 1;
            false
        }
        None => false,
    }
}

impl Faults {
    /// The device is lost at a submission.
    pub(super) fn lose_after(&mut self, submissions: u32) {
        self.lost = Some(submissions);
    }

    /// A buffer finds no memory.
    pub(super) fn refuse_memory_after(&mut self, buffers: u32) {
        self.memory = Some(buffers);
    }

    /// The device does not answer in time.
    pub(super) fn time_out_after(&mut self, waits: u32) {
        self.time = Some(waits);
    }

    /// A result is wrong.
    pub(super) fn spoil(&mut self) {
        self.spoil = true;
    }

    pub(super) fn spoiled(&mut self) -> bool {
        std::mem::take(&mut self.spoil)
    }
    pub(super) fn lost(&mut self) -> bool {
        count_down(&mut self.lost)
    }
    pub(super) fn memory(&mut self) -> bool {
        count_down(&mut self.memory)
    }
    pub(super) fn timed_out(&mut self) -> bool {
        count_down(&mut self.time)
    }
}
