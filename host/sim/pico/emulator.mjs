// Runs the image of the Pico in rp2040js, step by step as the program at its standard input says.
//
//   node emulator.mjs RP2040JS IMAGE.elf FLASH.img
//
// | line in             | meaning                                                                        |
// |---------------------|--------------------------------------------------------------------------------|
// | `console HEX`       | bytes from the host                                                            |
// | `bus HEX`           | bytes from the servos                                                          |
// | `pin NUMBER LEVEL`  | an input pin                                                                   |
// | `cut COUNT SEED`    | the power fails in this operation of the flash from now on, 1 for the next      |
// | `power`             | the power was off: memory is lost, the flash stays                             |
// | `reset`             | the reset button                                                               |
// | `bite`              | the watchdog, which found no feed                                              |
// | `panic`             | the code that runs now panics                                                  |
// | `fault ADDRESS`     | the code that runs now causes a hard fault, with the stack pointer there       |
// | `peek ADDRESS`      | prints `word VALUE`: what a register holds                                     |
// | `flashed`           | a start behind the boot ROM, which has written the image and ends by the watchdog |
// | `short PIN LEVEL`   | 1: an output pin is connected to ground; 0: no more                            |
// | `freeze`            | the state machine of the output chain stops until the next start               |
// | `replug`            | the USB cable was out: the host enumerates the board again                     |
// | `run NANOSECONDS`   | runs so long                                                                   |
// | `measure`           | prints `stack BYTES` and `ticks COUNT INSTRUCTIONS CYCLES WAITING COLD OPERATIONS`, the longest tick since the last time |
//
// While it runs it prints `edge TIME PIN LEVEL`, `console HEX`, `bus HEX`, `reset`, `loader` or `cut`, and after each `run`
// and `measure` a line `done TIME`. Times are nanoseconds since its start, over resets and power cuts.

import fs from 'node:fs';
import { createChip, hardFault, noTicks, peek, run, segments, stackUsed, start } from './chip.mjs';
import { createFlash } from './flash.mjs';
import { panic, symbol } from './panic.mjs';

const [path, elf, flashPath] = process.argv.slice(2);
const module = await import(path);
const file = fs.readFileSync(elf);
const image = segments(file);
const panicAt = symbol(file, 'panic_const_async_fn_resumed');
const flash = createFlash(flashPath);
const inputs = new Map();
// Output pins that are connected to ground.
const shorted = new Set();
let said = [];
// Time of all chips before this one.
let earlierNs = 0;

const hex = (bytes) => Buffer.from(bytes).toString('hex');
const report = {
  edge: (atNs, pin, level) => said.push(`edge ${Math.round(earlierNs + atNs)} ${pin} ${level ? 1 : 0}`),
  bytes: (port, bytes) => bytes.length > 0 && said.push(`${port} ${hex(bytes)}`),
};

function boot(before) {
  const state = createChip(module, image, flash, report, shorted);
  start(state, before);
  inputs.forEach((level, pin) => state.chip.gpio[pin].setInputValue(level));
  return state;
}

// The chip after one that has ended, for whatever reason; its pins are released.
function restart(before, keepsMemory) {
  earlierNs += before.clock.nanos;
  [2, 3, 4].forEach((pin) => report.edge(0, pin, false));
  report.edge(0, 5, true);
  return boot(keepsMemory ? before : undefined);
}

let state = boot();

function runFor(nanoseconds) {
  const untilNs = earlierNs + state.clock.nanos + nanoseconds;
  while (earlierNs + state.clock.nanos < untilNs) {
    run(state, untilNs - earlierNs);
    if (state.ended === null) return;
    said.push(state.ended.why);
    // Without power, or in the loader, nothing happens until the power comes back.
    if (state.ended.why !== 'reset') {
      earlierNs = untilNs - state.clock.nanos;
      return;
    }
    state = restart(state, true);
  }
}

const commands = {
  console: ([text]) => state.usb.send(Buffer.from(text, 'hex')),
  bus: ([text]) => state.feedBus(Buffer.from(text, 'hex')),
  pin: ([pin, level]) => {
    inputs.set(Number(pin), level === '1');
    state.chip.gpio[Number(pin)].setInputValue(level === '1');
  },
  panic: () => panic(state.chip, panicAt),
  fault: ([address]) => hardFault(state, Number(address)),
  peek: ([address]) => {
    said.push(`word ${peek(state, Number(address))}`);
    done();
  },
  flashed: () => {
    state = restart(Object.assign(state, { ended: { why: 'reset' } }), false);
    state.chip.peripherals[0x40058].reason = 1;
  },
  short: ([pin, level]) => {
    if (level === '1') shorted.add(Number(pin));
    else shorted.delete(Number(pin));
    state.readBack(Number(pin));
  },
  freeze: () => {
    state.chip.pio[0].machines[0].enabled = false;
  },
  replug: () => state.usb.enumerate(),
  cut: ([count, seed]) => flash.cutAfter(Number(count), Number(seed)),
  power: () => {
    flash.cutAfter(0, 1);
    state = restart(state, false);
  },
  reset: () => {
    state = restart(Object.assign(state, { ended: { why: 'reset' } }), true);
  },
  bite: () => {
    state = restart(Object.assign(state, { ended: { why: 'reset', reason: 1 } }), true);
  },
  run: ([nanoseconds]) => {
    if (state.ended === null) runFor(Number(nanoseconds));
    else earlierNs += Number(nanoseconds);
    done();
  },
  measure: () => {
    const { count, longest, longestCycles, longestWaiting, longestCold } = state.ticks;
    said.push(`stack ${stackUsed(state)}`);
    said.push(`ticks ${count} ${longest} ${longestCycles} ${longestWaiting} ${longestCold} ${flash.operations}`);
    state.ticks = noTicks();
    done();
  },
};

function done() {
  said.push(`done ${Math.round(earlierNs + state.clock.nanos)}`);
  fs.writeSync(1, `${said.join('\n')}\n`);
  said = [];
}

let rest = '';
const buffer = Buffer.alloc(65536);
for (;;) {
  const count = fs.readSync(0, buffer, 0, buffer.length, null);
  if (count === 0) break;
  const lines = (rest + buffer.toString('latin1', 0, count)).split('\n');
  rest = lines.pop();
  for (const line of lines) {
    const [name, ...rest] = line.split(' ');
    commands[name](rest);
  }
}
