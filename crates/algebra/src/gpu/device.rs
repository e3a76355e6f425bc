//! One opened graphics card: its limits, its memory, its pipelines, and how work reaches it.

use std::collections::HashMap;
use std::future::Future;
use std::marker::PhantomData;
use std::pin::pin;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use super::GpuChoice;
use super::error::GpuError;
use super::kernel::{Kernel, KernelName};
use super::real::Real;

/// How long one submission may take. Each holds about 50 ms of work by estimate.
const TIME_LIMIT: Duration = Duration::from_secs(20);

/// Bytes of unused buffers that the pool keeps.
const IDLE_BYTES: u64 = 64 << 20;

/// A rate of operations per second to begin with, until it is measured: that of a slow software device.
const FIRST_RATE: f64 = 5e8;

/// What is known of an adapter before it is opened.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Adapter {
    /// Its name.
    pub name: String,
    /// `vulkan`, `metal` or `dx12`.
    pub backend: String,
    /// The driver and its version.
    pub driver: String,
    /// Whether it is no hardware but a program on the CPU.
    pub software: bool,
    /// Whether its shaders know f64.
    pub f64: bool,
}

/// An opened graphics card.
pub struct Device {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    adapter: Adapter,
    limits: DeviceLimits,
    trouble: Arc<Trouble>,
    kernels: Mutex<HashMap<(KernelName, &'static str), Arc<Kernel>>>,
    idle: Arc<Mutex<Vec<wgpu::Buffer>>>,
    /// Measured operations per second of the products in f32 and f64, as bits.
    rates: [AtomicU64; 2],
    time_limit: Duration,
    #[cfg(test)]
    pub(super) faults: Mutex<super::faults::Faults>,
}

/// What a device allows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeviceLimits {
    /// Bytes that one binding may show to a kernel.
    pub binding_bytes: u64,
    /// Bytes of one buffer.
    pub buffer_bytes: u64,
    /// Work groups along one side of a dispatch.
    pub groups: u32,
}

/// What the driver says outside the calls that ask it.
#[derive(Default)]
struct Trouble {
    lost: Mutex<Option<String>>,
    refused: Mutex<Option<String>>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The value of a future that is ready at once, as those of wgpu are outside a browser.
fn now<F: Future>(future: F) -> Option<F::Output> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}

fn all_adapters() -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    descriptor.flags = wgpu::InstanceFlags::empty();
    let instance = wgpu::Instance::new(descriptor);
    now(instance.enumerate_adapters(wgpu::Backends::all())).unwrap_or_default()
}

fn describe(adapter: &wgpu::Adapter) -> Adapter {
    let info = adapter.get_info();
    Adapter {
        software: info.device_type == wgpu::DeviceType::Cpu,
        backend: info.backend.to_string(),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        f64: adapter.features().contains(wgpu::Features::SHADER_F64),
        name: info.name,
    }
}

/// All adapters of this machine, in the order of their numbers.
pub fn adapters() -> Vec<Adapter> {
    all_adapters().iter().map(describe).collect()
}

impl Device {
    /// Opens the adapter that is chosen; nothing is tested yet.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] and [`GpuError::Unusable`].
    pub fn open(choice: &GpuChoice) -> Result<Self, GpuError> {
        Self::open_with(choice, wgpu::Features::SHADER_F64)
    }

    /// The same, as if its shaders did not know f64.
    #[cfg(test)]
    pub fn open_without_f64(choice: &GpuChoice) -> Result<Self, GpuError> {
        Self::open_with(choice, wgpu::Features::empty())
    }

    /// Of what is not needed everywhere, `wanted` is asked for.
    fn open_with(choice: &GpuChoice, wanted: wgpu::Features) -> Result<Self, GpuError> {
        let adapters = all_adapters();
        let ranked: Vec<(String, Option<u8>)> = adapters
            .iter()
            .map(|adapter| {
                let rank = match adapter.get_info().device_type {
                    wgpu::DeviceType::Cpu => None,
                    wgpu::DeviceType::DiscreteGpu => Some(0),
                    wgpu::DeviceType::IntegratedGpu => Some(1),
                    wgpu::DeviceType::VirtualGpu | wgpu::DeviceType::Other => Some(2),
                };
                (adapter.get_info().name, rank)
            })
            .collect();
        let Some(place) = choice.among(&ranked) else {
            let mut found: Vec<String> =
                ranked.iter().enumerate().map(|(place, (name, _))| format!("{place} {name}")).collect();
            if found.is_empty() {
                found.push("none".into());
            }
            return Err(GpuError::NoAdapter { wanted: choice.to_string(), found: found.join(", ") });
        };
        Self::open_adapter(&adapters[place], wanted)
    }

