// The chip from one reset to the next: the image in its flash, its pins, its ports, its time.

import { createCache, MISS_CYCLES } from './cache.mjs';
import { bootRom, call } from './rom.mjs';
import { createUsbHost } from './usb.mjs';

const XIP_CONTROL = 0x14000;
const VECTORS = 0x100;
const RAM = 0x20000000;
const NS_PER_CYCLE = 8;
// Output pins whose edges are reported: those of the chain, and the pulse to a camera.
const REPORTED = [2, 3, 4, 5, 19];
// What the stack's memory holds before it is used.
const PAINT = 0x5c;
// The exception of TIMER_IRQ_1, in which the control tick runs.
const CONTROL = 16 + 1;
const UART_BYTE_NS = 10_000;

// Parts of an ELF file that lie in the flash, with their offsets in it.
export function segments(elf) {
  const [table, size, count] = [elf.readUInt32LE(28), elf.readUInt16LE(42), elf.readUInt16LE(44)];
  const found = [];
  for (let k = 0; k < count; k++) {
    const entry = table + k * size;
    const [type, offset, , address, length] = [0, 4, 8, 12, 16].map((at) => elf.readUInt32LE(entry + at));
    if (type === 1 && address >= 0x10000000 && address < 0x11000000) {
      found.push({ at: address - 0x10000000, bytes: elf.subarray(offset, offset + length) });
    }
  }
  return found;
}

export function createChip(module, image, flash, report, shorted) {
  const { RP2040, BasePeripheral, ConsoleLogger, LogLevel } = module;
  const chip = new RP2040();
  const { clock } = chip;
  chip.logger = new ConsoleLogger(LogLevel.Error);
  chip.loadBootrom(bootRom());
  flash.load(chip);
  image.forEach(({ at, bytes }) => chip.flash.set(bytes, at));

  class Xip extends BasePeripheral {
    readUint32() {
      return 0;
    }
    writeUint32() {}
  }
  chip.peripherals[XIP_CONTROL] = new Xip(chip, 'XIP_CTRL');
  const watchdog = chip.peripherals[0x40058];
  const written = keepWrites(chip);
  // VSYS over 3 is 1.667 V; the sensor of the chip gives 0.706 V, at 27 °C.
  chip.adc.channelValues = [0, 0, 0, 2069, 876];
  const stack = new DataView(chip.flash.buffer).getUint32(VECTORS, true) - RAM;
  const state = { chip, clock, written, stack, shorted, ended: null, ticks: noTicks(), tick: noTick() };
  state.cache = createCache(chip);
  // A pin can be read while it drives: its input follows, unless it is connected to ground.
  state.readBack = (pin) => {
    const { outputEnable, outputValue } = chip.gpio[pin];
    chip.gpio[pin].setInputValue((outputEnable ? outputValue : pin === 5) && !shorted.has(pin));
  };

  const end = (why) => {
    state.ended ??= why;
  };
  watchdog.onWatchdogTrigger = () => end({ why: 'reset', reason: watchdog.reason });
  flash.onCut = () => end({ why: 'cut' });
  flash.onTime = (nanoseconds) => {
    state.cache.flush();
    clock.tick(nanoseconds);
  };
  chip.onBreak = (number) => call(number, chip, flash, () => end({ why: 'loader' }));

  state.usb = createUsbHost(module, chip.usbCtrl, (bytes) => report.bytes('console', bytes));
  chip.uart[0].onByte = (byte) => {
    // One wire: what is sent is heard.
    state.feedBus([byte]);
    report.bytes('bus', [byte]);
  };
  const coming = [];
  const arrival = clock.createAlarm(() => {
    chip.uart[0].feedByte(coming.shift());
    if (coming.length > 0) arrival.schedule(UART_BYTE_NS);
  });
  state.feedBus = (bytes) => {
    if (coming.length === 0 && bytes.length > 0) arrival.schedule(UART_BYTE_NS);
    coming.push(...bytes);
  };
  REPORTED.forEach((pin) => {
    let level = null;
    chip.gpio[pin].addListener(() => {
      const { outputEnable, outputValue } = chip.gpio[pin];
      // Nobody drives it: the pull-up of output enable holds it high, the others are low.
      const now = outputEnable ? outputValue : pin === 5;
      if (now !== level) report.edge(clock.nanos, pin, now && !state.shorted.has(pin));
      level = now;
      state.readBack(pin);
    });
  });
  runPio(chip.pio[0], clock, state);
  return state;
}

// What the image writes to registers that the emulator does not have, by their address.
function keepWrites(chip) {
  const written = new Map();
  const keep = (peripheral, base, offsets) => {
    const write = peripheral.writeUint32.bind(peripheral);
    peripheral.writeUint32 = (offset, value) => {
      if (offsets.includes(offset)) written.set(base + offset, value >>> 0);
      else write(offset, value);
    };
  };
  // MPU_CTRL, MPU_RBAR, MPU_RASR; DBGPAUSE of the timer.
  keep(chip.ppb, 0xe000e000, [0xd94, 0xd9c, 0xda0]);
  keep(chip.peripherals[0x40054], 0x40054000, [0x2c]);
  return written;
}

