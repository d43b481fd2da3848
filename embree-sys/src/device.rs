//! Embree itself: its threads, its instruction set, its errors.

use std::{
    ffi::{CStr, CString, c_char, c_void},
    num::NonZeroUsize,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

use crate::{
    error::{Error, ErrorCode},
    raw::{self, RTCDevice, RTCDeviceProperty, RTCError},
};

/// A counted handle of an Embree device; clones are the same device.
#[derive(Debug, Clone)]
pub struct Device {
    shared: Arc<Shared>,
}

/// How Embree is started.
#[derive(Debug, Clone, Default)]
pub struct DeviceConfig {
    /// Threads that build scenes; `None` for one per processor thread. Tracing
    /// happens in the threads that call, whatever this says.
    pub build_threads: Option<NonZeroUsize>,
    /// The newest instruction set that may be used; `None` for the machine's
    /// best. Lower ones are for measuring what other machines would do.
    pub isa_max: Option<Isa>,
}

/// An instruction set that Embree has code for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Isa {
    /// SSE 2, four lanes.
    Sse2,
    /// SSE 4.2, four lanes.
    Sse42,
    /// AVX, eight lanes.
    Avx,
    /// AVX 2, eight lanes.
    Avx2,
    /// AVX-512, sixteen lanes.
    Avx512,
}

/// How many rays a packet should have to be traced at full speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum PacketWidth {
    /// Packets of 4 (SSE).
    W4,
    /// Packets of 8 (AVX).
    W8,
    /// Packets of 16 (AVX-512).
    W16,
}

#[derive(Debug)]
struct Shared {
    handle: RTCDevice,
    /// Held by the one thread that builds a scene.
    building: Mutex<()>,
    /// Counted, so that it stays where it is: Embree keeps its address.
    messages: Arc<Messages>,
}

/// Embree's words about its latest error.
#[derive(Debug, Default)]
struct Messages(Mutex<String>);

// SAFETY: Embree's objects belong to no thread. Calls on the same object must not
// happen at the same time unless their page allows it ("Embree API",
// introduction): those that make objects are kept apart by `building`, the
// others read a property that never changes or an error kept per thread.
unsafe impl Send for Shared {}
// SAFETY: as above.
unsafe impl Sync for Shared {}

impl Device {
    /// Starts Embree.
    ///
    /// # Errors
    /// [`Error::Start`] if this machine lacks the instruction set or the memory,
    /// [`Error::Version`] if the loaded library is not Embree 4.
    pub fn new(config: &DeviceConfig) -> Result<Self, Error> {
        let text = config.to_text();
        let start_error = |code| Error::Start {
            config: text.clone(),
            code,
        };
        let config = CString::new(text.as_str()).map_err(|_nul| start_error(ErrorCode::InvalidArgument))?;

        // SAFETY: the string ends with NUL and lives during the call ("Embree
        // API", rtcNewDevice); NULL as result is handled below.
        let handle = unsafe { raw::rtcNewDevice(config.as_ptr()) };
        if handle.is_null() {
            // SAFETY: with NULL it gives the error of the failed rtcNewDevice
            // in this thread ("Embree API", rtcGetDeviceError).
            let code = unsafe { raw::rtcGetDeviceError(handle) };
            return Err(start_error(
                ErrorCode::from_raw(code).unwrap_or(ErrorCode::Unknown(0)),
            ));
        }

        // Before anything else, so that no message gets lost.
        let messages = Arc::<Messages>::default();
        let user_data = Arc::as_ptr(&messages).cast_mut().cast::<c_void>();
        // SAFETY: `record_error` expects a `Messages`, which `Shared` keeps
        // alive until the device is released ("Embree API",
        // rtcSetDeviceErrorFunction).
        unsafe { raw::rtcSetDeviceErrorFunction(handle, Some(record_error), user_data) };

        let device = Self {
            shared: Arc::new(Shared {
                handle,
                building: Mutex::default(),
                messages,
            }),
        };
        let found = device.property(RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION);
        if found / 10_000 == 4 {
            Ok(device)
        } else {
            Err(Error::Version { found })
        }
    }

    /// Embree's version as (major, minor, patch).
    pub fn version(&self) -> (isize, isize, isize) {
        let number = self.property(RTCDeviceProperty::RTC_DEVICE_PROPERTY_VERSION);
        (number / 10_000, number / 100 % 100, number % 100)
    }

    /// The widest packet that is traced as a packet. Wider ones work too, but
    /// fall to the speed of single rays.
    pub fn native_packet_width(&self) -> PacketWidth {
        let supported = |property| self.property(property) != 0;
        if supported(RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) {
            PacketWidth::W16
        } else if supported(RTCDeviceProperty::RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) {
            PacketWidth::W8
        } else {
            PacketWidth::W4
        }
    }

