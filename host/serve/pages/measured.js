// The measured pose of the tool next to the predicted one, and the residual by axis.

import { byId, fixed, make, setText } from './format.js';

// To µm and thousandths of a degree, poses and residuals alike: a residual is their difference.
const number = (value, axis) => fixed((axis < 3 ? 1e3 : 180 / Math.PI) * value, 3).replace('-', '−');
const length = (vector) => Math.hypot(...vector);

// The axes of a planar arm are x, y and the angle; those of another one have a rotation vector.
const axes = (isPlanar) => (isPlanar ? [['x, mm', 0], ['y, mm', 1], ['angle, °', 5]]
  : [['x, mm', 0], ['y, mm', 1], ['z, mm', 2], ['rotation x, °', 3], ['rotation y, °', 4], ['rotation z, °', 5]]);
const of = ({ position_m: position, rotation_rad: rotation }, axis) => (axis < 3 ? position[axis] : rotation[axis - 3]);

function state({ source, problem, tool, residual, n, age_s: age }) {
  if (problem) return `No measured poses from ${source}: ${problem}.`;
  if (!tool) return `No pose from ${source} yet.`;
  const old = age > 1 ? ` The newest pose is ${age.toFixed(0)} s old.` : '';
  if (!residual) return `The newest pose of ${source} was measured before the arm came to rest here: no residual.${old}`;
  return `Mean of the ${n < 100 ? n : 'last 100'} poses from ${source} since the arm came to rest here.${old}`;
}

// What the source measures besides the pose.
function conditions({ supply_bar: supply, temperature_c: temperature }) {
  const parts = [supply === null ? '' : `supply ${supply.toFixed(2)} bar`, temperature === null ? '' : `temperature ${temperature.toFixed(1)} °C`];
  return parts.filter((part) => part).join(', ').replace(/^./, (first) => first.toUpperCase());
}

// `predicted` is the tool of the picture.
export function showMeasured(measured, predicted, isPlanar) {
  const section = byId('measured-section');
  section.hidden = !measured;
  if (!measured) return;
  setText(byId('measured-state'), state(measured));
  showPose(measured, predicted, isPlanar);
}

// Predicted and measured pose by axis, their residual, and what the source measures besides.
export function showPose(measured, predicted, isPlanar) {
  setText(byId('conditions'), conditions(measured));
  const { tool, residual } = measured;
  const body = byId('measured');
  const names = axes(isPlanar);
  if (body.children.length !== names.length) {
    body.replaceChildren(...names.map(([name]) => make('tr', {}, make('th', { scope: 'row' }, name), ...[0, 1, 2].map(() => make('td', { className: 'num' })))));
  }
  names.forEach(([, axis], index) => {
    const [, shown, seen, left] = body.children[index].children;
    setText(shown, predicted ? number(of(predicted, axis), axis) : '–');
    setText(seen, tool ? number(of(tool, axis), axis) : '–');
    setText(left, residual ? number(of(residual, axis), axis) : '–');
  });
  setText(byId('residual'), residual
    ? `Residual (predicted − measured): ${number(length(residual.position_m), 0)} mm, ${number(length(residual.rotation_rad), 3)}°` : 'No residual');
}
