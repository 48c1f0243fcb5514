//! Devices: a list of those available, and one made ready.

use std::sync::{Arc, Mutex, PoisonError};

use super::compiled::CompiledPasses;
use super::pipeline_file::{PipelineFile, cache_folder};
use crate::Error;

/// A device that can render.
#[derive(Clone, Debug, serde::Serialize)]
pub struct AdapterSummary {
    /// Name given by the driver.
    pub name: String,
    /// Place on the PCI bus, such as `0000:3b:00.0`; empty if the driver tells none.
    pub pci_bus_id: String,
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
    /// Pipelines of earlier starts; `None` if the device does not hand them out.
    pub(super) pipelines: Option<Arc<PipelineFile>>,
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
        pci_bus_id: info.device_pci_bus_id,
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
/// Features for 64-bit atomics of any kind, and for talk among the invocations of a subgroup.
pub(crate) const INT64_IN_LANES: wgpu::Features =
    INT64_ATOMICS.union(wgpu::Features::SHADER_INT64_ATOMIC_ALL_OPS).union(wgpu::Features::SUBGROUP);

/// The device that suits a renderer best: all limits of the adapter, and those of its features that renderers use. For
/// [`Renderer::with_device`](crate::Renderer::with_device).
pub fn device_descriptor(adapter: &wgpu::Adapter) -> wgpu::DeviceDescriptor<'static> {
    let timing = wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES;
    let optional = INT64_IN_LANES | timing | wgpu::Features::FLOAT32_BLENDABLE | wgpu::Features::PIPELINE_CACHE;
    wgpu::DeviceDescriptor {
        label: Some("autosplats"),
        required_features: adapter.features() & optional,
        required_limits: adapter.limits(),
        ..Default::default()
    }
}

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

/// The place in a list of devices that `which` names: the place itself, or that of a device by its PCI bus id, whose
/// domain of zeros may be left out.
fn place_of(which: &str, buses: &[&str]) -> Option<usize> {
    if let Ok(place) = which.trim().parse::<usize>() {
        return (place < buses.len()).then_some(place);
    }
    let bare = |bus: &str| {
        let small = bus.trim().to_lowercase();
        small.strip_prefix("00000000:").or(small.strip_prefix("0000:")).map(str::to_owned).unwrap_or(small)
    };
    let wanted = bare(which);
    buses.iter().position(|bus| !bus.is_empty() && bare(bus) == wanted)
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

    /// The device that `which` names: its index in [`adapters`], or its place on the PCI bus.
    ///
    /// # Errors
    /// [`Error::Device`] if there is no such device, or it does not start.
    pub(crate) fn named(which: &str) -> Result<Self, Error> {
        let adapters = usable_adapters();
        let infos: Vec<wgpu::AdapterInfo> = adapters.iter().map(wgpu::Adapter::get_info).collect();
        let buses: Vec<&str> = infos.iter().map(|info| &*info.device_pci_bus_id).collect();
        if let Some(place) = place_of(which, &buses) {
            return Self::open(&adapters[place]);
        }
        let shown = |(place, info): (usize, &wgpu::AdapterInfo)| {
            let wgpu::AdapterInfo { name, device_pci_bus_id: bus, .. } = info;
            if bus.is_empty() { format!("{place} ({name})") } else { format!("{place} or {bus} ({name})") }
        };
        let known: Vec<String> = infos.iter().enumerate().map(shown).collect();
        let known = if known.is_empty() { "there is none".into() } else { format!("there are: {}", known.join(", ")) };
        Err(Error::Device(format!("no device is called '{which}'; {known}")))
    }

    fn open(adapter: &wgpu::Adapter) -> Result<Self, Error> {
        let (device, queue) = pollster::block_on(adapter.request_device(&device_descriptor(adapter)))
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
        // Software compiles anew in any case.
        let folder = cache_folder().filter(|_| !is_software(&device.adapter_info()));
        let pipelines = folder.and_then(|folder| PipelineFile::open(&device, &folder)).map(Arc::new);
        Self { device, queue, lost: Arc::default(), compiled: Arc::default(), pipelines }
    }

    /// Keeps the pipelines compiled so far for the next start. Without a file, that only starts more slowly.
    pub(crate) fn store_pipelines(&self) {
        let _ = self.pipelines.as_ref().map(|pipelines| pipelines.store());
    }

    /// Description of the device.
    pub(crate) fn summary(&self) -> AdapterSummary {
        summary(self.device.adapter_info(), self.device.features(), &self.device.limits())
    }

    /// Whether the device is a program on the CPU.
    pub(crate) fn is_software(&self) -> bool {
        is_software(&self.device.adapter_info())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_named_by_place_and_by_bus() {
        let buses = ["0000:3b:00.0", "", "0000:af:00.0"];
        let found =
            ["0", "2", " 1 ", "0000:AF:00.0", "3b:00.0", "00000000:3B:00.0"].map(|which| place_of(which, &buses));
        assert_eq!(found, [Some(0), Some(2), Some(1), Some(2), Some(0), Some(0)]);
        for wrong in ["3", "-1", "", "0000:", "00:00.0", "llvmpipe"] {
            assert_eq!(place_of(wrong, &buses), None, "{wrong}");
        }
    }

    #[test]
    fn a_device_that_is_not_there_is_named() {
        let Err(Error::Device(message)) = Gpu::named("99") else { panic!("there are no hundred devices") };
        assert!(message.contains("'99'") && message.contains("there "), "{message}");
    }
}
