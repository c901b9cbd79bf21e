// The cache of the flash that code runs from, which the emulator does not have: 16 KiB, two ways, lines of eight bytes, one cycle
// where it has the line (RP2040 data sheet, 2.6.3). Which line it replaces is not documented: here the one that was used longest ago.

const LINE_SHIFT = 3;
const SETS = 1024;
const FLASH = 0x10;
const LINES = 1 << 18;
// Waits of a line that it does not have. The second stage of the boot runs the flash at half the clock: 8 cycles of the bus for address
// and mode, 4 for the flash to answer, 16 for 64 bits, and 2 for its selection, see the data sheet of the W25Q080, "Fast Read Quad I/O".
export const MISS_CYCLES = 2 * (8 + 4 + 16 + 2);

export function createCache(chip) {
  const ways = new Int32Array(2 * SETS).fill(-1);
  const touchedIn = new Uint32Array(LINES);
  // Since the last `begin`: lines that were not there, and different lines.
  const counts = { misses: 0, lines: 0 };
  let period = 1;

  function touch(address) {
    const line = (address & 0xffffff) >>> LINE_SHIFT;
    const at = 2 * (line % SETS);
    if (touchedIn[line] !== period) {
      touchedIn[line] = period;
      counts.lines += 1;
    }
    if (ways[at] === line) return;
    if (ways[at + 1] !== line) counts.misses += 1;
    // The first way is the one that was used last.
    ways[at + 1] = ways[at];
    ways[at] = line;
  }

  for (const name of ['readUint8', 'readUint16', 'readUint32']) {
    const read = chip[name].bind(chip);
    chip[name] = (address) => {
      if (address >>> 24 === FLASH) touch(address);
      return read(address);
    };
  }
  return {
    counts,
    begin() {
      period += 1;
      counts.misses = 0;
      counts.lines = 0;
    },
    // What an erase or a write leaves.
    flush: () => ways.fill(-1),
  };
}
