// The 3D pane of the HTML report: boxes of instances and a preview of the surface, drawn by three.js. Bundled by
// bundle.mjs into src/report/html/assets/pane.min.js, which defines globalThis.raykilnPane.
import {
  AmbientLight,
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Color,
  DirectionalLight,
  DoubleSide,
  EdgesGeometry,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshLambertMaterial,
  PerspectiveCamera,
  Raycaster,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const STEPS = 65535;
const FADED = 0.22;

function decoded(text, Type) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  return new Type(bytes.buffer);
}

/// A colour for a group: hues a golden angle apart, so that consecutive groups differ.
function colourOf(group, lightness, target) {
  return target.setHSL((group * 0.61803398875) % 1, 0.62, lightness);
}

/// One file: its surface and its boxes, as two meshes whose colours can be changed.
class Side {
  constructor(data) {
    this.data = data;
    this.groupOf = new Map(data.instances.map(({ id, group }) => [id, group]));
    this.surface = this.makeSurface();
    this.boxes = this.makeBoxes();
  }

  makeSurface() {
    const { preview, frame } = this.data;
    const corners = decoded(preview.corners, Uint16Array);
    this.triangleInstances = decoded(preview.instances, Uint32Array);
    const positions = new Float32Array(corners.length);
    corners.forEach((step, i) => {
      const side = frame[i % 3];
      positions[i] = (step / STEPS - 0.5) * side;
    });
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(positions, 3));
    geometry.setAttribute('color', new BufferAttribute(new Float32Array(corners.length), 3));
    geometry.computeVertexNormals();
    const material = new MeshLambertMaterial({ vertexColors: true, side: DoubleSide, flatShading: true });
    return new Mesh(geometry, material);
  }

  makeBoxes() {
    const edges = new EdgesGeometry(new BoxGeometry(1, 1, 1)).getAttribute('position');
    const boxes = decoded(this.data.boxes, Float32Array);
    const count = boxes.length / 6;
    const positions = new Float32Array(count * edges.count * 3);
    let at = 0;
    for (let box = 0; box < count; box += 1) {
      for (let v = 0; v < edges.count; v += 1) {
        for (let axis = 0; axis < 3; axis += 1) {
          const share = edges.array[3 * v + axis] + 0.5;
          const [least, most] = [boxes[6 * box + axis], boxes[6 * box + 3 + axis]];
          positions[at] = least + share * (most - least);
          at += 1;
        }
      }
    }
    this.boxCorners = boxes;
    this.linesPerBox = edges.count;
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(positions, 3));
    geometry.setAttribute('color', new BufferAttribute(new Float32Array(positions.length), 3));
    return new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true }));
  }

  /// Colours everything; if a group is selected, the rest fades into the background. Instances whose boxes are not listed
  /// are coloured by their own number.
  paint({ colours }, selected, background) {
    const colour = new Color();
    const isDark = background.getHSL({}).l < 0.5;
    const pick = (group, lightness) => {
      if (colours) colourOf(group, lightness, colour);
      else colour.set(0x9aa4b2).multiplyScalar(lightness / 0.55);
      if (selected !== null && group !== selected) colour.lerp(background, 1 - FADED);
      return colour;
    };
    const surface = this.surface.geometry.getAttribute('color');
    this.triangleInstances.forEach((instance, triangle) => {
      const { r, g, b } = pick(this.groupOf.get(instance) ?? instance, 0.55);
      for (let corner = 0; corner < 3; corner += 1) surface.setXYZ(3 * triangle + corner, r, g, b);
    });
    surface.needsUpdate = true;
    const boxes = this.boxes.geometry.getAttribute('color');
    this.data.instances.forEach(({ group }, box) => {
      const { r, g, b } = pick(group, isDark ? 0.75 : 0.3);
      for (let v = 0; v < this.linesPerBox; v += 1) boxes.setXYZ(this.linesPerBox * box + v, r, g, b);
    });
    boxes.needsUpdate = true;
  }

  /// The group of the smallest listed box that a ray enters.
  groupOfSmallestBox({ origin, direction }) {
    let best = { area: Infinity, group: null };
    this.data.instances.forEach(({ group }, box) => {
      const [a, b] = [this.boxCorners.subarray(6 * box, 6 * box + 3), this.boxCorners.subarray(6 * box + 3, 6 * box + 6)];
      let [near, far] = [0, Infinity];
      const size = [0, 1, 2].map((axis) => {
        const [o, d] = [origin.getComponent(axis), direction.getComponent(axis)];
        const [t0, t1] = [(a[axis] - o) / d, (b[axis] - o) / d];
        near = Math.max(near, Math.min(t0, t1));
        far = Math.min(far, Math.max(t0, t1));
        return b[axis] - a[axis];
      });
      const area = size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
      if (near <= far && area < best.area) best = { area, group };
    });
    return best.group;
  }
}

