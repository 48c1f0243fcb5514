//! Devices: a list of those available, and one made ready.

use std::sync::{Arc, Mutex, PoisonError};

use super::compiled::CompiledPasses;
use crate::Error;

/// A device that can render.
#[derive(Clone, Debug, serde::Serialize)]
pub struct AdapterSummary {
    /// Name given by the driver.
    pub name: String,
    /// Vulkan, Metal, Dx12 …
    pub backend: String,
    /// DiscreteGpu, IntegratedGpu, Cpu (software) …
    pub kind: String,
    /// Driver name and version.
    pub driver: String,
    /// Whether the device is a program on the CPU, which is slower than the CPU backend.
    pub software: bool,
    /// Whether depth and index of a point fit one atomic operation. Otherwise points are projected in two passes.
    pub int64_atomics: bool,
    /// Whether the device can time its passes.
    pub timestamps: bool,
    /// Points in one storage binding; larger clouds are split.
    pub points_per_binding: u64,
}

/// A device and its queue.
#[derive(Clone, Debug)]
pub(crate) struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// Why the device was lost; `None` while it works.
    lost: Arc<Mutex<Option<String>>>,
    /// Passes compiled so far, for all clones: a change of size or colour mode asks for most of them again.
    pub(super) compiled: Arc<Mutex<CompiledPasses>>,
}

/// All devices that can render, hardware first.
///
/// # Examples
///
/// ```no_run
/// for adapter in autosplats::adapters() {
///     println!("{} ({}, {})", adapter.name, adapter.backend, adapter.kind);
/// }
/// ```
pub fn adapters() -> Vec<AdapterSummary> {
    let summary = |adapter: &wgpu::Adapter| summary(adapter.get_info(), adapter.features(), &adapter.limits());
    usable_adapters().iter().map(summary).collect()
}

fn summary(info: wgpu::AdapterInfo, features: wgpu::Features, limits: &wgpu::Limits) -> AdapterSummary {
    AdapterSummary {
        software: is_software(&info),
        driver: format!("{} {}", info.driver, info.driver_info).trim().into(),
        name: info.name,
        backend: format!("{:?}", info.backend),
        kind: format!("{:?}", info.device_type),
        int64_atomics: features.contains(INT64_ATOMICS),
        timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
        points_per_binding: limits.max_storage_buffer_binding_size.min(limits.max_buffer_size) / 12,
    }
}

/// Whether the device is a program on the CPU.
fn is_software(info: &wgpu::AdapterInfo) -> bool {
    info.device_type == wgpu::DeviceType::Cpu
}

/// Features for one 64-bit atomic minimum.
pub(crate) const INT64_ATOMICS: wgpu::Features =
    wgpu::Features::SHADER_INT64.union(wgpu::Features::SHADER_INT64_ATOMIC_MIN_MAX);

fn usable_adapters() -> Vec<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::PRIMARY;
    descriptor.flags = wgpu::InstanceFlags::empty().with_env();
    let instance = wgpu::Instance::new(descriptor);
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
    adapters
        .retain(|adapter| adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS));
    // A stable sort keeps the driver's order among devices of a kind.
    adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    adapters
}

impl Gpu {
    /// Opens the best device.
    ///
    /// # Errors
    /// [`Error::Device`] if there is none, or it does not start.
    pub(crate) fn new() -> Result<Self, Error> {
        let adapter = usable_adapters().into_iter().next().ok_or_else(|| {
            Error::Device(
                "there is none: no Vulkan, Metal or DirectX 12 driver was found; install one or use the CPU backend"
                    .into(),
            )
        })?;
        Self::open(&adapter)
    }

    /// The best device that is hardware, or `None`. A software device is never opened: its adapter already says what it
    /// is.
    ///
    /// # Errors
    /// [`Error::Device`] if the device does not start.
    pub(crate) fn hardware() -> Result<Option<Self>, Error> {
        let adapter = usable_adapters().into_iter().next();
        adapter.filter(|adapter| !is_software(&adapter.get_info())).map(|adapter| Self::open(&adapter)).transpose()
    }

    fn open(adapter: &wgpu::Adapter) -> Result<Self, Error> {
        let optional = INT64_ATOMICS | wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::FLOAT32_BLENDABLE;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("autosplats"),
            required_features: adapter.features() & optional,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::Device(format!("{} does not start: {error}", adapter.get_info().name)))?;
        let gpu = Self::from_parts(device, queue);
        let reason = Arc::clone(&gpu.lost);
        gpu.device.set_device_lost_callback(move |_, message| {
            *reason.lock().unwrap_or_else(PoisonError::into_inner) = Some(message);
        });
        Ok(gpu)
    }

    /// Takes the caller's device and leaves its callback for loss alone; a loss is noticed when the device does not
    /// answer.
    pub(crate) fn from_parts(device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self { device, queue, lost: Arc::default(), compiled: Arc::default() }
    }

    /// Description of the device.
    pub(crate) fn summary(&self) -> AdapterSummary {
        summary(self.device.adapter_info(), self.device.features(), &self.device.limits())
    }

    /// Whether the device is a program on the CPU.
    pub(crate) fn is_software(&self) -> bool {
        is_software(&self.device.adapter_info())
    }

    /// Whether depth and index of a point fit one atomic operation.
    pub(crate) fn int64_atomics(&self) -> bool {
        self.device.features().contains(INT64_ATOMICS)
    }

    /// Returns what `make` creates, if the device accepts it.
    ///
    /// # Errors
    /// [`Error::DeviceMemory`] if the device has no room, [`Error::Device`] if it refuses, [`Error::DeviceLost`].
    pub(crate) fn checked<T>(&self, make: impl FnOnce() -> T) -> Result<T, Error> {
        let invalid = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let full = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let made = make();
        let [full, invalid] = [full, invalid].map(|scope| pollster::block_on(scope.pop()));
        self.check_lost()?;
        match (full, invalid) {
            (None, None) => Ok(made),
            (Some(_), _) => Err(Error::DeviceMemory(None)),
            (_, Some(error)) => Err(Error::Device(error.to_string())),
        }
    }

    /// # Errors
    /// [`Error::DeviceLost`] if the device is.
    pub(crate) fn check_lost(&self) -> Result<(), Error> {
        match &*self.lost.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(message) => Err(Error::DeviceLost(message.clone())),
            None => Ok(()),
        }
    }
}

/// The device to test on, opened once for all tests of the process. Without a device a test says that it checks
/// nothing; where `CI` is set, it fails.
#[cfg(test)]
pub(crate) fn test_gpu() -> Option<Gpu> {
    static GPU: std::sync::LazyLock<Result<Gpu, Error>> = std::sync::LazyLock::new(Gpu::new);
    match &*GPU {
        Ok(gpu) => Some(gpu.clone()),
        Err(error) => {
            assert!(std::env::var_os("CI").is_none(), "{error}");
            eprintln!("nothing checked: {error}");
            None
        }
    }
}
