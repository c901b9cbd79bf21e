//! The pins of the boards that this source supports. A board's firmware fixes them; a profile may state those that it relies on.
//!
//! A profile keeps one number of them, [`PinTable::layout`]: it differs where any function is at another pin.

/// Which pin of a board has which function.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PinTable {
    /// Name by which the board identifies itself.
    pub board: &'static str,
    /// Serial data of the output chain.
    pub data: &'static str,
    /// Shift clock of the output chain.
    pub clock: &'static str,
    /// Latch of the output chain.
    pub latch: &'static str,
    /// Output enable of the output chain, active low.
    pub enable: &'static str,
    /// Serial output of the last chip of the chain; empty where the board does not read it.
    pub far_end: &'static str,
    /// Pulse to a camera at each row; empty where the board has no pin for it.
    pub sync: &'static str,
    /// The servo bus: the pin that sends.
    pub servo_bus: &'static str,
    /// The button, or the jumper in its place.
    pub button: &'static str,
    /// Inputs for limit switches, by number.
    pub inputs: &'static [&'static str],
    /// Lowest and highest supply that the board measures of itself, mV.
    pub supply_mv: [u16; 2],
}

/// The pins of the B-L475E-IOT01A.
pub const B_L475E_IOT01A: PinTable = PinTable {
    board: "B-L475E-IOT01A",
    data: "PA7",
    clock: "PA5",
    latch: "PA4",
    enable: "PA15",
    far_end: "PA6",
    sync: "PA0",
    servo_bus: "PA2",
    button: "PC13",
    inputs: &["PC0", "PC1", "PC2", "PC3", "PC4", "PC5", "PB0", "PB1", "PB2", "PB4", "PB8", "PB9", "PD14"],
    // VDDA, DS10969, "General operating conditions".
    supply_mv: [1_620, 3_600],
};

/// The pins of the Raspberry Pi Pico.
pub const PICO: PinTable = PinTable {
    board: "Pico",
    data: "GP2",
    clock: "GP3",
    latch: "GP4",
    enable: "GP5",
    far_end: "",
    sync: "GP19",
    servo_bus: "GP0",
    button: "GP22",
    inputs: &["GP6", "GP7", "GP8", "GP9", "GP10", "GP11", "GP12", "GP13", "GP14", "GP15", "GP16", "GP17", "GP18"],
    // VSYS, Pico data sheet, 4.4: over 3, in a converter that reads up to 3.3 V.
    supply_mv: [1_800, 5_500],
};

/// All boards whose pins are proven.
pub static PIN_TABLES: [&PinTable; 2] = [&B_L475E_IOT01A, &PICO];

/// The function of the pulse to a camera.
const SYNC: &str = "sync";

impl PinTable {
    /// The table of the board of this name.
    pub fn of_board(name: &str) -> Option<&'static Self> {
        PIN_TABLES.into_iter().find(|table| table.board == name)
    }

    /// The table with this number.
    pub fn of_layout(layout: u32) -> Option<&'static Self> {
        PIN_TABLES.into_iter().find(|table| table.layout() == layout)
    }

    /// Key of a profile file and pin of each function but the inputs; those that the board has.
    pub fn functions(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let all = [
            ("data", self.data),
            ("clock", self.clock),
            ("latch", self.latch),
            ("enable", self.enable),
            ("far_end", self.far_end),
            ("servo_bus", self.servo_bus),
            ("button", self.button),
            (SYNC, self.sync),
        ];
        all.into_iter().filter(|(_, pin)| !pin.is_empty())
    }

    /// One number of the board's name and all its pins in order: their FNV-1a hash of 32 bits, a zero behind each. The pin that a
    /// profile has to ask for is left out: no wiring from before it relies on it.
    pub fn layout(&self) -> u32 {
        let fixed = self.functions().filter(|(function, _)| *function != SYNC);
        let pins = fixed.map(|(_, pin)| pin).chain(self.inputs.iter().copied());
        let bytes = core::iter::once(self.board).chain(pins).flat_map(|name| name.bytes().chain([0]));
        bytes.fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
    }
}

#[cfg(test)]
mod tests {
    use super::{PICO, PIN_TABLES, PinTable};

    #[test]
    fn each_board_is_found_by_its_name_and_by_its_number() {
        for table in PIN_TABLES {
            assert_eq!(PinTable::of_board(table.board), Some(table));
            assert_eq!(PinTable::of_layout(table.layout()), Some(table));
        }
        assert_eq!((PinTable::of_board("pico"), PinTable::of_layout(0)), (None, None));
    }

    #[test]
    fn no_pin_has_two_functions() {
        for table in PIN_TABLES {
            let pins = || table.functions().map(|(_, pin)| pin).chain(table.inputs.iter().copied());
            assert!(pins().all(|pin| pins().filter(|other| *other == pin).count() == 1), "{}", table.board);
        }
    }

    #[test]
    fn another_pin_is_another_layout() {
        assert_ne!(PinTable { latch: "GP20", ..PICO }.layout(), PICO.layout());
        assert_eq!(PinTable { sync: "GP20", ..PICO }.layout(), PICO.layout(), "a profile asks for it by itself");
        assert_eq!(PICO.layout(), 0xfd3a_1722, "boards have stored it");
        assert_ne!(PinTable { inputs: &PICO.inputs[1..], ..PICO }.layout(), PICO.layout());
    }
}