// What a register holds.
export const peek = ({ chip, written }, address) => written.get(address) ?? chip.readUint32(address) >>> 0;

// A hard fault of the code that runs now, with this stack pointer: the emulator raises none by itself.
export function hardFault({ chip }, stackPointer) {
  const { core } = chip;
  core.SP = stackPointer;
  core.waiting = false;
  core.exceptionEntry(3);
}

// Steps the first state machine with the chip's clock; the emulator steps all of them with the host's.
function runPio(pio, clock, state) {
  pio.run = () => {};
  const machine = pio.machines[0];
  let at = 0;
  state.stepPio = () => {
    if (!machine.enabled) return;
    const cycleNs = NS_PER_CYCLE * (machine.clockDivInt + machine.clockDivFrac / 256);
    if (machine.waiting) at = clock.nanos;
    while (!machine.waiting && at < clock.nanos) {
      const before = machine.cycles;
      machine.step();
      pio.checkChangedPins();
      at += (machine.cycles - before) * cycleNs;
    }
  };
  state.isPioBusy = () => machine.enabled && !machine.waiting;
}

// Starts the image as the boot ROM does after power-up, or with the memory of the chip before a reset.
export function start(state, before) {
  const { chip, stack } = state;
  const vectors = new DataView(chip.flash.buffer);
  if (before) {
    chip.sram.set(before.chip.sram);
    const [to, from] = [chip, before.chip].map((chip) => chip.peripherals[0x40058]);
    to.scratchData.set(from.scratchData);
    to.reason = before.ended.reason ?? 0;
  } else {
    // Memory holds noise after power-up.
    for (let k = 0; k < chip.sram.length; k++) chip.sram[k] = (k * 167 + (k >> 8) * 59) & 255;
  }
  chip.sram.fill(PAINT, 0, stack);
  chip.core.SP = vectors.getUint32(VECTORS, true);
  chip.core.PC = vectors.getUint32(VECTORS + 4, true) & ~1;
  chip.core.VTOR = 0x10000000 + VECTORS;
}

// Bytes of the stack that were ever in use.
export function stackUsed({ chip, stack }) {
  let free = 0;
  while (free < stack && chip.sram[free] === PAINT) free++;
  return stack - free;
}

// Counts of control ticks: how many, and the longest in instructions, in cycles, in cycles with the waits of the cache, and in cycles
// as if the cache were empty at its begin.
export const noTicks = () => ({ count: 0, longest: 0, longestCycles: 0, longestWaiting: 0, longestCold: 0 });

// The tick that runs: instructions and cycles so far. It may go on in the next step.
const noTick = () => ({ instructions: 0, cycles: 0 });

function countTick({ ticks, tick, cache }) {
  // One line more: the tick may begin while another one is fetched.
  const after = (lines) => tick.cycles + (lines + 1) * MISS_CYCLES;
  ticks.count += 1;
  ticks.longest = Math.max(ticks.longest, tick.instructions);
  ticks.longestCycles = Math.max(ticks.longestCycles, tick.cycles);
  ticks.longestWaiting = Math.max(ticks.longestWaiting, after(cache.counts.misses));
  ticks.longestCold = Math.max(ticks.longestCold, after(cache.counts.lines));
}

// Counts an instruction, after it.
function count(state, used) {
  if (state.chip.core.IPSR === CONTROL) {
    state.tick.instructions += 1;
    state.tick.cycles += used;
  } else if (state.tick.instructions > 0) {
    countTick(state);
    state.tick = noTick();
  }
}

// Runs until this time of its clock, or until it ends.
export function run(state, untilNs) {
  const { chip, clock } = state;
  const { core } = chip;
  while (clock.nanos < untilNs && state.ended === null) {
    // An interrupt that was pending when the processor fell asleep wakes it, also while it is masked (ARMv6-M, B1.5.19); the emulator
    // looks at new ones alone.
    if (core.waiting && core.pendingInterrupts & core.enabledInterrupts) {
      core.waiting = false;
      core.interruptsUpdated = true;
    }
    if (core.waiting) {
      const next = clock.nextAlarm === null ? Infinity : clock.nanosToNextAlarm;
      const wait = Math.max(Math.min(next, untilNs - clock.nanos), 0);
      clock.tick(state.isPioBusy() ? Math.min(wait, 10 * NS_PER_CYCLE) : wait);
    } else {
      if (state.tick.instructions === 0) state.cache.begin();
      const used = core.executeInstruction();
      clock.tick(used * NS_PER_CYCLE);
      count(state, used);
    }
    state.stepPio();
  }
}
