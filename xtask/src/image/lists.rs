//! What the machine code does not say: whom indirect calls reach, how deep recursion goes, what may panic and why.

pub(crate) mod pico;

/// Where they are.
pub(crate) const LISTS: &str = "xtask/src/image/lists.rs";

/// Whom the indirect calls of functions can reach.
pub(crate) struct Indirect {
    /// Parts of the callers' names.
    pub(crate) callers: &'static [&'static str],
    pub(crate) callees: &'static [Callee],
}

/// A set of functions.
pub(crate) enum Callee {
    /// All with this in their names.
    Named(&'static str),
}

use Callee::Named;

/// What the code of one board's image does not say.
pub(crate) struct Lists {
    pub(crate) indirect: &'static [Indirect],
    /// Their addresses are in vtables, and nothing calls them through these.
    pub(crate) never_called: &'static [&'static str],
    /// Functions by which every recursion of the image passes.
    pub(crate) recursion: &'static [&'static [Recursion]],
    /// What ends a start.
    pub(crate) ends: &'static [&'static str],
    /// What has returned before the first task starts.
    pub(crate) before_tasks: &'static [&'static str],
    /// What moves the last task to its place: it has returned before that task runs, which has the lowest priority.
    pub(crate) last_spawn: &'static [&'static str],
    /// Handlers by priority, the lowest first.
    pub(crate) levels: &'static [Level],
    /// Of these, those that can interrupt only the tasks and not the start.
    pub(crate) at_start: usize,
    /// Bytes that the processor pushes when it enters an interrupt, with alignment.
    pub(crate) exception_frame: u32,
    /// The interrupt that runs the control tick.
    pub(crate) control: &'static str,
    /// Panics outside of it that may stay.
    pub(crate) may_panic: &'static [&'static [MayPanic]],
}

/// Handlers of one priority.
pub(crate) struct Level {
    pub(crate) name: &'static str,
    pub(crate) handlers: &'static [&'static str],
    /// Parts of the names of what its tasks never call: an executor may poll any task, as far as the code shows.
    pub(crate) never: &'static [&'static str],
}

