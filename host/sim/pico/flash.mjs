// The flash of the emulated board: a file for the part that the firmware writes, and power cuts in the midst of an
// operation.
//
// An operation that the power fails in leaves a part of it done: of an erase some bytes are erased and the rest have some
// bits set, of a program some bytes are written, one has some of its bits, the rest are untouched.

import fs from 'node:fs';

// Where slots and records begin, and the length of the file.
const START = 1024 * 1024;
const LENGTH = 256 * 1024;
// Typical times of a W25Q16JV.
const ERASE_SECTOR_NS = 45e6;
const SECTOR = 4096;
const PROGRAM_PAGE_NS = 0.4e6;

export function createFlash(path, bytes) {
  if (!fs.existsSync(path)) fs.writeFileSync(path, Buffer.alloc(LENGTH, 0xff));
  const file = fs.openSync(path, 'r+');
  let left = null;
  let noise = 1;
  const flash = {
    bytes,
    operations: 0,
    // Loads the file into an emptied chip.
    load(chip) {
      flash.bytes = chip.flash;
      fs.readSync(file, chip.flash, START, LENGTH, 0);
    },
    // The power fails in this operation from now on, 1 for the next; 0 for none.
    cutAfter(operations, seed) {
      left = operations > 0 ? operations : null;
      noise = seed >>> 0 || 1;
    },
    onCut: () => {},
    onTime: () => {},
    erase(from, length) {
      const cut = spend();
      const done = cut ? random() % length : length;
      flash.bytes.fill(0xff, from, from + done);
      for (let k = done; k < length && cut; k++) flash.bytes[from + k] |= random() & 255;
      finish(from, length, cut, (length / SECTOR) * ERASE_SECTOR_NS);
    },
    program(from, bytes) {
      const cut = spend();
      const done = cut ? random() % bytes.length : bytes.length;
      for (let k = 0; k < done; k++) flash.bytes[from + k] &= bytes[k];
      if (cut) flash.bytes[from + done] &= bytes[done] | random();
      finish(from, bytes.length, cut, PROGRAM_PAGE_NS);
    },
  };

  function random() {
    noise ^= noise << 13;
    noise ^= noise >>> 17;
    noise ^= noise << 5;
    noise >>>= 0;
    return noise;
  }

  function spend() {
    flash.operations += 1;
    if (left === null) return false;
    left -= 1;
    return left === 0;
  }

  function finish(from, length, cut, nanoseconds) {
    if (from >= START && from + length <= START + LENGTH) {
      fs.writeSync(file, flash.bytes, from, length, from - START);
    }
    if (cut) {
      left = null;
      flash.onCut();
    } else {
      flash.onTime(nanoseconds);
    }
  }
  return flash;
}
