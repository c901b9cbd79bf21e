// The arm with a target: a ball that is dragged by mouse, pen or finger and moved by keys, joined to the tool that was reached.

import * as THREE from './vendor/three.module.min.js';
import { ArmPicture } from './arm.js';

// A finger is wider than a pointer.
const GRIP_PX = { touch: 40, pen: 28, mouse: 20 };
const STEP_M = 0.01;
const TURN_RAD = Math.PI / 36;
const TURN_PER_PX = 0.01;

const css = (name) => new THREE.Color(getComputedStyle(document.documentElement).getPropertyValue(name).trim());

export function rotationVector(quaternion) {
  const { x, y, z, w } = quaternion;
  const sine = Math.hypot(x, y, z);
  const angle = 2 * Math.atan2(w < 0 ? -sine : sine, Math.abs(w));
  return sine < 1e-12 ? [0, 0, 0] : [x, y, z].map((part) => (part / sine) * angle);
}

export function quaternionOf(vector) {
  const axis = new THREE.Vector3(...vector);
  const angle = axis.length();
  return new THREE.Quaternion().setFromAxisAngle(angle > 0 ? axis.divideScalar(angle) : new THREE.Vector3(0, 0, 1), angle);
}

export class TargetPicture extends ArmPicture {
  // `moved` is called with every change by pointer or key; `turns` says whether dragging turns.
  constructor(canvas, { moved, turns }) {
    super(canvas, { turnsByKeys: false });
    this.moved = moved;
    this.turns = turns;
    this.position = new THREE.Vector3();
    this.rotation = new THREE.Quaternion();
    this.extras = new THREE.Group();
    this.scene.add(this.extras);
    this.now = null;
    this.rests = [];
    this.dragged = null;
    // Before the view turns: the ball is taken first.
    canvas.addEventListener('pointerdown', (event) => this.take(event), { capture: true });
    canvas.addEventListener('pointermove', (event) => this.drag(event));
    for (const type of ['pointerup', 'pointercancel']) canvas.addEventListener(type, () => this.drop());
    canvas.addEventListener('keydown', (event) => this.key(event));
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.mark());
  }

  get isPlanar() { return Boolean(this.picture?.is_planar); }

  setTarget(position, rotation) {
    this.position.set(...position);
    this.rotation.copy(quaternionOf(rotation));
    this.mark();
  }

  // The arm as it is now, and the positions between; both may be missing.
  setNow(picture) {
    this.now = picture;
    this.mark();
  }

  setRests(positions) {
    this.rests = positions;
    this.mark();
  }

  show(picture) {
    super.show(picture);
    this.mark();
  }

  mark() {
    if (!this.picture) return;
    for (const old of this.extras.children) {
      old.geometry.dispose();
      old.material.dispose();
    }
    this.extras.clear();
    const at = this.position;
    const ball = new THREE.Mesh(new THREE.SphereGeometry(0.022 * this.size, 24, 16), new THREE.MeshLambertMaterial({ color: css('--orange') }));
    ball.position.copy(at);
    ball.renderOrder = 2;
    ball.material.depthTest = false;
    this.extras.add(ball);
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]].forEach((axis, index) => {
      const along = new THREE.Vector3(...axis).applyQuaternion(this.rotation).multiplyScalar(0.13 * this.size);
      this.line([at, at.clone().add(along)], ['--red', '--green', '--azure'][index]);
    });
    this.line([at, this.tool.position], '--orange', { isDashed: true });
    if (this.rests.length > 1) this.path(this.rests.map((rest) => new THREE.Vector3(...rest)));
    if (this.now) this.line(this.now.lines.flatMap(({ from_m, to_m }) => [new THREE.Vector3(...from_m), new THREE.Vector3(...to_m)]), '--muted', { isPairs: true });
    this.draw();
  }

  line(points, color, { isDashed = false, isPairs = false } = {}) {
    const geometry = new THREE.BufferGeometry().setFromPoints(points);
    const Material = isDashed ? THREE.LineDashedMaterial : THREE.LineBasicMaterial;
    const dashes = isDashed ? { dashSize: 0.02 * this.size, gapSize: 0.012 * this.size } : {};
    const material = new Material({ color: css(color), depthTest: false, ...dashes });
    const line = isPairs ? new THREE.LineSegments(geometry, material) : new THREE.Line(geometry, material);
    if (isDashed) line.computeLineDistances();
    line.renderOrder = 2;
    this.extras.add(line);
  }

  path(points) {
    this.line(points, '--accent');
    for (const point of points) {
      const box = new THREE.Mesh(new THREE.BoxGeometry(1, 1, 1), new THREE.MeshLambertMaterial({ color: css('--accent') }));
      box.position.copy(point);
      box.scale.setScalar(0.014 * this.size);
      this.extras.add(box);
    }
  }

  // ---------------------------------------------------------------- pointer

  // Where the target is on the canvas, px.
  onCanvas() {
    const { width, height } = this.canvas.getBoundingClientRect();
    const seen = this.position.clone().project(this.camera);
    return [(0.5 + 0.5 * seen.x) * width, (0.5 - 0.5 * seen.y) * height];
  }

  pointer(event) {
    const { left, top } = this.canvas.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  }

  take(event) {
    if (!this.picture || event.button !== 0) return;
    const [at, ball] = [this.pointer(event), this.onCanvas()];
    if (Math.hypot(at[0] - ball[0], at[1] - ball[1]) > (GRIP_PX[event.pointerType] ?? GRIP_PX.mouse)) return;
    this.controls.enabled = false;
    this.canvas.setPointerCapture(event.pointerId);
    this.dragged = { last: at, offset: [ball[0] - at[0], ball[1] - at[1]] };
  }

  drag(event) {
    if (!this.dragged) return;
    const at = this.pointer(event);
    if (this.turns()) this.turnBy(this.dragged.last, at);
    else this.moveTo([at[0] + this.dragged.offset[0], at[1] + this.dragged.offset[1]]);
    this.dragged.last = at;
    this.changed();
  }

  drop() {
    if (!this.dragged) return;
    this.dragged = null;
    this.controls.enabled = true;
  }

  // In the plane of a planar arm, else in the plane through the target that faces the viewer.
  moveTo([x, y]) {
    const { width, height } = this.canvas.getBoundingClientRect();
    const ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * x) / width - 1, 1 - (2 * y) / height), this.camera);
    const normal = this.isPlanar ? new THREE.Vector3(0, 0, 1) : this.camera.getWorldDirection(new THREE.Vector3());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, this.position);
    const hit = ray.ray.intersectPlane(plane, new THREE.Vector3());
    if (hit) this.position.copy(hit);
  }

  turnBy(from, to) {
    const ball = this.onCanvas();
    if (this.isPlanar) {
      const angle = (point) => Math.atan2(ball[1] - point[1], point[0] - ball[0]);
      this.turn(new THREE.Vector3(0, 0, 1), angle(to) - angle(from));
      return;
    }
    const [right, up] = this.screenAxes();
    this.turn(up, TURN_PER_PX * (to[0] - from[0]));
    this.turn(right, TURN_PER_PX * (to[1] - from[1]));
  }

  turn(axis, angle) {
    this.rotation.premultiply(new THREE.Quaternion().setFromAxisAngle(axis, angle)).normalize();
  }

  // To the right, up and towards the viewer.
  screenAxes() {
    const axes = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
    this.camera.updateMatrixWorld();
    this.camera.matrixWorld.extractBasis(...axes);
    return axes;
  }

  // ---------------------------------------------------------------- keys

  // The axes of the base that point to the right, up and towards the viewer on the screen, as far as they do.
  baseAxes() {
    const free = ['x', 'y', 'z'];
    return this.screenAxes().map((seen) => {
      const name = free.reduce((best, axis) => (Math.abs(seen[axis]) > Math.abs(seen[best]) ? axis : best), free[0]);
      free.splice(free.indexOf(name), 1);
      const axis = new THREE.Vector3();
      axis[name] = Math.sign(seen[name]) || 1;
      return axis;
    });
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || !this.picture) return;
    const [right, up, near] = this.baseAxes();
    const moves = { ArrowRight: [right, 1], ArrowLeft: [right, -1], ArrowUp: [up, 1], ArrowDown: [up, -1], PageDown: [near, 1], PageUp: [near, -1] };
    const turns = { ',': 1, '.': -1 };
    if (moves[event.key] && !(this.isPlanar && event.key.startsWith('Page'))) {
      const [axis, sign] = moves[event.key];
      this.position.addScaledVector(axis, sign * STEP_M * (event.shiftKey ? 0.1 : 1));
    } else if (turns[event.key]) this.turn(near, turns[event.key] * TURN_RAD);
    else return;
    event.preventDefault();
    this.changed();
  }

  changed() {
    if (this.isPlanar) this.position.z = 0;
    this.mark();
    this.moved();
  }

  draw() {
    super.draw();
    if (this.position) this.canvas.dataset.target = JSON.stringify(this.onCanvas());
  }
}
