// A plot that can be enlarged and moved: buttons, the keys + − 0 and the arrows, drag, and the wheel together with Ctrl.

import { Axes } from './axes.js';
import { make } from './format.js';

const STEP = 1.5;
const MAX = 16;
const MOVE = 0.15;

export class Zoom {
  constructor(svg, name) {
    this.svg = svg;
    this.axes = new Axes(svg);
    this.full = this.axes.plane;
    this.view = { x: 0, y: 0, factor: 1 };
    svg.setAttribute('aria-label', `Plot: ${name}`);
    const button = (text, label, act) => {
      const made = make('button', { type: 'button', className: 'small', ariaLabel: `${label}: ${name}`, title: label }, text);
      made.addEventListener('click', act);
      return made;
    };
    this.buttons = [
      button('+', 'Enlarge', () => this.by(STEP)), button('−', 'Reduce', () => this.by(1 / STEP)),
      button('1:1', '1:1, whole plot', () => this.reset()),
    ];
    this.frame = make('div', { className: 'plot', tabIndex: 0, role: 'group', ariaLabel: `Plot: ${name}; keys + − 0 and arrows` });
    svg.replaceWith(this.frame);
    this.frame.append(svg, make('div', { className: 'zoom' }, ...this.buttons));
    this.listen();
    this.show();
  }

  listen() {
    this.frame.addEventListener('keydown', (event) => this.key(event));
    this.svg.addEventListener('wheel', (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      this.by(event.deltaY < 0 ? STEP : 1 / STEP, this.at(event));
    }, { passive: false });
    let last = null;
    this.svg.addEventListener('pointerdown', (event) => {
      if (this.view.factor === 1) return;
      last = event;
      this.svg.setPointerCapture(event.pointerId);
    });
    this.svg.addEventListener('pointermove', (event) => {
      if (!last) return;
      const [from, to] = [this.at(last), this.at(event)];
      this.move(from[0] - to[0], from[1] - to[1]);
      last = event;
    });
    for (const type of ['pointerup', 'pointercancel']) this.svg.addEventListener(type, () => { last = null; });
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const acts = {
      '+': () => this.by(STEP), '=': () => this.by(STEP), '-': () => this.by(1 / STEP), 0: () => this.reset(),
      ArrowLeft: () => this.move(-MOVE, 0), ArrowRight: () => this.move(MOVE, 0), ArrowUp: () => this.move(0, -MOVE), ArrowDown: () => this.move(0, MOVE),
    };
    // Arrows scroll the page until there is something to move.
    if (!acts[event.key] || (event.key.startsWith('Arrow') && this.view.factor === 1)) return;
    event.preventDefault();
    acts[event.key]();
  }

  // Where the pointer is, as shares of the plane as it is seen.
  at(event) {
    const { left, top, width } = this.svg.getBoundingClientRect();
    const pixel = Number(this.svg.getAttribute('width')) / width;
    const at = [(event.clientX - left) * pixel - this.full.left, (event.clientY - top) * pixel - this.full.top];
    return [at[0] / this.full.width, at[1] / this.full.height];
  }

  by(ratio, [x, y] = [0.5, 0.5]) {
    const before = this.view.factor;
    const factor = Math.min(MAX, Math.max(1, before * ratio));
    this.view.x += x * this.full.width * (1 / before - 1 / factor);
    this.view.y += y * this.full.height * (1 / before - 1 / factor);
    this.view.factor = factor;
    this.show();
  }

  move(x, y) {
    this.view.x += (x * this.full.width) / this.view.factor;
    this.view.y += (y * this.full.height) / this.view.factor;
    this.show();
  }

  reset() {
    this.view = { x: 0, y: 0, factor: 1 };
    this.show();
  }

  show() {
    const { view, full } = this;
    const [width, height] = [full.width / view.factor, full.height / view.factor];
    view.x = Math.min(Math.max(view.x, 0), full.width - width);
    view.y = Math.min(Math.max(view.y, 0), full.height - height);
    this.axes.show(view);
    this.frame.classList.toggle('enlarged', view.factor > 1);
    const [, reduce, whole] = this.buttons;
    reduce.disabled = whole.disabled = view.factor === 1;
  }
}
