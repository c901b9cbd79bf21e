// The measured pose of the tool next to the predicted one, and the residual by axis.

import { byId, degrees, make, mm, setText } from './format.js';

// Residuals are small: µm and thousandths of a degree.
const mm3 = (m) => `${(1e3 * m).toFixed(3)} mm`;
const degrees3 = (rad) => `${((180 / Math.PI) * rad).toFixed(3)}°`;
const length = (vector) => Math.hypot(...vector);

// The axes of a planar arm are x, y and the angle; those of another one have a rotation vector.
const axes = (isPlanar) => (isPlanar ? [['x', 0], ['y', 1], ['angle', 5]]
  : [['x', 0], ['y', 1], ['z', 2], ['rotation x', 3], ['rotation y', 4], ['rotation z', 5]]);
const of = ({ position_m: position, rotation_rad: rotation }, axis) => (axis < 3 ? position[axis] : rotation[axis - 3]);

function state({ source, problem, tool, residual, n, age_s: age }) {
  if (problem) return `No measured poses from ${source}: ${problem}.`;
  if (!tool) return `No pose from ${source} yet.`;
  const old = age > 1 ? ` The newest pose is ${age.toFixed(0)} s old.` : '';
  if (!residual) return `The newest pose of ${source} was measured before the arm came to rest here: no residual.${old}`;
  return `Mean of the poses of ${source} since the arm rests here, ${n < 100 ? n : 'the last 100'}.${old}`;
}

// `predicted` is the tool of the picture.
export function showMeasured(measured, predicted, isPlanar) {
  const section = byId('measured-section');
  section.hidden = !measured;
  if (!measured) return;
  setText(byId('measured-state'), state(measured));
  const { tool, residual } = measured;
  const body = byId('measured');
  const names = axes(isPlanar);
  if (body.children.length !== names.length) {
    body.replaceChildren(...names.map(([name]) => make('tr', {}, make('th', { scope: 'row' }, name), ...[0, 1, 2].map(() => make('td', { className: 'num' })))));
  }
  names.forEach(([, axis], index) => {
    const [, shown, seen, left] = body.children[index].children;
    setText(shown, predicted ? (axis < 3 ? mm : degrees)(of(predicted, axis)) : '–');
    setText(seen, tool ? (axis < 3 ? mm : degrees)(of(tool, axis)) : '–');
    setText(left, residual ? (axis < 3 ? mm3 : degrees3)(of(residual, axis)) : '–');
  });
  setText(byId('residual'), residual
    ? `Residual (predicted − measured): ${mm3(length(residual.position_m))}, ${degrees3(length(residual.rotation_rad))}` : 'No residual');
}