    fn property(&self, property: RTCDeviceProperty) -> isize {
        // SAFETY: the handle is live; the properties asked for exist in every
        // Embree 4 ("Embree API", rtcGetDeviceProperty).
        unsafe { raw::rtcGetDeviceProperty(self.shared.handle, property) }
    }

    pub(crate) fn handle(&self) -> RTCDevice {
        self.shared.handle
    }

    /// Keeps every other thread from making objects of this device.
    pub(crate) fn build_alone(&self) -> MutexGuard<'_, ()> {
        self.shared
            .building
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// The error of this thread's calls on the device since the last check, if
    /// there was one.
    pub(crate) fn check(&self, doing: &'static str) -> Result<(), Error> {
        // SAFETY: the handle is live ("Embree API", rtcGetDeviceError).
        let code = unsafe { raw::rtcGetDeviceError(self.shared.handle) };
        match ErrorCode::from_raw(code) {
            None => Ok(()),
            Some(code) => Err(Error::Embree {
                doing,
                code,
                message: self.shared.messages.take(),
            }),
        }
    }

    /// The error behind a call that gave nothing.
    pub(crate) fn failure(&self, doing: &'static str) -> Error {
        let nameless = Error::Embree {
            doing,
            code: ErrorCode::Unknown(0),
            message: String::new(),
        };
        self.check(doing).err().unwrap_or(nameless)
    }
}

impl Drop for Shared {
    fn drop(&mut self) {
        // SAFETY: the handle is live and this is its last use; `messages` is
        // dropped after it ("Embree API", rtcReleaseDevice).
        unsafe { raw::rtcReleaseDevice(self.handle) };
    }
}

impl DeviceConfig {
    /// The settings in the notation of `rtcNewDevice`.
    fn to_text(&self) -> String {
        let threads = self.build_threads.map(|threads| format!("threads={threads}"));
        let isa = self.isa_max.map(|isa| format!("max_isa={}", isa.name()));
        let settings: Vec<String> = threads.into_iter().chain(isa).collect();
        settings.join(",")
    }
}

impl Isa {
    fn name(self) -> &'static str {
        match self {
            Self::Sse2 => "sse2",
            Self::Sse42 => "sse4.2",
            Self::Avx => "avx",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

impl PacketWidth {
    /// The width as a number of rays.
    pub fn lanes(self) -> usize {
        match self {
            Self::W4 => 4,
            Self::W8 => 8,
            Self::W16 => 16,
        }
    }
}

impl Messages {
    fn put(&self, message: String) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = message;
    }

    fn take(&self) -> String {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Embree calls this for each error, in the thread in which it happens.
unsafe extern "C" fn record_error(user_data: *mut c_void, _code: RTCError, message: *const c_char) {
    if user_data.is_null() || message.is_null() {
        return;
    }
    // SAFETY: `Device::new` gave the address of a `Messages` that outlives the
    // device ("Embree API", rtcSetDeviceErrorFunction).
    let messages = unsafe { &*user_data.cast::<Messages>() };
    // SAFETY: the message is a C string that lives during the call (same page).
    let message = unsafe { CStr::from_ptr(message) };
    messages.put(message.to_string_lossy().into_owned());
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device_up_to(isa: Isa) -> Device {
        Device::new(&DeviceConfig {
            isa_max: Some(isa),
            ..DeviceConfig::default()
        })
        .expect("every x86_64 has SSE 2")
    }

    #[test]
    fn the_loaded_library_is_embree_4() {
        let device = Device::new(&DeviceConfig::default()).expect("Embree starts");
        assert_eq!(device.version().0, 4);
    }

    #[test]
    fn packets_are_as_wide_as_the_instruction_set_allows() {
        assert_eq!(device_up_to(Isa::Sse2).native_packet_width(), PacketWidth::W4);
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            assert_eq!(device_up_to(Isa::Avx2).native_packet_width(), PacketWidth::W8);
        }
    }

    #[test]
    fn an_error_keeps_embrees_words() {
        let device = Device::new(&DeviceConfig::default()).expect("Embree starts");
        let quality = raw::RTCBuildQuality(77);
        // SAFETY: the device is live; a quality without a name is refused by
        // rtcSetSceneBuildQuality with an error ("Embree API", same page).
        unsafe {
            let scene = raw::rtcNewScene(device.handle());
            raw::rtcSetSceneBuildQuality(scene, quality);
            raw::rtcReleaseScene(scene);
        }
        let error = device
            .check("setting a quality that does not exist")
            .expect_err("Embree refuses it");
        let Error::Embree { message, .. } = &error else {
            panic!("another error: {error}");
        };
        assert!(message.contains("quality"), "{message}");
        assert_eq!(device.check("nothing"), Ok(()));
    }
}
