// The arm in three dimensions. Contracted legs are thick over their length; extended legs end in a thin rod behind a ring:
// they differ without colour. The picture is drawn when something changes, and not otherwise.

import * as THREE from './vendor/three.module.min.js';
import { OrbitControls } from './vendor/OrbitControls.js';

const UP = new THREE.Vector3(0, 1, 0);
const SLEEVE = 0.55;

const styles = () => {
  const css = getComputedStyle(document.documentElement);
  const color = (name) => new THREE.Color(css.getPropertyValue(name).trim());
  return {
    link: color('--ink'), plate: color('--ink'), contracted: color('--leg'), extended: color('--leg-out'),
    revolute: color('--orange'), prismatic: color('--leg-out'), x: color('--red'), y: color('--green'), z: color('--azure'),
    ground: color('--line'), ring: color('--ink'),
  };
};

const RADIUS = { link: 0.9, plate: 0.9, contracted: 1.1, extended: 1.1, revolute: 1.6, prismatic: 1.6, x: 0.6, y: 0.6, z: 0.6 };

export class ArmPicture {
  // Throws where the browser has no WebGL. Without `turnsByKeys` the arrow keys are left to others.
  constructor(canvas, { turnsByKeys = true } = {}) {
    this.canvas = canvas;
    this.turnsByKeys = turnsByKeys;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.scene = new THREE.Scene();
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x888888, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.4);
    sun.position.set(1, 2, 3);
    this.scene.add(sun);
    this.camera = new THREE.PerspectiveCamera(35, 1, 0.01, 100);
    this.arm = new THREE.Group();
    this.tool = new THREE.Object3D();
    this.scene.add(this.arm, this.tool);
    this.rod = new THREE.CylinderGeometry(1, 1, 1, 12);
    this.torus = new THREE.TorusGeometry(1.9, 0.7, 8, 16);
    this.listen();
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.show(this.picture));
  }

  listen() {
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    if (this.turnsByKeys) this.controls.listenToKeyEvents(this.canvas);
    this.controls.addEventListener('change', () => this.draw());
  }

  show(picture) {
    if (!picture) return;
    const isFirst = !this.picture;
    this.picture = picture;
    this.materials = Object.fromEntries(Object.entries(styles()).map(([part, color]) =>
      [part, new THREE.MeshLambertMaterial({ color })]));
    // The axes of the tool are seen through the plate that they are on.
    for (const axis of ['x', 'y', 'z']) this.materials[axis].depthTest = false;
    const points = picture.lines.flatMap((line) => [new THREE.Vector3(...line.from_m), new THREE.Vector3(...line.to_m)]);
    const box = new THREE.Box3().setFromPoints([...points, new THREE.Vector3()]);
    this.size ??= box.getSize(new THREE.Vector3()).length();
    this.arm.clear();
    for (const line of picture.lines) this.add(line);
    this.arm.add(this.ground(picture.is_planar));
    this.tool.position.set(...picture.tool.position_m);
    this.showMarker();
    if (isFirst) this.frame(box, picture.is_planar);
    this.draw();
  }

  // The measured tool as a diamond; `null` where there is none. A change that nobody could see is not drawn.
  setMeasured(tool) {
    const [from, to] = [this.measured?.position_m, tool?.position_m];
    const isSeen = !from || !to || Math.hypot(...to.map((value, axis) => value - from[axis])) > 2e-4 * (this.size ?? 0);
    if ((!from && !to) || !isSeen) return;
    this.measured = tool;
    if (!this.picture) return;
    this.showMarker();
    this.draw();
  }

  showMarker() {
    if (!this.measured) {
      if (this.marker) this.marker.visible = false;
      return;
    }
    if (!this.marker) {
      const edges = new THREE.EdgesGeometry(new THREE.OctahedronGeometry(1));
      this.marker = new THREE.LineSegments(edges, new THREE.LineBasicMaterial({ depthTest: false }));
      this.marker.renderOrder = 2;
      this.scene.add(this.marker);
    }
    this.marker.visible = true;
    this.marker.material.color = this.materials.ring.color;
    this.marker.scale.setScalar(0.03 * this.size);
    this.marker.position.set(...this.measured.position_m);
  }

  add({ part, from_m, to_m }) {
    const from = new THREE.Vector3(...from_m);
    const to = new THREE.Vector3(...to_m);
    const radius = 0.006 * this.size * RADIUS[part];
    if (part !== 'extended') {
      this.arm.add(this.cylinder(from, to, radius, part));
      return;
    }
    const middle = from.clone().lerp(to, SLEEVE);
    this.arm.add(this.cylinder(from, middle, radius, part), this.cylinder(middle, to, 0.4 * radius, part));
    const ring = new THREE.Mesh(this.torus, this.materials.ring);
    ring.position.copy(middle);
    ring.scale.setScalar(0.75 * radius);
    ring.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), to.sub(from).normalize());
    this.arm.add(ring);
  }

  cylinder(from, to, radius, part) {
    const mesh = new THREE.Mesh(this.rod, this.materials[part]);
    const along = to.clone().sub(from);
    mesh.position.copy(from).add(to).multiplyScalar(0.5);
    mesh.scale.set(radius, along.length(), radius);
    mesh.quaternion.setFromUnitVectors(UP, along.normalize());
    mesh.renderOrder = this.materials[part].depthTest ? 0 : 1;
    return mesh;
  }

  ground(isPlanar) {
    const half = 0.35 * this.size;
    const ends = isPlanar ? [[[-half, 0, 0], [half, 0, 0]]] : [-2, -1, 0, 1, 2].flatMap((k) => [
      [[-half, (k * half) / 2, 0], [half, (k * half) / 2, 0]],
      [[(k * half) / 2, -half, 0], [(k * half) / 2, half, 0]],
    ]);
    const points = ends.flat().map((point) => new THREE.Vector3(...point));
    const geometry = new THREE.BufferGeometry().setFromPoints(points);
    return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: this.materials.ground.color }));
  }

  // The complete arm, with room for it to move: a planar arm from the front, another from above at an angle.
  frame(box, isPlanar) {
    const middle = box.getCenter(new THREE.Vector3());
    const distance = (0.62 * this.size) / Math.tan((Math.PI / 360) * this.camera.fov);
    const direction = isPlanar ? new THREE.Vector3(0, 0, 1) : new THREE.Vector3(0.75, -1, 0.45).normalize();
    this.camera.up.set(...(isPlanar ? [0, 1, 0] : [0, 0, 1]));
    this.camera.near = 0.01 * distance;
    this.camera.far = 10 * distance;
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).addScaledVector(direction, distance);
    // The direction that points up is read when the controls are made.
    this.controls.dispose();
    this.listen();
    this.controls.target.copy(middle);
    this.controls.update();
    this.resize();
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas.parentElement;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  draw() {
    if (!this.picture) return;
    this.renderer.render(this.scene, this.camera);
    // Where the scene has the tool, in the base frame, m: for tests.
    const at = this.tool.getWorldPosition(new THREE.Vector3());
    this.canvas.dataset.tool = JSON.stringify([at.x, at.y, at.z]);
    this.canvas.dataset.measured = JSON.stringify(this.marker?.visible ? this.marker.position.toArray() : null);
  }
}
