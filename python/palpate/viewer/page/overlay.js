// What is drawn over the bodies: contacts, touching triangles, boxes, pulls, the probe's force.

import {
  BufferAttribute, BufferGeometry, ConeGeometry, CylinderGeometry, DoubleSide, DynamicDrawUsage, Group, InstancedMesh,
  LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial, Quaternion, SphereGeometry, Vector3,
} from "three";
import { withUnit } from "palpate/text";

const UP = new Vector3(0, 1, 0);
/** Nodes of a grip that are shown at most. */
const HELD = 32;
const EDGES = [0, 1, 0, 2, 0, 4, 1, 3, 1, 5, 2, 3, 2, 6, 3, 7, 4, 5, 4, 6, 5, 7, 6, 7];

export class Overlay {
  constructor(stage, labels) {
    this.stage = stage;
    this.labels = labels;
    this.group = new Group();
    stage.world.add(this.group);
    this.needles = null;
    this.dots = null;
    this.touching = new Mesh(
      new BufferGeometry(),
      new MeshBasicMaterial({
        color: 0xffd33d, side: DoubleSide, transparent: true, opacity: 0.85, polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -2,
      }),
    );
    this.boxes = new LineSegments(new BufferGeometry(), new LineBasicMaterial({ vertexColors: true, transparent: true, opacity: 0.8 }));
    this.touching.frustumCulled = this.boxes.frustumCulled = false;
    this.touching.renderOrder = 2;
    this.group.add(this.touching, this.boxes);
    this.pulls = [];
    this.marks = [];
    stage.afterDraw = () => this.placeLabels();
  }

  /** Show what a frame says of contacts, pulls and the probe. */
  update({ header, arrays }, positions, shown) {
    this.contacts(shown.contacts ? arrays : {});
    this.touch(shown.touching ? arrays.touching : undefined, positions);
    this.boxes.visible = shown.boxes;
    if (shown.boxes) this.showBoxes(arrays[`boxes/${shown.level}`], arrays[`box_counts/${shown.level}`], positions);
    this.showPulls(header.pulls ?? []);
    this.marks = (header.pulls ?? []).map((pull) => ({ at: pull.to, text: withUnit(Math.hypot(...pull.force), "N") }));
    if (header.tool) this.marks.push({ at: header.tool.tip, text: withUnit(Math.hypot(...header.tool.force), "N") });
    this.syncLabels();
  }

  contacts(arrays) {
    const points = arrays.contact_points ?? new Float32Array();
    const count = points.length / 3;
    if (!this.needles || this.needles.instanceMatrix.count < count) this.growContacts(count);
    const size = this.stage.size;
    const forces = arrays.contact_forces ?? [];
    const strongest = Math.max(1e-9, ...forces);
    const matrix = new Matrix4();
    const at = new Vector3(), normal = new Vector3(), scale = new Vector3(), turn = new Quaternion();
    for (let i = 0; i < count; i++) {
      at.fromArray(points, 3 * i);
      normal.fromArray(arrays.contact_normals, 3 * i);
      turn.setFromUnitVectors(UP, normal);
      const length = size * (0.015 + 0.06 * Math.sqrt(forces[i] / strongest));
      matrix.compose(at, turn, scale.set(0.004 * size, length, 0.004 * size));
      this.needles.setMatrixAt(i, matrix);
      matrix.compose(at, turn, scale.setScalar(0.0042 * size));
      this.dots.setMatrixAt(i, matrix);
    }
    for (const each of [this.needles, this.dots]) {
      each.count = count;
      each.visible = count > 0;
      each.instanceMatrix.needsUpdate = true;
    }
  }

  growContacts(count) {
    const capacity = Math.max(256, 2 ** Math.ceil(Math.log2(count + 1)));
    for (const old of [this.needles, this.dots]) {
      if (!old) continue;
      this.group.remove(old);
      old.geometry.dispose();
      old.dispose();
    }
    const needle = new ConeGeometry(0.5, 1, 6).translate(0, 0.5, 0);
    // On top of everything: a contact lies between two surfaces, where nothing would show it.
    const style = { depthTest: false, transparent: true };
    this.needles = new InstancedMesh(needle, new MeshBasicMaterial({ color: 0x0b3d66, opacity: 0.75, ...style }), capacity);
    this.dots = new InstancedMesh(new SphereGeometry(1, 10, 8), new MeshBasicMaterial({ color: 0xff4d2e, opacity: 0.95, ...style }), capacity);
    for (const each of [this.needles, this.dots]) {
      each.frustumCulled = false;
      each.renderOrder = 5;
      this.group.add(each);
    }
  }