class Pane {
  constructor(element, sides, onSelect) {
    this.element = element;
    this.onSelect = onSelect;
    this.options = { surface: true, boxes: true, colours: true };
    this.selected = null;
    this.renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute('role', 'img');
    this.canvas.setAttribute('aria-label', '3D view of the groups; arrow keys turn it, N and P select a group');
    element.replaceChildren(this.canvas);
    this.camera = new PerspectiveCamera(45, 1, 0.001, 200);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener('change', () => this.draw());
    this.sides = new Map([...sides].map(([name, data]) => [name, new Side(data)]));
    this.scene = new Scene();
    this.scene.add(new AmbientLight(0xffffff, 1.6));
    const light = new DirectionalLight(0xffffff, 1.8);
    light.position.set(0.6, 1, 0.8);
    this.scene.add(light);
    this.listen();
    this.reset();
    new ResizeObserver(() => this.resize()).observe(element);
  }

  listen() {
    let pressed = null;
    this.canvas.addEventListener('pointerdown', (event) => {
      pressed = [event.clientX, event.clientY];
    });
    this.canvas.addEventListener('pointerup', (event) => {
      const moved = pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]);
      if (moved !== null && moved < 5) this.pick(event);
    });
    this.canvas.addEventListener('keydown', (event) => this.key(event));
  }

  key(event) {
    const turn = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, -0.15], ArrowDown: [0, 0.15] }[event.key];
    const zoom = { '+': 0.9, '=': 0.9, '-': 1 / 0.9 }[event.key];
    const step = { n: 1, p: -1 }[event.key.toLowerCase()];
    if (turn) this.turn(...turn);
    else if (zoom) this.camera.position.sub(this.controls.target).multiplyScalar(zoom).add(this.controls.target);
    else if (step) this.step(step);
    else if (event.key === 'Escape') this.select(null);
    else return;
    event.preventDefault();
    this.controls.update();
    this.draw();
  }

  turn(around, up) {
    const arm = this.camera.position.clone().sub(this.controls.target);
    const across = new Vector3(0, 1, 0).cross(arm).normalize();
    const tilted = arm.clone().applyAxisAngle(across, up);
    if (Math.abs(tilted.clone().normalize().y) < 0.98) arm.copy(tilted);
    this.camera.position.copy(arm.applyAxisAngle(new Vector3(0, 1, 0), around)).add(this.controls.target);
  }

  /// Selects the next or the previous of the listed groups.
  step(by) {
    const groups = this.current.data.groups;
    const at = groups.findIndex(({ id }) => id === this.selected);
    const next = at < 0 ? (by > 0 ? 0 : groups.length - 1) : (at + by + groups.length) % groups.length;
    if (groups.length > 0) this.select(groups[next].id);
  }

  pick(event) {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const at = new Vector2((2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height);
    const caster = new Raycaster();
    caster.setFromCamera(at, this.camera);
    const [hit] = this.options.surface ? caster.intersectObject(this.current.surface) : [];
    const ofHit = hit && this.current.groupOf.get(this.current.triangleInstances[hit.faceIndex]);
    this.select(ofHit ?? (this.options.boxes ? this.current.groupOfSmallestBox(caster.ray) : null));
  }

  select(group) {
    this.selected = group;
    this.restyle();
    this.onSelect(group);
  }

  show(name) {
    if (this.current) this.scene.remove(this.current.surface, this.current.boxes);
    this.current = this.sides.get(name);
    this.scene.add(this.current.surface, this.current.boxes);
    this.select(null);
    this.resize();
  }

  set(options) {
    Object.assign(this.options, options);
    this.restyle();
  }

  reset() {
    const [first] = this.sides.values();
    const reach = Math.hypot(...first.data.frame);
    this.controls.target.set(0, 0, 0);
    this.camera.position.set(0.55, 0.5, 0.85).multiplyScalar(1.1 * reach);
    this.controls.update();
    this.draw();
  }

  /// Takes the colours of the page's theme.
  restyle() {
    const background = new Color(getComputedStyle(this.element).backgroundColor);
    this.scene.background = background;
    if (!this.current) return;
    this.current.surface.visible = this.options.surface;
    this.current.boxes.visible = this.options.boxes;
    this.current.paint(this.options, this.selected, background);
    this.draw();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(globalThis.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  draw() {
    if (this.current) this.renderer.render(this.scene, this.camera);
  }
}

globalThis.raykilnPane = { create: (element, sides, onSelect) => new Pane(element, sides, onSelect) };
