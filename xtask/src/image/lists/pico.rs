//! What the code of the Pico's image does not say.

use super::Callee::Named;
use super::{FORMATS_ANY, READS_RECORDS, STORES_RECORDS, WAKERS, WRITES_TEXT};
use super::{Indirect, Level, Lists, MAY_PANIC, MayPanic, RECURSION};

/// The Raspberry Pi Pico. `main::set_priorities` in its firmware sets the levels.
pub(crate) static PICO: Lists = Lists {
    indirect: INDIRECT,
    never_called: &["core::fmt::Write::write_fmt"],
    recursion: &[RECURSION],
    ends: &["__rustc::rust_begin_unwind", "darm_firmware::kept::keep"],
    before_tasks: &[
        "darm_firmware::hardware::ConsoleMemory<H>::dispatcher",
        "darm_firmware::hardware::ConsoleMemory<H>::room",
        "darm_firmware::hardware::ConsoleMemory<H>::table",
        "darm_firmware::hardware::ConsoleMemory<H>::profile",
        "pico::start_control",
    ],
    last_spawn: &["embassy_executor::raw::util::UninitCell<T>::write_in_place"],
    levels: &[
        Level::of("console with storage and search", &["SWI_IRQ_0"]),
        // `main::start` gives the console to the other executor.
        Level {
            name: "USB, stop, servo bus",
            handlers: &["SWI_IRQ_1", "UART0_IRQ", "USBCTRL_IRQ"],
            never: &["darm_firmware::dispatch::", "darm_firmware::store::", "darm_firmware::text::"],
        },
        Level::of("timer of the tasks", &["TIMER_IRQ_0"]),
        Level::of("control tick", &["TIMER_IRQ_1"]),
        // Continues at the top of the stack's memory; only its frame is pushed here.
        Level::of("hard fault", &[]),
    ],
    at_start: 2,
    // An ARMv6-M has no floating-point registers.
    exception_frame: 32 + 4,
    control: "TIMER_IRQ_1",
    may_panic: &[MAY_PANIC, MAY_PANIC_IN_LAYERS],
};

/// Crates that the first board does not have. That they do not panic is their promise and was not examined: a panic disables the outputs
/// and resets.
const MAY_PANIC_IN_LAYERS: &[MayPanic] = &[
    MayPanic {
        part: "pico::__cortex_m_rt_main -> core::",
        reason: "before any output is enabled: the hardware layer checks clocks and baud rate, which are constants, and that it \
                 is started once",
    },
    MayPanic {
        part: "/embassy-rp-",
        reason: "the hardware layer's own checks of endpoints and of addresses in the flash",
    },
    MayPanic {
        part: "/rp-pac-",
        reason: "indices of registers and of their fields, which the hardware layer takes from constants",
    },
    MayPanic {
        part: "/embassy-usb-",
        reason: "the USB stack's own: descriptors of a fixed size, states of the control endpoint",
    },
    MayPanic {
        part: "-> core::option::expect_failed, place unknown",
        reason: "64 bits of time in microseconds do not overflow",
    },
];

/// The first rule of which a caller matches is taken.
const INDIRECT: &[Indirect] = &[
    // All tasks run in the executors of these interrupts; the control tick is none.
    Indirect {
        callers: &["SWI_IRQ_", "embassy_executor::platform::interrupt::InterruptExecutor::on_interrupt"],
        callees: &[Named("embassy_executor::raw::TaskStorage<F>::poll"), WAKERS],
    },
    FORMATS_ANY,
    STORES_RECORDS,
    READS_RECORDS,
    // A board says what it knows of itself.
    Indirect {
        callers: &["darm_firmware::dispatch::status::<impl darm_firmware::dispatch::Dispatcher<F,C>>::health"],
        callees: &[Named("darm_firmware::hardware::Hardware>::health")],
    },
    // The class of the serial port wakes who waits for its host.
    Indirect { callers: &["as embassy_usb::Handler>"], callees: &[WAKERS] },
    // The bus asks the serial port's class, by its vtable.
    Indirect {
        callers: &["embassy_usb::", "embassy_executor::raw::TaskStorage<F>::poll", "embassy_futures::join"],
        callees: &[Named("embassy_usb::Handler"), WAKERS],
    },
    WRITES_TEXT,
    // The stack of what failed is left behind; then the handler in Rust ends the start.
    Indirect { callers: &["HardFault"], callees: &[Named("pico::fault::on_hard_fault")] },
    // All else that calls indirectly wakes a task or clones and drops its waker, or calls the boot ROM.
    Indirect {
        callers: &[
            "_IRQ",
            "<core::future::poll_fn::PollFn<F> as core::future::future::Future>",
            "embassy_",
            "embedded_io_async",
            "darm_firmware::",
            "pico::",
        ],
        callees: &[WAKERS],
    },
];
