//! A mark for the next start where the process dies by a fault of its own: a segmentation fault, an abort. One that is
//! killed leaves none, and that tells a job that crashes its server from one that was merely running when the server
//! was killed.

use std::{
    fs::OpenOptions,
    io,
    os::fd::IntoRawFd,
    path::Path,
    sync::{
        OnceLock,
        atomic::{AtomicI32, Ordering},
    },
};

/// Signals that end a process by its own fault.
const FATAL: [libc::c_int; 5] = [libc::SIGSEGV, libc::SIGBUS, libc::SIGILL, libc::SIGFPE, libc::SIGABRT];

/// The open file; there is no other way to hand it to a handler.
static FILE: AtomicI32 = AtomicI32::new(-1);
/// What was done about each of them before.
static BEFORE: OnceLock<[libc::sigaction; 5]> = OnceLock::new();

/// Marks fatal signals in a file from now on, then lets them do what they did before. Once in a process.
pub fn install(mark: &Path) -> io::Result<()> {
    let file = OpenOptions::new().create(true).append(true).open(mark)?;
    FILE.store(file.into_raw_fd(), Ordering::Relaxed);
    // SAFETY: zero is a value of this plain structure of C.
    let mut before: [libc::sigaction; 5] = unsafe { std::mem::zeroed() };
    for (signal, before) in FATAL.iter().zip(&mut before) {
        // SAFETY: reads the present action into a structure of the right type.
        if unsafe { libc::sigaction(*signal, std::ptr::null(), before) } != 0 {
            return Err(io::Error::last_os_error());
        }
    }
    if BEFORE.set(before).is_err() {
        return Ok(());
    }
    for signal in FATAL {
        // SAFETY: as above.
        let mut action: libc::sigaction = unsafe { std::mem::zeroed() };
        action.sa_sigaction = on_fatal as *const () as libc::sighandler_t;
        // On the stack that threads have for the overflow of theirs.
        action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
        // SAFETY: the handler has the signature that SA_SIGINFO asks for, and calls nothing that is not safe in one.
        if unsafe { libc::sigaction(signal, &action, std::ptr::null_mut()) } != 0 {
            return Err(io::Error::last_os_error());
        }
    }
    Ok(())
}

/// Writes the number of the signal down, puts back what was there before, and lets the signal come again.
extern "C" fn on_fatal(signal: libc::c_int, info: *mut libc::siginfo_t, _context: *mut libc::c_void) {
    let digits = [b'0' + (signal / 10 % 10) as u8, b'0' + (signal % 10) as u8, b'\n'];
    // SAFETY: write, sigaction and raise may be called from a handler; the pointers are to locals and to what was set
    // before it was installed.
    unsafe {
        let _written = libc::write(FILE.load(Ordering::Relaxed), digits.as_ptr().cast(), digits.len());
        let place = FATAL.iter().position(|&fatal| fatal == signal);
        if let Some(before) = place.and_then(|place| BEFORE.get()?.get(place)) {
            libc::sigaction(signal, before, std::ptr::null_mut());
        } else {
            libc::signal(signal, libc::SIG_DFL);
        }
        // A fault happens again once this returns. A signal that was sent does not.
        if info.is_null() || (*info).si_code <= 0 {
            libc::raise(signal);
        }
    }
}
