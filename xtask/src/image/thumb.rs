//! As much of the Thumb-2 instruction set as a call graph and stack frames need. Source: ARM DDI 0403E, chapter A7.

/// What an instruction does to control flow and to the stack pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Op {
    /// Calls a function.
    Call(u32),
    /// Branches, with or without a condition.
    Branch(u32),
    /// Calls the function in a register.
    CallRegister,
    /// Branches to the address in a register or in memory.
    BranchRegister,
    /// Lowers the stack pointer by this many bytes.
    Push(u32),
    /// Changes the stack pointer by an amount that the instruction does not name.
    StackUnknown,
    /// Adds a register to the stack pointer.
    AddToStack(u8),
    /// Puts an address just below the frame pointer into a register.
    BelowFrame(u8),
    /// Sets the stack pointer to a register.
    SetStack(u8),
    /// Puts the low half of a constant into a register.
    Low(u8, u32),
    /// Puts the high half of a constant into a register.
    High(u8, u32),
    /// Loads a word from this address into a register.
    Literal(u8, u32),
    /// Anything else.
    Other,
}

const SP: u16 = 13;
const LR: u16 = 14;
const PC: u16 = 15;

/// Bytes of the instruction that begins with this half-word.
pub(crate) const fn length(first: u16) -> u32 {
    if first >> 11 >= 0b11101 { 4 } else { 2 }
}

/// Decodes the instruction at `at`; `second` counts only where [`length`] is 4.
pub(crate) fn decode(at: u32, first: u16, second: u16) -> Op {
    if length(first) == 2 { decode_narrow(at, first) } else { decode_wide(at, first, second) }
}

fn decode_narrow(at: u32, op: u16) -> Op {
    let register = op >> 3 & 15;
    match op {
        0xD000..=0xDDFF => Op::Branch(relative(at, sign_extend(u32::from(op & 0xFF) << 1, 9))),
        0xE000..=0xE7FF => Op::Branch(relative(at, sign_extend(u32::from(op & 0x7FF) << 1, 12))),
        _ if op & 0xFF87 == 0x4780 => Op::CallRegister,
        _ if op & 0xFF87 == 0x4700 => {
            if register == LR {
                Op::Other
            } else {
                Op::BranchRegister
            }
        }
        _ if op & 0xFE00 == 0xB400 => Op::Push(4 * (op & 0x1FF).count_ones()),
        _ if op & 0xFF80 == 0xB080 => Op::Push(4 * u32::from(op & 0x7F)),
        _ if op & 0xF800 == 0x4800 => Op::Literal((op >> 8 & 7) as u8, relative(at & !3, 4 * i32::from(op & 0xFF))),
        // MOV and ADD to the program counter: the table of a `match`, within the function. A call or its last one is BLX or BX.
        _ if op & 0xFF87 == 0x4687 || op & 0xFF87 == 0x4487 => Op::Other,
        _ if op & 0xFF87 == 0x4685 => Op::SetStack(register as u8),
        _ if op & 0xFF87 == 0x4485 => Op::AddToStack(register as u8),
        // SUBS of a small constant from R7, the frame pointer.
        _ if op & 0xFE38 == 0x1E38 => Op::BelowFrame((op & 7) as u8),
        _ => Op::Other,
    }
}

fn decode_wide(at: u32, first: u16, second: u16) -> Op {
    let (target, rn, rd) = (second >> 12, first & 15, (second >> 8) & 15);
    let writes_sp_back = |mask: u16, value: u16| first & mask == value && rn == SP;
    match first {
        _ if first & 0xF800 == 0xF000 && second & 0x8000 != 0 => decode_branch(at, first, second),
        0xE92D => Op::Push(4 * second.count_ones()),
        // STR with pre-decrement, STRD with pre-decrement, VPUSH.
        0xF84D if second & 0x0F00 == 0x0D00 => Op::Push(u32::from(second & 0xFF)),
        0xE96D => Op::Push(4 * u32::from(second & 0xFF)),
        0xED2D | 0xED6D => Op::Push(4 * u32::from(second & 0xFF)),
        _ if writes_sp_back(0xFBEF, 0xF1AD) && rd == SP => Op::Push(expand_immediate(first, second)),
        _ if writes_sp_back(0xFBFF, 0xF2AD) && rd == SP => Op::Push(plain_immediate(first, second) & 0xFFF),
        // SUB and ADD of a register to the stack pointer.
        _ if (writes_sp_back(0xFFEF, 0xEBAD) || writes_sp_back(0xFFEF, 0xEB0D)) && rd == SP => Op::StackUnknown,
        _ if first & 0xFBF0 == 0xF240 => {
            Op::Low(rd as u8, u32::from(first & 15) << 12 | plain_immediate(first, second))
        }
        _ if first & 0xFBF0 == 0xF2C0 => {
            Op::High(rd as u8, u32::from(first & 15) << 12 | plain_immediate(first, second))
        }
        0xF8DF | 0xF85F if target == PC => Op::BranchRegister,
        0xF8DF => Op::Literal(target as u8, relative(at & !3, i32::from(second & 0xFFF))),
        0xF85F => Op::Literal(target as u8, relative(at & !3, -i32::from(second & 0xFFF))),
        // A load into the program counter is a return when it pops, a branch otherwise.
        _ if first & 0xFF70 == 0xF850 && target == PC && !(rn == SP && second & 0x0F00 == 0x0B00) => Op::BranchRegister,
        _ => Op::Other,
    }
}

