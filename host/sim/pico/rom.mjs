// The boot ROM of the RP2040 as the image sees it: the table of functions, and the functions of the flash.
//
// The emulator has no ROM. Each function here is a breakpoint at which `call` acts in its place. Source: RP2040 data sheet,
// 2.8.3 "Bootrom contents".

const LOOKUP = 1;
const FIRST = 0x10;
const NAMES = ['IF', 'EX', 'RE', 'RP', 'FC', 'CX', 'C4', 'S4', 'MC', 'MS', 'UB'];

const at = (index) => 0x210 + index * 8;

export function bootRom() {
  const rom = new Uint32Array(4096);
  const halves = new Uint16Array(rom.buffer);
  // Pointers to the tables of functions and data, and to the lookup; none of the tables is read but by the lookup.
  [halves[0x14 / 2], halves[0x16 / 2], halves[0x18 / 2]] = [0x100, 0x180, 0x201];
  const BREAK = 0xbe00;
  const RETURN = 0x4770;
  [halves[0x200 / 2], halves[0x202 / 2]] = [BREAK | LOOKUP, RETURN];
  NAMES.forEach((_, index) => {
    [halves[at(index) / 2], halves[at(index) / 2 + 1]] = [BREAK | (FIRST + index), RETURN];
  });
  return rom;
}

// What the breakpoint with this number stands for. `flash` has `erase(from, length)` and `program(from, bytes)`.
export function call(number, chip, flash, enterLoader) {
  const r = chip.core.registers;
  if (number === LOOKUP) {
    const name = String.fromCharCode(r[1] & 255, (r[1] >> 8) & 255);
    const index = NAMES.indexOf(name);
    r[0] = index < 0 ? 0 : at(index) + 1;
    return;
  }
  const bytes = (from, length) => Uint8Array.from({ length }, (_, k) => chip.readUint8(from + k));
  switch (NAMES[number - FIRST]) {
    case 'RE':
      return flash.erase(r[0], r[1]);
    case 'RP':
      return flash.program(r[0], bytes(r[1], r[2]));
    case 'C4':
    case 'MC':
      return bytes(r[1], r[2]).forEach((byte, k) => chip.writeUint8(r[0] + k, byte));
    case 'S4':
    case 'MS':
      for (let k = 0; k < r[2]; k++) chip.writeUint8(r[0] + k, r[1] & 255);
      return;
    case 'UB':
      return enterLoader();
    default:
  }
}
