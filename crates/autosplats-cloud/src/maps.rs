//! Maps of files into memory, the only place where they are made.
//!
//! # How it works
//!
//! If a file is cut short while it is mapped, or its disk fails, reading the missing bytes raises SIGBUS, which ends
//! the process. A handler of that signal looks for the address in a table of all maps. It puts zeros in the place of
//! the map from there on, and marks the map as cut. The reader goes on with zeros, and its result is refused then.
//! Signals of other addresses go to the handler that was there before. Reading instead of mapping would cost memory and
//! time; see docs/decisions/0051-inputs-that-fail.md.
//!
//! The handler only loads and stores atomics, and calls `mmap`, a single system call.
#![allow(unsafe_code, reason = "maps and handlers of signals need it")]

use std::{fs::File, ops::Deref};

/// A map of a whole file, to be read.
pub(crate) struct Map {
    map: memmap2::Mmap,
    #[cfg(unix)]
    entry: &'static guard::Entry,
}

impl Map {
    /// Maps a file of `len` bytes. `None` if it has to be read instead: an empty one, or one beyond the table of maps.
    pub(crate) fn new(file: &File, len: u64) -> std::io::Result<Option<Self>> {
        if len == 0 {
            return Ok(None);
        }
        #[cfg(unix)]
        let Some(entry) = guard::Entry::claim() else { return Ok(None) };
        // SAFETY: the map is read-only, and missing pages become zeros. If another program writes to the file, values
        // are wrong, but every access is checked against the length at mapping, and `Bytes::checked` tells. All
        // programs that map files carry that risk.
        let map = unsafe { memmap2::Mmap::map(file) };
        #[cfg(unix)]
        if map.is_err() {
            entry.release();
        }
        let map = map?;
        #[cfg(unix)]
        entry.fill(&map);
        Ok(Some(Self {
            map,
            #[cfg(unix)]
            entry,
        }))
    }

    /// Whether bytes of the file were missing when they were read.
    pub(crate) fn is_cut(&self) -> bool {
        #[cfg(unix)]
        return self.entry.is_cut();
        #[cfg(not(unix))]
        false
    }
}

impl Deref for Map {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.map
    }
}

#[cfg(unix)]
impl Drop for Map {
    fn drop(&mut self) {
        // Before the memory is given back, so that the table never has memory of others.
        self.entry.release();
    }
}

#[cfg(unix)]
mod guard {
    use std::{
        ffi::c_int,
        ptr::null_mut,
        sync::{
            Once, OnceLock,
            atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst},
        },
    };

    /// Most maps at the same time; files beyond are read.
    const MAPS: usize = 1024;

    /// A map in the table: its first address and the one after its last. `start` is 0 for a free entry, and
    /// [`CLAIMED`] while the other values are written.
    pub(super) struct Entry {
        start: AtomicUsize,
        end: AtomicUsize,
        cut: AtomicBool,
    }

    const CLAIMED: usize = usize::MAX;

    static TABLE: [Entry; MAPS] =
        [const { Entry { start: AtomicUsize::new(0), end: AtomicUsize::new(0), cut: AtomicBool::new(false) } }; MAPS];

    /// Number of bytes that the system maps at least; set with the handler.
    static PAGE: AtomicUsize = AtomicUsize::new(0);

    /// What was done about the signal before.
    static BEFORE: OnceLock<libc::sigaction> = OnceLock::new();

    impl Entry {
        /// An entry that nobody else has; `None` if all are taken.
        pub(super) fn claim() -> Option<&'static Self> {
            static INSTALLED: Once = Once::new();
            INSTALLED.call_once(install);
            TABLE.iter().find(|entry| entry.start.compare_exchange(0, CLAIMED, SeqCst, SeqCst).is_ok())
        }

        pub(super) fn fill(&self, map: &[u8]) {
            self.cut.store(false, SeqCst);
            self.end.store(map.as_ptr() as usize + map.len(), SeqCst);
            self.start.store(map.as_ptr() as usize, SeqCst);
        }

        pub(super) fn release(&self) {
            self.start.store(0, SeqCst);
        }

        pub(super) fn is_cut(&self) -> bool {
            self.cut.load(SeqCst)
        }

        /// The end of the map, if it has an address.
        fn end_if_has(&self, address: usize) -> Option<usize> {
            let start = self.start.load(SeqCst);
            let end = self.end.load(SeqCst);
            // Another thread may give the entry to another map meanwhile. With the same start before and after, both
            // values are of one map that was there at the same time as that of the address, so they do not overlap.
            (start != 0 && start <= address && address < end && self.start.load(SeqCst) == start).then_some(end)
        }
    }

    fn install() {
        // SAFETY: plain calls of the system with values that live long enough; a zeroed `sigaction` is valid.
        unsafe {
            PAGE.store(usize::try_from(libc::sysconf(libc::_SC_PAGESIZE)).unwrap_or(4096), SeqCst);
            let mut action: libc::sigaction = std::mem::zeroed();
            action.sa_sigaction = handle as extern "C" fn(c_int, *mut libc::siginfo_t, *mut libc::c_void) as usize;
            // On the thread's own stack for signals, as the handler before may need it.
            action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
            libc::sigemptyset(&raw mut action.sa_mask);
            let mut before: libc::sigaction = std::mem::zeroed();
            if libc::sigaction(libc::SIGBUS, &raw const action, &raw mut before) == 0 {
                let _ = BEFORE.set(before);
            }
        }
    }

    extern "C" fn handle(signal: c_int, info: *mut libc::siginfo_t, context: *mut libc::c_void) {
        // SAFETY: the system passes a valid `siginfo_t` to handlers with SA_SIGINFO. Memory that is mapped anew lies
        // within a map that its reader holds, and stays readable.
        unsafe {
            let address = (*info).si_addr() as usize;
            let found = TABLE.iter().find_map(|entry| Some((entry, entry.end_if_has(address)?)));
            if let Some((entry, end)) = found {
                let page = address & !(PAGE.load(SeqCst) - 1);
                let flags = libc::MAP_FIXED | libc::MAP_PRIVATE | libc::MAP_ANON;
                let zeros = libc::mmap(page as *mut libc::c_void, end - page, libc::PROT_READ, flags, -1, 0);
                if zeros != libc::MAP_FAILED {
                    entry.cut.store(true, SeqCst);
                    return;
                }
            }
            pass_on(signal, info, context);
        }
    }

    /// Does what would be done without the handler.
    ///
    /// # Safety
    /// To be called from the handler with its own arguments.
    unsafe fn pass_on(signal: c_int, info: *mut libc::siginfo_t, context: *mut libc::c_void) {
        let handler = BEFORE.get().map_or(libc::SIG_DFL, |before| before.sa_sigaction);
        // SAFETY: a handler is a function of one of these two types, as its flags say.
        unsafe {
            if handler == libc::SIG_DFL || handler == libc::SIG_IGN {
                // The same access fails once more, and ends the process.
                let mut action: libc::sigaction = std::mem::zeroed();
                action.sa_sigaction = libc::SIG_DFL;
                libc::sigaction(signal, &raw const action, null_mut());
            } else if BEFORE.get().is_some_and(|before| before.sa_flags & libc::SA_SIGINFO != 0) {
                let handler: extern "C" fn(c_int, *mut libc::siginfo_t, *mut libc::c_void) =
                    std::mem::transmute(handler);
                handler(signal, info, context);
            } else {
                let handler: extern "C" fn(c_int) = std::mem::transmute(handler);
                handler(signal);
            }
        }
    }
}