    fn open_adapter(chosen: &wgpu::Adapter, wanted: wgpu::Features) -> Result<Self, GpuError> {
        let mut adapter = describe(chosen);
        adapter.f64 &= wanted.contains(wgpu::Features::SHADER_F64);
        let adapter = adapter;
        let unusable = |reason: String| GpuError::Unusable { adapter: adapter.name.clone(), reason };
        if !chosen.features().contains(wgpu::Features::IMMEDIATES) {
            return Err(unusable("it takes no immediate parameters".into()));
        }
        let limits = chosen.limits();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("chladni"),
            required_features: chosen.features() & (wanted | wgpu::Features::IMMEDIATES),
            required_limits: limits.clone(),
            ..Default::default()
        };
        let (device, queue) = now(chosen.request_device(&descriptor))
            .ok_or_else(|| unusable("its driver does not answer".into()))?
            .map_err(|error| unusable(error.to_string()))?;
        let trouble = Arc::new(Trouble::default());
        let (told, lost) = (trouble.clone(), trouble.clone());
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            lock(&told.refused).get_or_insert_with(|| error.to_string());
        }));
        device.set_device_lost_callback(move |_, reason| {
            lock(&lost.lost).get_or_insert(reason);
        });
        Ok(Self {
            device,
            queue,
            limits: DeviceLimits {
                // A multiple of what every alignment asks for, and counted in 32 bits by the kernels.
                binding_bytes: limits.max_storage_buffer_binding_size.min(2 << 30) & !0xff,
                buffer_bytes: limits.max_buffer_size,
                groups: limits.max_compute_workgroups_per_dimension,
            },
            adapter,
            trouble,
            kernels: Mutex::default(),
            idle: Arc::default(),
            rates: [const { AtomicU64::new(0) }; 2],
            time_limit: TIME_LIMIT,
            #[cfg(test)]
            faults: Mutex::default(),
        })
    }

    /// What is known of its adapter.
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    /// What it allows.
    pub fn limits(&self) -> DeviceLimits {
        self.limits
    }

    /// Smaller limits, so that small matrices are cut as large ones are.
    #[cfg(test)]
    pub fn limit(&mut self, binding_bytes: u64, buffer_bytes: u64) {
        self.limits.binding_bytes = binding_bytes.min(self.limits.binding_bytes);
        self.limits.buffer_bytes = buffer_bytes.min(self.limits.buffer_bytes);
    }

    /// Another limit of time for each submission.
    #[cfg(test)]
    pub fn limit_time(&mut self, limit: Duration) {
        self.time_limit = limit;
    }

    /// Operations per second of a product, as measured, or a low guess.
    pub(super) fn rate<T: Real>(&self) -> f64 {
        let rate = f64::from_bits(self.rates[usize::from(T::IS_F64)].load(Ordering::Relaxed));
        if rate > 0.0 { rate } else { FIRST_RATE }
    }

    pub(super) fn set_rate<T: Real>(&self, rate: f64) {
        self.rates[usize::from(T::IS_F64)].store(rate.to_bits(), Ordering::Relaxed);
    }

    /// A kernel, compiled on its first use.
    ///
    /// # Errors
    /// [`GpuError::Refused`] with what the compiler said.
    pub(super) fn kernel<T: Real>(&self, name: KernelName) -> Result<Arc<Kernel>, GpuError> {
        let mut kernels = lock(&self.kernels);
        if let Some(kernel) = kernels.get(&(name, T::NAME)) {
            return Ok(kernel.clone());
        }
        let kernel = Arc::new(self.checked(wgpu::ErrorFilter::Validation, || Kernel::new::<T>(&self.device, name))?);
        kernels.insert((name, T::NAME), kernel.clone());
        Ok(kernel)
    }

    /// Runs something whose errors of this kind are the caller's.
    fn checked<T>(&self, filter: wgpu::ErrorFilter, action: impl FnOnce() -> T) -> Result<T, GpuError> {
        let scope = self.device.push_error_scope(filter);
        let value = action();
        match now(scope.pop()).flatten() {
            None => Ok(value),
            Some(error) => Err(GpuError::Refused { reason: error.to_string() }),
        }
    }

    /// A buffer for kernels, from the pool where one fits. Its content is arbitrary.
    ///
    /// # Errors
    /// [`GpuError::Memory`].
    pub(super) fn buffer<T: bytemuck::Pod>(&self, values: u64) -> Result<Buffer<T>, GpuError> {
        let bytes = (values * size_of::<T>() as u64).next_multiple_of(256).max(256);
        self.room(bytes)?;
        let mut idle = lock(&self.idle);
        let fits = |buffer: &wgpu::Buffer| buffer.size() >= bytes && buffer.size() <= bytes + bytes / 4;
        let best = (0..idle.len()).filter(|&k| fits(&idle[k])).min_by_key(|&k| idle[k].size());
        let buffer = match best {
            Some(place) => idle.swap_remove(place),
            None => {
                drop(idle);
                let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
                self.new_buffer(bytes, usage)?
            }
        };
        Ok(Buffer { buffer, idle: self.idle.clone(), values, number: PhantomData })
    }

    fn room(&self, bytes: u64) -> Result<(), GpuError> {
        #[cfg(test)]
        if lock(&self.faults).memory() {
            return Err(GpuError::Memory { bytes });
        }
        if bytes > self.limits.buffer_bytes || bytes > self.limits.binding_bytes {
            return Err(GpuError::Memory { bytes });
        }
        Ok(())
    }

    pub(super) fn new_buffer(&self, bytes: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, GpuError> {
        let descriptor = wgpu::BufferDescriptor { label: None, size: bytes, usage, mapped_at_creation: false };
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer = self.checked(wgpu::ErrorFilter::Validation, || self.device.create_buffer(&descriptor));
        match now(memory.pop()).flatten() {
            Some(_) => Err(GpuError::Memory { bytes }),
            None => buffer,
        }
    }

    /// Gives the memory of unused buffers back, but for a little.
    pub(super) fn trim(&self) {
        let mut idle = lock(&self.idle);
        idle.sort_by_key(wgpu::Buffer::size);
        let mut kept = 0;
        idle.retain(|buffer| {
            kept += buffer.size();
            kept <= IDLE_BYTES
        });
    }

    /// What went wrong since it was last asked.
    ///
    /// # Errors
    /// [`GpuError::Lost`], [`GpuError::Refused`].
    pub(super) fn check(&self) -> Result<(), GpuError> {
        if let Some(reason) = lock(&self.trouble.lost).clone() {
            return Err(GpuError::Lost { reason });
        }
        match lock(&self.trouble.refused).take() {
            Some(reason) => Err(GpuError::Refused { reason }),
            None => Ok(()),
        }
    }

    /// Hands commands to the device.
    pub(super) fn submit(&self, commands: wgpu::CommandBuffer) -> Result<wgpu::SubmissionIndex, GpuError> {
        #[cfg(test)]
        if lock(&self.faults).lost() {
            self.device.destroy();
        }
        let submission = self.queue.submit([commands]);
        self.check()?;
        Ok(submission)
    }

    /// Whether a test wants a wrong result.
    #[cfg(test)]
    pub(super) fn spoiled(&self) -> bool {
        lock(&self.faults).spoiled()
    }

    /// Waits until a submission is done.
    pub(super) fn wait(&self, submission: Option<wgpu::SubmissionIndex>) -> Result<(), GpuError> {
        #[cfg(test)]
        if lock(&self.faults).timed_out() {
            return Err(GpuError::TimedOut { seconds: self.time_limit.as_secs_f64() });
        }
        let waiting = wgpu::PollType::Wait { submission_index: submission, timeout: Some(self.time_limit) };
        match self.device.poll(waiting) {
            Ok(_) => self.check(),
            Err(wgpu::PollError::Timeout) => {
                self.check()?;
                Err(GpuError::TimedOut { seconds: self.time_limit.as_secs_f64() })
            }
            // A device that is gone takes no submissions, but says so only later.
            Err(wgpu::PollError::WrongSubmissionIndex(..)) => {
                self.check()?;
                Err(GpuError::Lost { reason: "it dropped a submission".into() })
            }
        }
    }
}

/// A buffer of numbers on the device. Dropped, it returns to the pool.
pub(super) struct Buffer<T> {
    buffer: wgpu::Buffer,
    idle: Arc<Mutex<Vec<wgpu::Buffer>>>,
    values: u64,
    number: PhantomData<T>,
}

impl<T: bytemuck::Pod> Buffer<T> {
    /// The buffer, for copies.
    pub(super) fn raw(&self) -> &wgpu::Buffer {
        &self.buffer
    }

    /// What a kernel sees: the numbers asked for, not the whole buffer, which may be larger.
    pub(super) fn binding(&self) -> wgpu::BindingResource<'_> {
        let bytes = (self.values * size_of::<T>() as u64).next_multiple_of(16);
        let size = std::num::NonZeroU64::new(bytes);
        wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer: &self.buffer, offset: 0, size })
    }
}

impl<T> Drop for Buffer<T> {
    fn drop(&mut self) {
        lock(&self.idle).push(self.buffer.clone());
    }
}
