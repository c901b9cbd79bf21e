//! Panics of the firmware are findings, not messages on the terminal.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

thread_local! {
    static LAST: RefCell<Option<String>> = const { RefCell::new(None) };
    static KEPT: Cell<bool> = const { Cell::new(false) };
}

/// Runs something that may panic; the panic's message where it does.
///
/// # Errors
///
/// The message of the panic, with its place.
pub fn caught<T>(act: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let print = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if KEPT.get() {
                LAST.set(Some(info.to_string().replace('\n', " ")));
            } else {
                print(info);
            }
        }));
    });
    let before = KEPT.replace(true);
    let result = catch_unwind(AssertUnwindSafe(act));
    KEPT.set(before);
    result.map_err(|_| LAST.take().unwrap_or_else(|| "without a message".into()))
}

#[cfg(test)]
mod tests {
    use super::caught;

    #[test]
    fn a_panic_is_a_message() {
        assert_eq!(caught(|| 7), Ok(7));
        assert!(caught(|| panic!("no {}", "way")).is_err_and(|message: String| message.contains("no way")));
    }
}