impl Level {
    const fn of(name: &'static str, handlers: &'static [&'static str]) -> Self {
        Self { name, handlers, never: &[] }
    }
}

/// The B-L475E-IOT01A. `board::prioritise` in its firmware sets the levels.
pub(crate) static B_L475E_IOT01A: Lists = Lists {
    indirect: INDIRECT,
    never_called: NEVER_CALLED,
    recursion: &[RECURSION, INDENTED],
    ends: ENDS,
    before_tasks: BEFORE_TASKS,
    last_spawn: &[],
    levels: &[
        Level::of("console and servo tasks", &["SWPMI1"]),
        Level::of("USARTs", &["USART1", "USART2", "DMA1_CHANNEL5", "DMA1_CHANNEL6"]),
        Level::of("control task", &["TSC"]),
        Level::of("clock", &["SysTick"]),
        Level::of("NMI (flash ECC)", &["NonMaskableInt"]),
        // Continues at the top of the stack's memory; only its frame is pushed here.
        Level::of("hard fault", &[]),
    ],
    at_start: 3,
    // With the floating-point registers, also where they are saved lazily.
    exception_frame: 104 + 4,
    control: "TSC",
    may_panic: &[MAY_PANIC],
};

/// A function that every recursion of its kind passes.
pub(crate) struct Recursion {
    pub(crate) function: &'static str,
    /// Entries within one chain.
    pub(crate) depth: u32,
}

/// Wakes a task, or clones and drops its waker.
pub(crate) const WAKERS: Callee = Named("embassy_executor::raw::waker::");

/// These format any value, by its vtable, and may write themselves.
pub(crate) const FORMATS_ANY: Indirect = Indirect {
    callers: &[
        "core::fmt::write",
        "<core::fmt::Formatter>::debug_struct_field1_finish",
        "<&T as core::fmt::",
        "<&dyn core::fmt::",
    ],
    callees: &[
        Named("core::fmt::Binary"),
        Named("core::fmt::Debug"),
        Named("core::fmt::Display"),
        Named("core::fmt::LowerHex"),
        Named("core::fmt::Write>::write_str"),
        Named("::write_char"),
    ],
};

/// All other formatting writes text to any output. The text commands also wake, and drop a line that is an output;
/// the compiler puts them into the future that watches for a stop meanwhile.
pub(crate) const WRITES_TEXT: Indirect = Indirect {
    callers: &[
        "core::fmt::",
        "darm_firmware::crash",
        "darm_firmware::kept",
        "firmware::text",
        "<core::pin::Pin<P> as core::future::future::Future>",
        "<&mut F as core::future::future::Future>",
    ],
    callees: &[
        Named("core::fmt::Write>::write_str"),
        Named("::write_char"),
        Named("core::ptr::drop_in_place<darm_firmware::text::Line>"),
        WAKERS,
    ],
};

/// Records of the storage are values behind a vtable.
pub(crate) const STORES_RECORDS: Indirect = Indirect {
    callers: &["sequential_storage::"],
    callees: &[Named("sequential_storage::map::Value>::serialize_into"), WAKERS],
};

/// What reads several records holds the address of the function that reads one in a register.
pub(crate) const READS_RECORDS: Indirect = Indirect {
    callers: &["darm_firmware::store::"],
    callees: &[Named("darm_firmware::store::Store<F>::fetch"), WAKERS],
};

/// The first rule of which a caller matches is taken. Functions of no rule call directly only.
const INDIRECT: &[Indirect] = &[
    // All tasks run in the executor of this interrupt; the control tick is none.
    Indirect { callers: &["SWPMI1"], callees: &[Named("embassy_executor::raw::TaskStorage<F>::poll")] },
    // The chip's loader: nothing of this image runs after it.
    Indirect { callers: &["__cortex_m_rt_main"], callees: &[] },
    FORMATS_ANY,
    WRITES_TEXT,
    STORES_RECORDS,
    READS_RECORDS,
    // A board says what it knows of itself.
    Indirect {
        callers: &[
            "darm_firmware::dispatch::status::<impl darm_firmware::dispatch::Dispatcher<F,C>>::health",
            "Dispatcher<F, C>>::health",
        ],
        callees: &[Named("darm_firmware::hardware::Hardware>::health")],
    },
    // All else that calls indirectly wakes a task or clones and drops its waker.
    Indirect {
        callers: &[
            "TSC",
            "SysTick",
            "USART",
            "DMA1_CHANNEL",
            "<core::future::poll_fn::PollFn<F> as core::future::future::Future>",
            "embassy_",
            "embedded_io_async",
            "darm_firmware::",
            "darm_b_l475e_iot01a::",
        ],
        callees: &[WAKERS],
    },
];

/// Their addresses are in vtables, and nothing calls them through these: `Formatter::write_fmt` calls `core::fmt::write`.
const NEVER_CALLED: &[&str] =
    &["core::fmt::Write::write_fmt", "<core::fmt::builders::PadAdapter as core::fmt::Write>::write_fmt"];

/// Functions by which every recursion of the image passes.
const RECURSION: &[Recursion] = &[
    // A message of a panic or an answer in text, the error in it, the error in that, its number.
    Recursion { function: "core::fmt::write", depth: 4 },
    Recursion { function: "<&T as core::fmt::Debug>::fmt", depth: 2 },
    Recursion { function: "<&T as core::fmt::Display>::fmt", depth: 2 },
    Recursion { function: "<&dyn core::fmt::Debug as core::fmt::Debug>::fmt", depth: 1 },
    // A number below the normal range is scaled into it.
    Recursion { function: "darm_core::trig::single::sqrt", depth: 2 },
];

/// The same of what only the first board prints.
const INDENTED: &[Recursion] = &[
    // No type that is printed has a derived `Debug` within another one.
    Recursion { function: "<core::fmt::Formatter>::debug_struct_field1_finish", depth: 1 },
    // Only `{:#?}` indents, and nothing prints so.
    Recursion { function: "<core::fmt::builders::PadAdapter as core::fmt::Write>::write_str", depth: 0 },
    Recursion { function: "<core::fmt::builders::PadAdapter as core::fmt::Write>::write_char", depth: 0 },
];

/// What ends a start: outputs off, crash record, reset. Should its stack overflow, the hard fault handler does the same
/// on a separate stack; so the bound leaves it out.
const ENDS: &[&str] =
    &["__rustc::rust_begin_unwind", "darm_firmware::kept::keep", "darm_b_l475e_iot01a::fault::end_nmi"];

/// What has returned before the first task starts, in the order of `tasks::start`.
const BEFORE_TASKS: &[&str] = &[
    "darm_b_l475e_iot01a::tasks::dispatcher",
    "darm_b_l475e_iot01a::tasks::room",
    "darm_b_l475e_iot01a::tasks::table",
    "darm_b_l475e_iot01a::tasks::start_control",
];

/// A panic outside the control task that may stay.
pub(crate) struct MayPanic {
    /// A part of its line in `cargo xtask image --panics`: caller, panic function, place.
    pub(crate) part: &'static str,
    /// Why it cannot happen.
    pub(crate) reason: &'static str,
}

/// The control task has no such list: nothing in it may panic.
const MAY_PANIC: &[MayPanic] = &[
    MayPanic { part: "panic_const_async_fn_resumed", reason: "the executor does not poll a task that has ended" },
    MayPanic { part: "sequential_storage::", reason: "positions in a page that the storage has checked before" },
    MayPanic { part: "sequential-storage-", reason: "the same, inlined" },
    MayPanic { part: "/library/core/src/num/", reason: "the core library's own bounds of numbers as text" },
    MayPanic { part: "core::num::", reason: "the same" },
    MayPanic { part: "core::fmt::float", reason: "the same" },
    MayPanic { part: "/cobs-", reason: "encoder and decoder stay within the bytes that they are given" },
    MayPanic { part: "/embedded-io-async-", reason: "a queue that is full waits and never writes 0 bytes" },
    MayPanic {
        part: "/embassy-sync-",
        reason: "a lock's state is borrowed for some instructions, in which nothing waits",
    },
    MayPanic {
        part: "panic_already_borrowed",
        reason: "the same, inlined; no other `RefCell` is borrowed but by trying",
    },
    MayPanic { part: "/embassy-futures-", reason: "`join` takes the output of a future only when it is done" },
    MayPanic { part: "/embassy-executor-", reason: "one executor, started once; no waker of another one" },
    MayPanic { part: "/static_cell-", reason: "the start builds each value once" },
    MayPanic { part: "/defmt-rtt-", reason: "the log is taken within a critical section only" },
];