  touch(numbers, positions) {
    const { geometry } = this.touching;
    this.touching.visible = Boolean(numbers?.length);
    if (!this.touching.visible) return;
    const corners = new Float32Array(9 * numbers.length);
    const { bodies } = this.stage;
    let body = 0;
    for (let i = 0, to = 0; i < numbers.length; i++) {
      while (body + 1 < bodies.length && numbers[i] >= bodies[body + 1].firstTriangle) body++;
      const row = 3 * (numbers[i] - bodies[body].firstTriangle);
      for (let k = 0; k < 3; k++, to += 3) {
        const from = 3 * (bodies[body].start + bodies[body].triangles[row + k]);
        corners.set(positions.subarray(from, from + 3), to);
      }
    }
    geometry.setAttribute("position", new BufferAttribute(corners, 3).setUsage(DynamicDrawUsage));
  }

  /** Boxes of the bounding trees, `counts` of them per body; without any, one around each body. */
  showBoxes(boxes, counts, positions) {
    boxes ??= this.bodyBoxes(positions);
    counts ??= this.stage.bodies.map(() => 1);
    const lines = new Float32Array((boxes.length / 6) * 3 * EDGES.length);
    const colors = new Float32Array(lines.length);
    let to = 0;
    let box = 0;
    this.stage.bodies.forEach((body, i) => {
      const color = body.tint.multiplyScalar(body.look.rigid ? 0.6 : 0.5).toArray();
      for (const end = box + counts[i]; box < end; box++) {
        if (!body.visible) continue;
        for (let at = to; at < to + 3 * EDGES.length; at += 3) colors.set(color, at);
        for (const corner of EDGES) {
          for (let axis = 0; axis < 3; axis++) lines[to++] = boxes[6 * box + axis + ((corner >> axis) & 1 ? 3 : 0)];
        }
      }
    });
    this.boxCount = to / 3 / EDGES.length;
    const { geometry } = this.boxes;
    geometry.setAttribute("position", new BufferAttribute(lines.subarray(0, to), 3));
    geometry.setAttribute("color", new BufferAttribute(colors.subarray(0, to), 3));
  }

  bodyBoxes(positions) {
    return this.stage.bodies.flatMap((body) => {
      const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
      for (let i = 3 * body.start, end = i + 3 * body.nodeCount; i < end; i++) {
        const axis = i % 3;
        low[axis] = Math.min(low[axis], positions[i]);
        high[axis] = Math.max(high[axis], positions[i]);
      }
      return [...low, ...high];
    });
  }

  showPulls(pulls) {
    while (this.pulls.length < pulls.length) this.pulls.push(new PullMark(this.group));
    this.pulls.forEach((mark, i) => mark.show(pulls[i], this.stage.size));
  }

  syncLabels() {
    while (this.labels.children.length < this.marks.length) {
      this.labels.append(Object.assign(document.createElement("div"), { className: "label" }));
    }
    while (this.labels.children.length > this.marks.length) this.labels.lastChild.remove();
    this.marks.forEach((mark, i) => (this.labels.children[i].textContent = mark.text));
  }

  placeLabels() {
    const { clientWidth: width, clientHeight: height } = this.stage.container;
    this.marks.forEach((mark, i) => {
      const at = this.stage.world.localToWorld(new Vector3(...mark.at)).project(this.stage.camera);
      const [x, y] = [((at.x + 1) / 2) * width + 12, ((1 - at.y) / 2) * height - 26];
      this.labels.children[i].style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    });
  }
}

/** A ball at the grip, dots at the nodes that it holds, a ball at the hand, and the spring between them. */
class PullMark {
  constructor(group) {
    const style = { depthTest: false, transparent: true };
    this.hand = new Mesh(new SphereGeometry(1, 16, 12), new MeshBasicMaterial({ color: 0x0f6b78, ...style }));
    this.grip = new Mesh(this.hand.geometry, new MeshBasicMaterial({ color: 0xffffff, ...style }));
    this.spring = new Mesh(new CylinderGeometry(1, 1, 1, 8).translate(0, 0.5, 0), this.hand.material);
    this.held = new InstancedMesh(this.hand.geometry, this.grip.material, HELD);
    this.parts = [this.spring, this.held, this.grip, this.hand];
    for (const each of this.parts) {
      each.renderOrder = 6;
      each.frustumCulled = false;
      group.add(each);
    }
  }

  show(pull, size) {
    for (const each of this.parts) each.visible = Boolean(pull);
    if (!pull) return;
    this.held.count = Math.min(HELD, pull.held.length);
    const dot = new Matrix4().makeScale(...Array(3).fill(0.0035 * size));
    for (let i = 0; i < this.held.count; i++) this.held.setMatrixAt(i, dot.setPosition(...pull.held[i]));
    this.held.instanceMatrix.needsUpdate = true;
    const from = new Vector3(...pull.from), to = new Vector3(...pull.to);
    this.grip.position.copy(from);
    this.grip.scale.setScalar(0.008 * size);
    this.hand.position.copy(to);
    this.hand.scale.setScalar(0.012 * size);
    const along = to.clone().sub(from);
    const length = along.length();
    this.spring.position.copy(from);
    this.spring.scale.set(0.003 * size, Math.max(length, 1e-9), 0.003 * size);
    if (length > 0) this.spring.quaternion.setFromUnitVectors(UP, along.divideScalar(length));
  }
}
