//! The board that a profile is made for, the pins that it relies on, and the length of its chain.

use darm_core::profile::{BoardWiring, PIN_TABLES, PinTable, ProfileError, Shortage};
use toml::Spanned;

use super::ProfileFault;
use super::fault::At;
use super::raw::{RawPins, RawProfile};

/// What the keys `board`, `[chain]` and `[pins]` say. A board's firmware fixes its pins: those of the file have to be these.
pub(super) fn board_wiring(raw: &RawProfile) -> Result<BoardWiring, At> {
    let chips = raw.chain.as_ref().map(|chain| *chain.chips.get_ref());
    let table = raw.board.as_ref().map(known_board).transpose()?;
    for (key, pins) in &raw.pins {
        let table = table.ok_or_else(|| (pins.span(), ProfileFault::PinsWithoutBoard))?;
        check_pins(key, pins.get_ref(), table).map_err(|fault| (pins.span(), fault))?;
    }
    Ok(BoardWiring { chips, layout: table.map(PinTable::layout) })
}

/// The threshold of the board's supply: one that the board of the file measures, where it names one.
pub(super) fn min_supply(raw: &RawProfile) -> Result<Option<u16>, At> {
    let Some(given) = &raw.min_board_supply_mv else { return Ok(None) };
    let mv = *given.get_ref();
    let [lowest, highest] = match &raw.board {
        Some(board) => known_board(board)?.supply_mv,
        None => return Ok(Some(mv)),
    };
    if (lowest..=highest).contains(&mv) {
        return Ok(Some(mv));
    }
    let shortage = Shortage::Supply { mv, measured_mv: Some([lowest, highest]) };
    Err((given.span(), ProfileFault::Profile(ProfileError::Board(shortage))))
}

fn known_board(name: &Spanned<String>) -> Result<&'static PinTable, At> {
    PinTable::of_board(name.get_ref()).ok_or_else(|| {
        let known: Vec<&str> = PIN_TABLES.iter().map(|table| table.board).collect();
        (name.span(), ProfileFault::Board { found: name.get_ref().clone(), known: known.join(", ") })
    })
}

fn check_pins(key: &str, found: &RawPins, table: &PinTable) -> Result<(), ProfileFault> {
    let board = table.board;
    let fixed = match table.functions().find(|(function, _)| *function == key) {
        Some((_, pin)) => pin.to_owned(),
        None if key == "inputs" => table.inputs.join(", "),
        None => {
            let known: Vec<&str> = table.functions().map(|(function, _)| function).chain(["inputs"]).collect();
            return Err(ProfileFault::PinFunction { key: key.to_owned(), board, known: known.join(", ") });
        }
    };
    let found = match found {
        RawPins::One(pin) => pin.clone(),
        RawPins::Several(pins) => pins.join(", "),
    };
    // A file may name the first inputs alone, those that are wired.
    let is_same = found == fixed || key == "inputs" && fixed.starts_with(&format!("{found}, "));
    if is_same { Ok(()) } else { Err(ProfileFault::Pin { key: key.to_owned(), board, found, fixed }) }
}