/// `BL`, `B.W` and `B<condition>.W`.
fn decode_branch(at: u32, first: u16, second: u16) -> Op {
    let (sign, j1, j2) = (u32::from(first >> 10 & 1), u32::from(second >> 13 & 1), u32::from(second >> 11 & 1));
    let low = u32::from(second & 0x7FF) << 1;
    if second & 0x1000 == 0 {
        let condition = first >> 6 & 15;
        let offset = sign << 20 | j2 << 19 | j1 << 18 | u32::from(first & 0x3F) << 12 | low;
        // Conditions 14 and 15 encode MSR, MRS, barriers and hints.
        return if second & 0x4000 == 0 && condition < 14 {
            Op::Branch(relative(at, sign_extend(offset, 21)))
        } else {
            Op::Other
        };
    }
    let (i1, i2) = (1 ^ j1 ^ sign, 1 ^ j2 ^ sign);
    let offset = sign << 24 | i1 << 23 | i2 << 22 | u32::from(first & 0x3FF) << 12 | low;
    let target = relative(at, sign_extend(offset, 25));
    if second & 0x4000 != 0 { Op::Call(target) } else { Op::Branch(target) }
}

/// The program counter reads 4 bytes ahead.
fn relative(at: u32, offset: i32) -> u32 {
    at.wrapping_add(4).wrapping_add_signed(offset)
}

fn sign_extend(value: u32, bits: u32) -> i32 {
    (value << (32 - bits)) as i32 >> (32 - bits)
}

/// i:imm3:imm8.
fn plain_immediate(first: u16, second: u16) -> u32 {
    u32::from(first >> 10 & 1) << 11 | u32::from(second >> 12 & 7) << 8 | u32::from(second & 0xFF)
}

/// ThumbExpandImm, A5.3.2.
fn expand_immediate(first: u16, second: u16) -> u32 {
    let (value, byte) = (plain_immediate(first, second), u32::from(second & 0xFF));
    match value >> 8 {
        0 => byte,
        1 => byte << 16 | byte,
        2 => byte << 24 | byte << 8,
        3 => byte * 0x0101_0101,
        _ => (0x80 | byte & 0x7F).rotate_right(value >> 7),
    }
}

#[cfg(test)]
mod tests {
    use super::{Op, decode};

    /// Encodings and their meaning by `llvm-mc -triple=thumbv7em-none-eabihf -show-encoding`.
    #[test]
    fn instructions_mean_what_an_assembler_says() {
        let at = 0x0800_1000;
        let cases = [
            ((0xF000, 0xF800), Op::Call(0x0800_1004)),   // bl .+4
            ((0xF7FF, 0xFFFE), Op::Call(0x0800_1000)),   // bl .
            ((0xF000, 0xB800), Op::Branch(0x0800_1004)), // b.w .+4
            ((0xF43F, 0xAFFE), Op::Branch(0x0800_1000)), // beq.w .
            ((0xE7FE, 0), Op::Branch(0x0800_1000)),      // b .
            ((0xD0FE, 0), Op::Branch(0x0800_1000)),      // beq .
            ((0x4798, 0), Op::CallRegister),             // blx r3
            ((0x4718, 0), Op::BranchRegister),           // bx r3
            ((0x4770, 0), Op::Other),                    // bx lr
            ((0xB5F0, 0), Op::Push(20)),                 // push {r4-r7, lr}
            ((0xE92D, 0x4FF0), Op::Push(36)),            // push.w {r4-r11, lr}
            ((0xB082, 0), Op::Push(8)),                  // sub sp, #8
            ((0xF5AD, 0x7D00), Op::Push(512)),           // sub.w sp, sp, #512
            ((0xF2AD, 0x4D04), Op::Push(1028)),          // subw sp, sp, #1028
            ((0xED2D, 0x8B10), Op::Push(64)),            // vpush {d8-d15}
            ((0xF84D, 0x4D08), Op::Push(8)),             // str r4, [sp, #-8]!
            ((0xEBAD, 0x0D04), Op::StackUnknown),        // sub.w sp, sp, r4
            ((0x46A5, 0), Op::SetStack(4)),              // mov sp, r4
            ((0xF241, 0x2034), Op::Low(0, 0x1234)),      // movw r0, #0x1234
            ((0xF6C0, 0x0100), Op::High(1, 0x0800)),     // movt r1, #0x800
            ((0x4A01, 0), Op::Literal(2, 0x0800_1008)),  // ldr r2, [pc, #4]
            ((0x44B5, 0), Op::AddToStack(6)),            // add sp, r6
            ((0x1FFE, 0), Op::BelowFrame(6)),            // subs r6, r7, #7
            ((0x46B5, 0), Op::SetStack(6)),              // mov sp, r6
            ((0x4687, 0), Op::Other),                    // mov pc, r0
            ((0xF85D, 0xFB04), Op::Other),               // pop {pc}
            ((0xF852, 0xF023), Op::BranchRegister),      // ldr.w pc, [r2, r3, lsl #2]
            ((0xF3BF, 0x8F4F), Op::Other),               // dsb
        ];
        for ((first, second), op) in cases {
            assert_eq!(decode(at, first, second), op, "{first:04x} {second:04x}");
        }
    }
}
