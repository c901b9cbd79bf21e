// A plot whose plane can be enlarged while the numbers stay at its axes: the plane is a picture of its own inside the plot.

const SVG = 'http://www.w3.org/2000/svg';
// Ticks of a file are at whole pixels.
const ROUNDING_PX = 1.5;
const TICKS = 5;

const number = (element, name) => Number(element.getAttribute(name));

function pointsOf(line) {
  return (line.getAttribute('points') ?? '').trim().split(/\s+/).map((point) => point.split(',').map(Number));
}

// A line along one axis: 0 is x.
function along(line, axis) {
  const points = pointsOf(line);
  const isStraight = points.length === 2 && points[0][1 - axis] === points[1][1 - axis];
  return isStraight ? { line, from: points[0][axis], to: points[1][axis], at: points[0][1 - axis] } : null;
}

// Where a value is, and the reverse, from the numbers at an axis; null where they are no linear or logarithmic scale.
function scaleOf(ticks) {
  const known = ticks.map(({ at, text }) => [at, Number(text.textContent)]).filter(([, value]) => Number.isFinite(value));
  if (known.length < 2 || known.length < ticks.length) return null;
  for (const isLog of [false, true]) {
    const [to, from] = isLog ? [Math.log10, (value) => 10 ** value] : [(value) => value, (value) => value];
    const [[a, first], [b, last]] = [known[0], known.at(-1)];
    const slope = (b - a) / (to(last) - to(first));
    const pixel = (value) => a + slope * (to(value) - to(first));
    const fits = known.every(([at, value]) => Math.abs(pixel(value) - at) <= ROUNDING_PX);
    if (Number.isFinite(slope) && fits) return { isLog, pixel, value: (at) => from(to(first) + (at - a) / slope) };
  }
  return null;
}

// Round values between two, about five.
function roundValues(low, high, isLog) {
  if (isLog && high / low > 8) {
    const powers = Array.from({ length: Math.ceil(Math.log10(high / low)) + 2 }, (_, k) => 10 ** (Math.floor(Math.log10(low)) + k));
    const digits = high / low > 100 ? [1] : [1, 2, 5];
    return powers.flatMap((power) => digits.map((digit) => digit * power)).filter((value) => value >= low && value <= high);
  }
  const power = 10 ** Math.floor(Math.log10((high - low) / TICKS));
  const step = [1, 2, 5, 10].map((digit) => digit * power).find((size) => size >= (high - low) / TICKS);
  const first = Math.ceil(low / step);
  return Array.from({ length: Math.max(0, Math.floor(high / step) - first + 1) }, (_, k) => (first + k) * step);
}

export class Axes {
  constructor(svg) {
    const size = [number(svg, 'width'), number(svg, 'height')];
    const lines = [...svg.querySelectorAll('polyline')];
    const [across, up] = [0, 1].map((axis) => lines.map((line) => along(line, axis)).filter(Boolean));
    const longest = (found) => Math.max(...found.map(({ from, to }) => Math.abs(to - from)));
    const x = across.filter(({ from, to }) => Math.abs(to - from) === longest(across)).sort((a, b) => b.at - a.at)[0];
    const y = up.filter(({ from, to }) => Math.abs(to - from) === longest(up)).sort((a, b) => a.at - b.at)[0];
    this.plane = x && y ? { left: x.from, top: y.from, width: x.to - x.from, height: x.at - y.from } : { left: 0, top: 0, width: size[0], height: size[1] };
    this.sides = x && y ? [this.side(svg, 0, x, up, size), this.side(svg, 1, y, across, size)] : [];
    const kept = new Set([svg.querySelector('rect'), x?.line, y?.line, ...this.sides.flatMap(({ ticks, names }) => [...ticks.flatMap(({ mark, text }) => [mark, text]), ...names])]);
    this.inner = document.createElementNS(SVG, 'svg');
    for (const [name, value] of Object.entries({ x: this.plane.left, y: this.plane.top, width: this.plane.width, height: this.plane.height })) {
      this.inner.setAttribute(name, value);
    }
    this.inner.append(...[...svg.children].filter((child) => !kept.has(child)));
    svg.append(this.inner);
    this.svg = svg;
  }

  // The numbers, marks and names of an axis: 0 is x, below the plane; 1 is y, left of it.
  side(svg, axis, line, marks, size) {
    const texts = [...svg.querySelectorAll('text')].filter((text) => (axis === 0 ? number(text, 'y') > line.at : number(text, 'x') < line.at && number(text, 'y') < size[1] - 40));
    const names = texts.filter((text) => text.hasAttribute('transform') || (axis === 0 && number(text, 'y') >= size[1] - 12));
    const ticks = texts.filter((text) => !names.includes(text)).map((text) => {
      const at = number(text, axis === 0 ? 'x' : 'y');
      const mark = marks.find((mark) => Math.abs(mark.to - mark.from) < 10 && mark.at === at)?.line;
      return { at, text, mark };
    }).filter(({ mark }) => mark);
    return { axis, names, ticks, scale: scaleOf(ticks), added: [] };
  }

  // Shows a part of the plane: its corner in px of the plane, and how many times it is enlarged.
  show({ x, y, factor }) {
    const { left, top, width, height } = this.plane;
    this.inner.setAttribute('viewBox', `${left + x} ${top + y} ${width / factor} ${height / factor}`);
    for (const side of this.sides) {
      const [start, length, offset] = side.axis === 0 ? [left, width, x] : [top, height, y];
      const seen = (at) => start + (at - start - offset) * factor;
      const isSeen = (at) => seen(at) >= start - 0.5 && seen(at) <= start + length + 0.5;
      side.added.forEach((element) => element.remove());
      side.added = [];
      const isNew = factor > 1 && side.scale;
      for (const tick of side.ticks) this.place(side.axis, tick, tick.at, seen(tick.at), !isNew && isSeen(tick.at));
      if (isNew) this.add(side, [start + offset, start + offset + length / factor], seen);
    }
  }

  // Numbers for what is seen of an axis.
  add(side, ends, seen) {
    const [low, high] = ends.map(side.scale.value).sort((a, b) => a - b);
    for (const value of roundValues(low, high, side.scale.isLog)) {
      const { at, text, mark } = side.ticks[0];
      const tick = { text: text.cloneNode(true), mark: mark.cloneNode(true) };
      tick.text.textContent = String(Number(value.toPrecision(6)));
      this.place(side.axis, tick, at, seen(side.scale.pixel(value)), true);
      side.added.push(tick.text, tick.mark);
      this.svg.append(tick.text, tick.mark);
    }
  }

  place(axis, { text, mark }, from, to, isSeen) {
    text.setAttribute(axis === 0 ? 'x' : 'y', to);
    mark.setAttribute('transform', axis === 0 ? `translate(${to - from} 0)` : `translate(0 ${to - from})`);
    for (const element of [text, mark]) element.style.display = isSeen ? '' : 'none';
  }
}
