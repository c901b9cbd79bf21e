// A panic at any moment: the processor goes on in a function of the core library that does nothing else.

// Address of the first function with this in its name, from the table of symbols of an ELF file of 32 bits.
export function symbol(elf, part) {
  const [table, size, count] = [elf.readUInt32LE(32), elf.readUInt16LE(46), elf.readUInt16LE(48)];
  const word = (section, index) => elf.readUInt32LE(table + section * size + 4 * index);
  for (let k = 0; k < count; k++) {
    // SHT_SYMTAB; its field `link` is the section of the names.
    if (word(k, 1) !== 2) continue;
    const names = word(word(k, 6), 4);
    for (let at = word(k, 4); at < word(k, 4) + word(k, 5); at += 16) {
      const name = names + elf.readUInt32LE(at);
      if (elf.toString('latin1', name, elf.indexOf(0, name)).includes(part)) return elf.readUInt32LE(at + 4);
    }
  }
  return null;
}

// The function takes the place of its call: name of the file and its length, line, column. The name is any text of the image.
export function panic(chip, address) {
  const { core, sram } = chip;
  const place = 0x20000000;
  new Uint32Array(sram.buffer, sram.byteOffset, 4).set([0x10000000, 0, 1, 1]);
  core.registers[0] = place;
  core.PC = address & ~1;
  core.waiting = false;
}
