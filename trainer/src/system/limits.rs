//! What happens where the system grants no more: no memory (`ulimit -v`), no threads, no larger files (`ulimit -f`).

use crate::system::closed_pipe::print_stderr;
use clothcombo_data::format::atomic::remove_temporary;
use std::alloc::{GlobalAlloc, Layout, System};
use std::io::Write;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, AtomicPtr, Ordering};

/// Memory (bytes) that is given back for the end of a program that has no more: enough to list and remove what it has begun.
const RESERVE: Layout = match Layout::from_size_align(1 << 20, 16) {
    Ok(layout) => layout,
    Err(_) => unreachable!(),
};
static RESERVED: AtomicPtr<u8> = AtomicPtr::new(null_mut());

/// Makes errors of what would end the program: a file that may not grow further is refused to who writes it, and memory is set
/// aside to end well where there is no more ([`SystemMemory`]). Call it first.
pub fn report_limits() {
    #[cfg(unix)]
    // SAFETY: ignores a signal; no handler of ours is involved.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
    // SAFETY: the layout has a size.
    RESERVED.store(unsafe { System.alloc(RESERVE) }, Ordering::SeqCst);
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| match info.payload_as_str() {
        // The stack of a thread is memory, too; libraries that start threads leave no other way to notice.
        Some(text) if text.contains("failed to spawn thread") || text.contains("ThreadPoolBuildError") => {
            print_stderr(format_args!(
                "Error:\n  × out of memory: no further thread can be started ({text})\n  help: lift the limits (ulimit -v, \
                 ulimit -u), or set RAYON_NUM_THREADS to fewer threads"
            ));
            remove_temporary();
            exit_at_once();
        }
        _ => usual(info),
    }));
}

/// The system's allocator, for `#[global_allocator]`. Where there is no more memory, the program says so, removes what it has not
/// finished, and ends with 1; Rust's own answer is a trap.
pub struct SystemMemory;

// SAFETY: passes on what the system's allocator returns, and does not return where that is nothing.
unsafe impl GlobalAlloc for SystemMemory {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's.
        granted(unsafe { System.alloc(layout) }, layout.size())
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: the caller's.
        granted(unsafe { System.alloc_zeroed(layout) }, layout.size())
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller's.
        granted(unsafe { System.realloc(memory, layout, size) }, size)
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        // SAFETY: the caller's.
        unsafe { System.dealloc(memory, layout) }
    }
}

#[inline]
fn granted(memory: *mut u8, size: usize) -> *mut u8 {
    if memory.is_null() {
        end_without_memory(size);
    }
    memory
}

#[cold]
fn end_without_memory(size: usize) -> ! {
    static IS_ENDING: AtomicBool = AtomicBool::new(false);
    // The first one ends the program; others, and the end itself should it need more, do not begin again.
    if !IS_ENDING.swap(true, Ordering::SeqCst) {
        let reserve = RESERVED.swap(null_mut(), Ordering::SeqCst);
        if !reserve.is_null() {
            // SAFETY: it was allocated so, and is taken by nobody else.
            unsafe { System.dealloc(reserve, RESERVE) };
        }
        let mut message = [0; 256];
        let mut rest = &mut message[..];
        // Into an array: nothing here may need memory.
        let _ = write!(
            rest,
            "Error:\n  × out of memory: {size} bytes more were refused\n  help: lift the limit (ulimit -v), or take fewer or \
             coarser garments"
        );
        let left = rest.len();
        let end = message.len() - left;
        print_stderr(str::from_utf8(&message[..end]).unwrap_or("out of memory"));
        remove_temporary();
        exit_at_once();
    }
    exit_after_the_first();
}

/// Without what usually happens at the end, which may need memory.
fn exit_at_once() -> ! {
    #[cfg(unix)]
    // SAFETY: ends the process.
    unsafe {
        libc::_exit(1)
    }
    #[cfg(not(unix))]
    std::process::exit(1)
}

/// Another thread is ending the program, or this one is and needs more than it has.
fn exit_after_the_first() -> ! {
    std::thread::sleep(std::time::Duration::from_secs(1));
    exit_at_once()
}
